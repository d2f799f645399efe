//! The frames of a session around a broken transfer, and which of them belong to whole ones.
//!
//! All is read from the bytes of a fixed stretch of frames, so that it does not depend on how a capture is cut.
#![forbid(unsafe_code)]

use super::index::Frames;
use super::{alternate, Cause, Expected, Form, Known, Part, ID};

/// Frames before and behind a transfer among which its own may have strayed.
pub const LOOK: u64 = 64;
/// Frames behind it that show what the sender's other transfers are like.
pub const AHEAD: u64 = 512;
/// Frames before it that do.
pub const BEFORE: u64 = 2048;
/// Frames of the session before it, and as many behind it.
const MOST: usize = 48;
/// Frames from the first to the last of a transfer that is looked into.
const WIDEST: u64 = 8192;
/// Frames that are further apart than this belong to no common transfer.
const TIMEOUT: i64 = 2_000_000_000;
const NO_TIME: i64 = i64::MIN;
/// Toggles that stand still by habit, not by accident.
const UNSTEADY: usize = 2;
const IDS: usize = 32;

/// The surroundings of a broken transfer: frames of its session in order, and the whole transfers of more than one
/// frame. `near` are those within 2.0 s, `settled` the numbers of those that belong to transfers with the right CRC.
#[derive(Clone, Debug)]
pub struct Neighbours<'a, 'k> {
    pub parts: Vec<Part<'a>>,
    pub near: Vec<Part<'a>>,
    pub whole: Vec<Vec<Part<'a>>>,
    pub settled: Vec<u64>,
    pub expected: Expected<'k>,
}

impl<'a, 'k> Neighbours<'a, 'k> {
    /// What is around frames of one session and type; None if they are gone or too far apart.
    pub fn of(frames: Frames<'a>, wanted: &[u64], known: &'k Known, fd: bool) -> Option<Self> {
        let (&first, &last) = (wanted.first()?, wanted.last()?);
        let parts: Option<Vec<Part<'a>>> = wanted.iter().map(|&number| frames.part(number)).collect();
        let (parts, key) = (parts?, frames.session(first)?);
        if last.checked_sub(first)? > WIDEST {
            return None;
        }
        let mut every = Vec::with_capacity(2 * MOST + 16);
        frames.take(key, &(first.saturating_sub(BEFORE)..first), MOST, true, &mut every);
        frames.take(key, &(first..last + 1), usize::MAX, false, &mut every);
        frames.take(key, &(last + 1..last + 1 + AHEAD), MOST, false, &mut every);
        let mut expected = Expected {
            known,
            fd,
            lengths: vec![],
            singles: vec![],
        };
        let (whole, settled) = runs(&every, &expected);
        for part in every.iter().filter(|part| part.start() && part.end() && !part.toggle()) {
            insert(&mut expected.singles, part.body.len());
        }
        for run in &whole {
            let right = expected.fits_nothing() || settled.binary_search(&run[0].number).is_ok();
            if let (true, Some(end)) = (right, run.last()) {
                insert(&mut expected.lengths, (run.len(), end.body.len()));
            }
        }
        keep_near(&mut every, first, last);
        Some(Neighbours {
            parts,
            near: every,
            whole,
            settled,
            expected,
        })
    }

    fn is_settled(&self, number: u64) -> bool {
        self.settled.binary_search(&number).is_ok()
    }

    /// The same frames around others.
    #[must_use]
    pub fn with(&self, parts: Vec<Part<'a>>) -> Self {
        Neighbours { parts, ..self.clone() }
    }

    /// The numbers of the first and the last of its frames.
    pub fn span(&self) -> (u64, u64) {
        let number = |part: Option<&Part<'_>>| part.map_or(0, |part| part.number);
        (number(self.parts.first()), number(self.parts.last()))
    }

    /// Frames that may belong to it, though they are of no whole transfer: they have its ID, or another one and stand
    /// inside, or behind it if it has no end.
    pub fn around(&self) -> Vec<Part<'a>> {
        let (low, high) = self.span();
        let mine = self.parts[0].id();
        let ends = self.parts.last().is_some_and(Part::end);
        let strange = |part: &&Part<'_>| part.number > high && part.id() != mine;
        let last = if ends { None } else { self.near.iter().find(strange) };
        let may = |part: &&Part<'a>| {
            let number = part.number;
            let reach = low.saturating_sub(LOOK) <= number && number <= high + LOOK;
            let inside = low < number && number < high;
            reach
                && (part.id() == mine || (!part.start() && (inside || last.is_some_and(|last| last.number == number))))
                && !self.parts.iter().any(|own| own.number == number)
                && !self.is_settled(number)
        };
        self.near.iter().filter(may).copied().collect()
    }

    /// The cause if a whole transfer before it had each of its frames, byte for byte.
    pub fn copy(&self) -> Option<Cause> {
        let (first, _) = self.span();
        let before: Vec<&Part<'_>> = self
            .near
            .iter()
            .filter(|part| part.number < first && self.is_settled(part.number))
            .collect();
        let found = self.parts.iter().map(|part| {
            let same = before.iter().rev().find(|one| one.like(part));
            same.map(|one| one.number)
        });
        let numbers = found.collect::<Option<Vec<u64>>>()?;
        Some(Cause::new(Form::LateCopy, &numbers))
    }

    /// The frame of two with different transfer IDs whose ID is wrong, both if nobody knows. Right is the ID that follows
    /// that of the transfer before them, or is followed by that of the one behind them.
    pub fn misnumbered(&self, first: &Part<'a>, second: &Part<'a>) -> Vec<Part<'a>> {
        let starts = |part: &&Part<'_>| part.start() && (part.end() || self.is_settled(part.number));
        let mut starting = self.near.iter().filter(starts);
        let behind = starting.clone().find(|part| part.number > second.number);
        let before = starting.rfind(|part| part.number < first.number);
        let meant = |part: Option<&Part<'_>>, step: u8| part.map(|part| part.id().wrapping_add(step) & ID);
        let near = [meant(before, 1), meant(behind, ID)];
        let wrong = |part: &&Part<'a>| !near.contains(&Some(part.id()));
        let wrong: Vec<Part<'a>> = [first, second].into_iter().filter(wrong).copied().collect();
        if wrong.len() == 1 {
            wrong
        } else {
            vec![*first, *second]
        }
    }

    /// Whether toggles stand still in other transfers of the session, too.
    pub fn is_unsteady(&self) -> bool {
        let mut last: [Option<&Part<'_>>; IDS] = [None; IDS];
        let mut breaks = 0;
        for part in &self.near {
            let before = last[usize::from(part.id())].replace(part);
            let own = self.parts.iter().any(|one| one.number == part.number);
            if let (Some(before), false, false) = (before, part.start(), own) {
                breaks += usize::from(!part.like(before) && part.toggle() == before.toggle());
            }
        }
        breaks >= UNSTEADY
    }
}

fn insert<T: PartialEq>(known: &mut Vec<T>, one: T) {
    if !known.contains(&one) {
        known.push(one);
    }
}

/// Leaves frames within 2.0 s of those from one number to another.
fn keep_near(every: &mut Vec<Part<'_>>, first: u64, last: u64) {
    let own = every.iter().filter(|part| (first..=last).contains(&part.number));
    let times = own.map(|part| part.t).filter(|&t| t != NO_TIME);
    let Some((low, high)) = times.fold(None, |known: Option<(i64, i64)>, t| {
        known.map_or(Some((t, t)), |(low, high)| Some((low.min(t), high.max(t))))
    }) else {
        return;
    };
    let (low, high) = (low.saturating_sub(TIMEOUT), high.saturating_add(TIMEOUT));
    every.retain(|part| part.t == NO_TIME || (low..=high).contains(&part.t));
}

/// Runs from start to end with right toggles, and the frames of those (and copies) whose CRC is right, in order.
fn runs<'a>(near: &[Part<'a>], expected: &Expected<'_>) -> (Vec<Vec<Part<'a>>>, Vec<u64>) {
    let (mut whole, mut settled) = (vec![], vec![]);
    let mut under_way: [(Vec<Part<'a>>, Vec<u64>); IDS] = Default::default();
    for &part in near {
        let (run, numbers) = &mut under_way[usize::from(part.id())];
        let before = run.last().copied();
        if before.is_some_and(|before| before.like(&part)) {
            numbers.push(part.number);
        } else if part.start() {
            run.clear();
            numbers.clear();
            if part.end() {
                settled.push(part.number);
            } else if !part.toggle() {
                run.push(part);
                numbers.push(part.number);
            }
        } else if before.is_some_and(|before| before.toggle() != part.toggle()) {
            run.push(part);
            numbers.push(part.number);
            if part.end() {
                let run = std::mem::take(run);
                if expected.fits_nothing() || expected.fits(&run) {
                    settled.append(numbers);
                }
                numbers.clear();
                debug_assert!(alternate(&run));
                whole.push(run);
            }
        } else {
            run.clear();
            numbers.clear();
        }
    }
    settled.sort_unstable();
    (whole, settled)
}
