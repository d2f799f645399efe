//! What rules ask of frames that are no whole transfer.
#![forbid(unsafe_code)]

use super::index::Frames;
use super::losses::missing;
use super::neighbours::Neighbours;
use super::proofs::{proven, Proof};
use super::tail_bits::in_a_row;
use super::{numbers, Cause, Form, Known, Part, CRC_BYTES};
use crate::wire::crc_start_from;

/// Bits of `Found::flags`.
pub const PROVEN: u8 = 1;
/// The last frame belongs to a later attempt with the same ID, of which the same is said.
pub const LATER: u8 = 2;
/// The transfer begins with another frame, of which the same is said.
pub const ELSEWHERE: u8 = 4;
/// The first frame has, or may have, the wrong transfer ID.
pub const MISNUMBERED: u8 = 8;
/// The sender's transfers nearby show how long they are.
pub const LENGTHS: u8 = 16;

/// What is asked.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Question {
    /// Why a transfer is broken; `value` is the time of the first frame of its session behind it.
    Broken,
    /// Why its CRC is wrong; `value` is the start that explains it and most others nearby, -1 for none.
    Checksum,
    /// Of what a rest without a start is left; nothing if another transfer says so itself.
    Remainder,
    /// Whether a frame that looks like a copy is one, a late one, or nothing of the kind.
    Copy,
    /// What a frame with another transfer ID does inside a transfer; nothing if it is left of another one.
    Inside,
}

/// The answer; `evidence` are frames that show it, beside those that were asked about.
#[derive(Clone, Debug)]
pub struct Found {
    pub cause: Cause,
    pub flags: u8,
    pub evidence: Vec<u64>,
    pub value: i64,
}

impl Found {
    fn new(cause: Cause) -> Self {
        Found {
            cause,
            flags: 0,
            evidence: vec![],
            value: -1,
        }
    }

    fn plain(form: Form) -> Self {
        Found::new(Cause::new(form, &[]))
    }
}

/// Answers a question about frames of one session and type.
pub fn ask(question: Question, frames: Frames<'_>, wanted: &[u64], known: &Known, fd: bool) -> Found {
    let Some(here) = Neighbours::of(frames, wanted, known, fd) else {
        return Found::plain(Form::Gone);
    };
    match question {
        Question::Broken => broken(&here),
        Question::Checksum => checksum(&here),
        Question::Remainder => Found::new(remainder(&here).unwrap_or(Cause::new(Form::Nothing, &[]))),
        Question::Copy => Found::plain(if is_needed(&here) {
            Form::Nothing
        } else {
            Form::Repeated
        }),
        Question::Inside => Found::new(inside(&here)),
    }
}

fn holds(parts: &[Part<'_>], one: &Part<'_>) -> bool {
    parts.iter().any(|part| part.is(one))
}

fn broken(here: &Neighbours<'_, '_>) -> Found {
    let (parts, expected) = (&here.parts, &here.expected);
    let around = here.around();
    let id = parts[0].id();
    let same_id: Vec<Part<'_>> = around.iter().filter(|part| part.id() == id).copied().collect();
    let (_, high) = here.span();
    let behind = here.near.iter().filter(|part| part.number > high);
    let mut flags = 0;
    let mut shown: Option<Proof<'_>> = None;
    let mut cause = match copy(here) {
        Some(cause) => cause,
        None => match proven(parts, &around, expected) {
            Some(proof) => {
                flags |= PROVEN;
                let strays = matches!(proof.cause.form, Form::Repeated | Form::Swapped);
                let begins = |part: &Part<'_>| part.start() && !part.toggle() && part.number > high;
                let outside = proof.order.last().is_some_and(|last| !holds(parts, last));
                if strays && outside && around.iter().any(begins) {
                    flags |= LATER;
                }
                shown.insert(proof).cause.clone()
            }
            None => match in_a_row(parts, &here.near, expected) {
                Some(proof) => {
                    if !holds(parts, &proof.order[0]) {
                        flags |= ELSEWHERE;
                    }
                    shown.insert(proof).cause.clone()
                }
                None if expected.fits_nothing() && !same_id.is_empty() => Cause::new(Form::Unproven, &[]),
                None => missing(parts, expected).unwrap_or(Cause::new(Form::NoOrder, &[])),
            },
        },
    };
    if cause.form == Form::Either && here.is_unsteady() {
        cause = Cause::new(Form::WrongBit, &[]);
    }
    // The first frame of a transfer of two if its ID is wrong, both if nobody knows.
    if let (Form::OtherId, Some([first, second])) = (cause.form, shown.as_ref().map(|proof| &proof.order[..])) {
        let wrong = here.misnumbered(first, second);
        if holds(&wrong, first) {
            flags |= MISNUMBERED;
            cause = Cause::new(Form::OtherId, &numbers(&wrong));
        }
    }
    Found {
        cause,
        flags,
        evidence: numbers(&same_id),
        value: behind.map(|part| part.t).min().unwrap_or(i64::MAX),
    }
}

/// The cause of a copy, unless a sender counts every frame: its tail bytes come round by themselves.
fn copy(here: &Neighbours<'_, '_>) -> Option<Cause> {
    let copy = here.copy()?;
    let row = in_a_row(&here.parts, &here.near, &here.expected);
    (!row.is_some_and(|row| row.cause.form == Form::EveryId)).then_some(copy)
}

fn checksum(here: &Neighbours<'_, '_>) -> Found {
    let (parts, expected) = (&here.parts, &here.expected);
    let around = here.around();
    if let Some(proof) = proven(parts, &around, expected) {
        let elsewhere = proof.cause.form == Form::StartBit && !holds(parts, &proof.order[0]);
        let own = |part: &&Part<'_>| proof.order.iter().any(|one| one.number == part.number);
        return Found {
            flags: PROVEN | if elsewhere { ELSEWHERE } else { 0 },
            evidence: around.iter().filter(own).map(|part| part.number).collect(),
            cause: proof.cause,
            value: -1,
        };
    }
    let room = expected.room();
    let short = parts[..parts.len() - 1].iter().find(|part| part.body.len() < room);
    let cause = match short {
        Some(part) => Some(Cause::new(Form::Short, &[part.body.len() as u64 + 1, part.number])),
        None => missing(parts, expected),
    };
    Found {
        flags: if expected.lengths.is_empty() { 0 } else { LENGTHS },
        value: shared_start(here).map_or(-1, i64::from),
        ..Found::new(cause.unwrap_or(Cause::new(Form::Nothing, &[])))
    }
}

/// The start value that explains this and most of the other wrong CRCs nearby.
fn shared_start(here: &Neighbours<'_, '_>) -> Option<u16> {
    let (mine, id) = (joined(&here.parts), here.parts[0].id());
    let start = start_of(&mine)?;
    let wrong = here.whole.iter().filter(|run| !here.expected.fits(run));
    let others = wrong.map(|run| (joined(run), run[0].id()));
    let others = others.filter(|(bytes, other)| bytes.len() > CRC_BYTES && (bytes, *other) != (&mine, id));
    let starts = others.filter_map(|(bytes, _)| start_of(&bytes));
    let (mut all, mut same) = (0, 0);
    for other in starts {
        all += 1;
        same += usize::from(other == start);
    }
    (same > 0 && 2 * same >= all).then_some(start)
}

fn joined(parts: &[Part<'_>]) -> Vec<u8> {
    parts.iter().flat_map(|part| part.body).copied().collect()
}

/// From which value the CRC of a transfer begins; None if it is too short to have one.
fn start_of(bytes: &[u8]) -> Option<u16> {
    let (crc, payload) = bytes.split_first_chunk::<CRC_BYTES>()?;
    Some(crc_start_from(u16::from_le_bytes(*crc), payload))
}

fn remainder(here: &Neighbours<'_, '_>) -> Option<Cause> {
    let parts = &here.parts;
    if let Some(copy) = here.copy() {
        return Some(copy);
    }
    if let Some(proof) = proven(parts, &here.around(), &here.expected) {
        let own = |part: &Part<'_>| parts.iter().any(|one| one.number == part.number);
        return proof.order.iter().all(own).then_some(proof.cause);
    }
    let Some(row) = in_a_row(parts, &here.near, &here.expected) else {
        return missing(parts, &here.expected);
    };
    // The frames behind a single one with an end bit too many: nothing else tells of them.
    let alone = row.order[0].start() && row.order[0].end() && row.order[1].is(&parts[0]);
    alone.then_some(row.cause)
}

/// Whether a frame that looks like a copy is none: where toggles stand still, or where one between both has another
/// transfer ID, the CRC is right only with it.
fn is_needed(here: &Neighbours<'_, '_>) -> bool {
    let frame = here.parts[0];
    if here.settled.binary_search(&frame.number).is_ok() {
        return false;
    }
    let run = from_start(&here.near, &frame);
    let mut apart: Vec<Part<'_>> = vec![];
    for (k, part) in run.iter().enumerate() {
        if k == 0 || !part.like(&run[k - 1]) {
            apart.push(*part);
        }
    }
    let stands_still = apart.windows(2).any(|two| two[0].toggle() == two[1].toggle());
    if (stands_still || apart.len() == 1) && here.expected.fits(&run) {
        return true;
    }
    if apart.is_empty() {
        return false;
    }
    let here = here.with(apart);
    let twice = |order: &[Part<'_>]| order.iter().filter(|part| part.like(&frame)).count() > 1;
    proven(&here.parts, &here.around(), &here.expected).is_some_and(|proof| proof.holds(&frame) && twice(&proof.order))
}

/// The transfer around a frame as it came, copies and all: from the start before it to the end behind it.
fn from_start<'a>(near: &[Part<'a>], frame: &Part<'_>) -> Vec<Part<'a>> {
    let mine: Vec<Part<'a>> = near.iter().filter(|part| part.id() == frame.id()).copied().collect();
    let begins = |part: &Part<'_>| part.start() && part.number <= frame.number;
    let mut first = mine.iter().rposition(begins).unwrap_or(0);
    while first > 0 && mine[first - 1].like(&mine[first]) {
        first -= 1;
    }
    let ends = |part: &Part<'_>| part.end() && part.number >= frame.number;
    let behind = mine.iter().position(ends).map_or(mine.len(), |last| last + 1);
    mine.get(first..behind).unwrap_or_default().to_vec()
}

/// What a frame with another transfer ID does inside a transfer. Nothing if it is left of one that was cut itself, or if
/// the ID of the frame before it is or may be wrong.
fn inside(here: &Neighbours<'_, '_>) -> Cause {
    let (frame, expected) = (here.parts[0], &here.expected);
    let plain = |form| Cause::new(form, &[]);
    let copy = here.copy();
    for run in &here.whole {
        let around = run[0].number < frame.number && run.last().is_some_and(|last| frame.number < last.number);
        if around && run[0].id() != frame.id() {
            let right = expected.fits(run);
            return copy.unwrap_or(plain(if right { Form::ForeignRight } else { Form::Inside }));
        }
    }
    let proof = of_the_outer(here, &frame);
    if let Some(proof) = proof.as_ref().filter(|proof| proof.holds(&frame)) {
        let unsure = match &proof.order[..] {
            [first, second] if second.is(&frame) => holds(&here.misnumbered(first, second), first),
            _ => false,
        };
        return plain(if unsure { Form::Nothing } else { Form::Belongs });
    }
    if let Some(copy) = copy {
        return copy;
    }
    if proof.is_some() {
        return plain(Form::Foreign);
    }
    if expected.fits_nothing() {
        return plain(Form::Inside);
    }
    plain(if is_right_from(here, &frame) {
        Form::Nothing
    } else {
        Form::Inside
    })
}

/// Whether toggles alternate from a frame to the end behind it.
fn is_right_from(here: &Neighbours<'_, '_>, frame: &Part<'_>) -> bool {
    let own = |part: &&Part<'_>| part.number >= frame.number && part.id() == frame.id();
    let rest: Vec<Part<'_>> = here.near.iter().filter(own).copied().collect();
    let end = rest.iter().position(Part::end);
    end.is_some_and(|end| rest[..=end].windows(2).all(|two| two[0].toggle() != two[1].toggle()))
}

/// What must be different in the transfer that was begun before a frame with another ID, if that is known.
fn of_the_outer<'a>(here: &Neighbours<'a, '_>, frame: &Part<'_>) -> Option<Proof<'a>> {
    let begins = |part: &&Part<'_>| part.number < frame.number && part.start() && !part.end();
    let begun = here.near.iter().rfind(begins).filter(|part| part.id() != frame.id())?;
    let own = |part: &&Part<'_>| part.id() == begun.id() && part.number >= begun.number;
    let mut outer: Vec<Part<'a>> = here.near.iter().filter(own).copied().collect();
    let cut = (1..outer.len()).find(|&k| outer[k].start() || outer[k - 1].end());
    outer.truncate(cut.unwrap_or(outer.len()));
    let here = here.with(outer);
    proven(&here.parts, &here.around(), &here.expected)
}
