//! Frames to transfers: every frame ends in exactly one transfer or with a verdict that says why not.
//!
//! Links point backwards only (a transfer names its frames), so a batch can be handed on at any frame. Whether a session
//! is DroneCAN at all is learnt late (see [`crate::trust`]): earlier frames of it are listed in [`Settled`].
#![forbid(unsafe_code)]

use std::collections::HashMap;

use crate::frames::{Frames, ERROR, EXTENDED, FD, NO_TIME, REMOTE};
use crate::session::{Candidates, Known, Session};
use crate::sessions::Index;
use crate::slot::Frame;
use crate::transfers::Transfers;
use crate::trust::{Judgement, Probation};
use crate::verdict::{flaw, Outcome, Verdict, VERDICTS};
use crate::wire::{crc_start, session_bits, Id, Kind};

/// Open transfers are looked over for the timeout this often, in capture time.
const SWEEP_NS: i64 = 500_000_000;

/// Frames that all sessions on probation may hold back together.
pub const MAX_HELD: usize = 1 << 18;

/// Asks for the signatures of (is a service, data type ID), the preferred one first; none when the type is unknown.
pub type Resolve = Box<dyn FnMut(bool, u16) -> Vec<u64> + Send + Sync>;

/// A known type: (is a service, data type ID, which of the types with this ID).
pub type TypeName = (bool, u16, u8);

/// Verdicts of frames that an earlier batch reported otherwise.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Settled {
    pub frame: Vec<u64>,
    pub verdict: Vec<u8>,
    pub anomaly: Vec<u16>,
}

/// What has been found since the last [`Reassembler::take`].
#[derive(Debug, Default)]
pub struct Results {
    /// Number of the first frame of this batch.
    pub first_frame: u64,
    pub verdict: Vec<u8>,
    pub anomaly: Vec<u16>,
    pub transfers: Transfers,
    pub settled: Settled,
}

/// Whether a session speaks DroneCAN.
enum Standing {
    Trusted,
    Foreign,
    Probation(Box<Probation>),
}

pub struct Reassembler {
    resolve: Resolve,
    /// Known types in the order in which they occurred.
    types: Vec<TypeName>,
    resolved: HashMap<(bool, u16), Candidates>,
    index: Index,
    sessions: Vec<(Standing, Session)>,
    /// Which (bus, node) have sent DroneCAN.
    speakers: Vec<bool>,
    results: Results,
    next_frame: u64,
    counts: [u64; VERDICTS],
    /// Frames held back by sessions on probation.
    held: usize,
    /// The time of the last frame that had one, on all buses and on each.
    now: i64,
    bus_time: [i64; 256],
    next_sweep: i64,
    since_sweep: usize,
}

impl Reassembler {
    pub fn new(resolve: Resolve) -> Self {
        Reassembler {
            resolve,
            types: vec![],
            resolved: HashMap::new(),
            index: Index::default(),
            sessions: vec![],
            speakers: vec![false; 256 * 128],
            results: Results::default(),
            next_frame: 0,
            counts: [0; VERDICTS],
            held: 0,
            now: NO_TIME,
            bus_time: [NO_TIME; 256],
            next_sweep: NO_TIME,
            since_sweep: 0,
        }
    }

    /// Frames by verdict so far; their sum is the number of frames.
    pub fn counts(&self) -> [u64; VERDICTS] {
        self.counts
    }

    pub fn types(&self) -> &[TypeName] {
        &self.types
    }

    /// The time of the last frame, or [`NO_TIME`].
    pub fn now(&self) -> i64 {
        self.now
    }

    /// Runs the rows of `frames` from `first` on.
    pub fn feed(&mut self, frames: &Frames, first: usize) {
        for row in first..frames.len() {
            let (t, bus, flags) = (frames.t[row], frames.bus[row], frames.flags[row]);
            let frame = Frame {
                number: self.next_frame,
                t,
                id: frames.id[row],
                fd: flags & FD != 0,
                data: frames.data_of(row),
            };
            self.next_frame += 1;
            let late = self.clock(bus, t);
            let mut outcome = if flags & (EXTENDED | REMOTE | ERROR) == EXTENDED {
                self.extended(bus, &frame, false)
            } else if flags & EXTENDED != 0 {
                self.extended(bus, &frame, true)
            } else {
                Outcome::FOREIGN
            };
            outcome.flaws |= late | (u16::from(frame.impossible_length()) * flaw::IMPOSSIBLE_LENGTH);
            self.counts[outcome.verdict as usize] += 1;
            self.results.verdict.push(outcome.verdict as u8);
            self.results.anomaly.push(outcome.flaws);
        }
    }

    /// End of capture: what is still open becomes evidence too.
    pub fn finish(&mut self) {
        for at in 0..self.sessions.len() {
            let speaks = self.speakers[self.speaker(at)];
            let (standing, session) = &mut self.sessions[at];
            match standing {
                Standing::Trusted => session.finish(self.now, &mut self.results.transfers),
                Standing::Foreign => {}
                Standing::Probation(probation) => {
                    session.finish(self.now, &mut probation.transfers);
                    let judgement = probation.last_word(session, speaks);
                    let note = probation.note_of_refusal();
                    let last = probation.held.last().map(|held| held.frame);
                    self.settle(at, judgement);
                    if let (Judgement::Foreign, Some(frame), 1..) = (judgement, last, note) {
                        self.report(frame, Outcome::flawed(Verdict::Foreign, note));
                    }
                }
            }
        }
    }

    /// Hands over what was found and starts the next batch.
    pub fn take(&mut self) -> Results {
        let next = Results {
            first_frame: self.next_frame,
            ..Results::default()
        };
        std::mem::replace(&mut self.results, next)
    }

    /// Follows the capture time; the flaw of a frame that is earlier than its predecessor.
    #[inline]
    fn clock(&mut self, bus: u8, t: i64) -> u16 {
        if t == NO_TIME {
            return 0;
        }
        let last = &mut self.bus_time[usize::from(bus)];
        let late = u16::from(t < *last) * flaw::BACKWARDS;
        *last = t;
        self.now = t;
        self.since_sweep += 1;
        // A single stamp far ahead of the others must not put the sweeps off.
        let due = t >= self.next_sweep || t < self.next_sweep.saturating_sub(2 * SWEEP_NS);
        if due && self.since_sweep >= self.sessions.len() {
            self.sweep(t);
        }
        late
    }

    /// Closes what has timed out on sessions that fell silent.
    #[cold]
    fn sweep(&mut self, t: i64) {
        self.next_sweep = t.saturating_add(SWEEP_NS);
        self.since_sweep = 0;
        for (standing, session) in &mut self.sessions {
            match standing {
                Standing::Trusted => session.expire(t, &mut self.results.transfers),
                Standing::Foreign => {}
                Standing::Probation(probation) => session.expire(t, &mut probation.transfers),
            }
        }
    }

    #[inline]
    fn extended(&mut self, bus: u8, frame: &Frame<'_>, remote: bool) -> Outcome {
        let key = (u64::from(bus) << 32) | u64::from(session_bits(frame.id));
        let found = self.index.find(key);
        let Some(at) = found.or_else(|| self.open_session(key, bus, frame.id)) else {
            return Outcome::flawed(Verdict::Foreign, flaw::LIMIT);
        };
        let (standing, session) = &mut self.sessions[at];
        match standing {
            Standing::Trusted if !remote => session.accept(frame, &mut self.results.transfers),
            Standing::Trusted => REMOTE_FRAME,
            Standing::Foreign => Outcome::FOREIGN,
            Standing::Probation(_) => self.probe(at, frame, remote),
        }
    }

    #[cold]
    fn open_session(&mut self, key: u64, bus: u8, id: u32) -> Option<usize> {
        let id = Id::parse(id);
        let known = self.known(id);
        let at = self.index.insert(key)?;
        let probation = Standing::Probation(Box::default());
        self.sessions.push((probation, Session::new(id, bus, known)));
        Some(at)
    }

    fn known(&mut self, id: Id) -> Candidates {
        let (service, type_id) = (id.kind.is_service(), id.type_id);
        if let Some(known) = self.resolved.get(&(service, type_id)) {
            return known.clone();
        }
        let types = &mut self.types;
        let add = |(variant, signature)| {
            types.push((service, type_id, variant));
            Known {
                index: (types.len() - 1) as u16,
                crc_start: crc_start(signature),
            }
        };
        let known: Candidates = (0..=u8::MAX).zip((self.resolve)(service, type_id)).map(add).collect();
        self.resolved.insert((service, type_id), known.clone());
        known
    }

    /// A frame of a session that has not proven itself.
    #[cold]
    fn probe(&mut self, at: usize, frame: &Frame<'_>, remote: bool) -> Outcome {
        let speaks = self.speakers[self.speaker(at)];
        let (standing, session) = &mut self.sessions[at];
        let Standing::Probation(probation) = standing else {
            return Outcome::FOREIGN;
        };
        let outcome = if remote {
            REMOTE_FRAME
        } else {
            session.accept(frame, &mut probation.transfers)
        };
        let tail = if remote { None } else { frame.data.last().copied() };
        let reported = probation.note(frame.number, outcome, tail, session.is_known());
        let mut judgement = probation.judge(session, speaks);
        self.held += 1;
        let full = self.held > MAX_HELD && judgement == Judgement::Wait;
        if full {
            judgement = Judgement::Foreign;
        }
        if judgement == Judgement::Wait {
            return Outcome {
                verdict: reported,
                flaws: if reported == outcome.verdict { outcome.flaws } else { 0 },
            };
        }
        // The frame at hand is reported by the caller, all others are settled.
        probation.held.pop();
        self.held -= 1;
        let note = probation.note_of_refusal() | (u16::from(full) * flaw::LIMIT);
        self.settle(at, judgement);
        if judgement == Judgement::Believe {
            outcome
        } else {
            Outcome::flawed(Verdict::Foreign, note)
        }
    }

    /// Ends a probation: hands on what was held back, or forgets it.
    fn settle(&mut self, at: usize, judgement: Judgement) {
        let believed = judgement == Judgement::Believe;
        let speaker = self.speaker(at);
        let (standing, session) = &mut self.sessions[at];
        let Standing::Probation(probation) = std::mem::replace(standing, Standing::Foreign) else {
            return;
        };
        if believed {
            self.speakers[speaker] = true;
            *standing = Standing::Trusted;
        } else {
            if session.is_known() {
                // It may still turn up where another protocol used its identifier before.
                *standing = Standing::Probation(Box::new(Probation::strict(&probation)));
            }
            *session = Session::new(session.id, session.bus, session.known.clone());
        }
        self.held -= probation.held.len();
        for held in &probation.held {
            let outcome = if believed { held.outcome } else { Outcome::FOREIGN };
            self.correct(held.frame, held.reported, outcome);
        }
        if believed {
            self.results.transfers.append(probation.transfers);
        }
    }

    fn correct(&mut self, frame: u64, reported: Verdict, outcome: Outcome) {
        if reported == outcome.verdict {
            return;
        }
        self.counts[reported as usize] -= 1;
        self.counts[outcome.verdict as usize] += 1;
        self.report(frame, outcome);
    }

    /// The last word on a frame: in its row, or if that is gone, among the settled.
    fn report(&mut self, frame: u64, outcome: Outcome) {
        let results = &mut self.results;
        if let Some(row) = frame.checked_sub(results.first_frame) {
            results.verdict[row as usize] = outcome.verdict as u8;
            results.anomaly[row as usize] |= outcome.flaws;
        } else {
            results.settled.frame.push(frame);
            results.settled.verdict.push(outcome.verdict as u8);
            results.settled.anomaly.push(outcome.flaws);
        }
    }

    /// Place of the session's source node in `speakers`; of an anonymous one that of nobody.
    fn speaker(&self, at: usize) -> usize {
        let session = &self.sessions[at].1;
        let node = match session.id.kind {
            Kind::Anonymous => 0,
            _ if session.id.src == 0 => session.id.dst,
            _ => session.id.src,
        };
        usize::from(session.bus) * 128 + usize::from(node)
    }
}

const REMOTE_FRAME: Outcome = Outcome::flawed(Verdict::NoTail, flaw::REMOTE);
