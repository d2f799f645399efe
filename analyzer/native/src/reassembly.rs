//! Frames to transfers: every frame ends in exactly one transfer or with a verdict that says why not.
//!
//! Links point backwards only (a transfer names its frames), so a batch can be handed on at any frame. Whether a session
//! is DroneCAN at all is learnt late (see [`crate::trust`]): earlier frames of it are listed in [`Settled`].
#![forbid(unsafe_code)]

mod columns;
mod early;
mod nameless;
mod run;
mod settling;

use crate::frames::{room_like, NO_TIME};
use crate::session::{Candidates, Known, Resolved, Session};
use crate::sessions::Index;
use crate::slot::Frame;
use crate::transfers::{Staged, Transfers};
use crate::trust::Probation;
use crate::verdict::{frame_anomaly, Outcome, Verdict, VERDICTS};
use crate::wire::{crc_start, session_bits, Id};
use early::Early;

/// Open transfers are looked over for the timeout this often, in capture time.
const SWEEP_NS: i64 = 500_000_000;
/// Frames that all sessions on probation may hold back together.
pub const MAX_HELD: usize = 1 << 18;

/// In place of the node of an anonymous sender: the first number that no node has.
const NOBODY: u8 = 128;
const SPEAKERS: usize = NOBODY as usize + 1;

/// Asks for the signatures of (is a service, data type ID), the preferred one first; none when the type is unknown.
pub type Resolve = Box<dyn FnMut(bool, u16) -> Vec<u64> + Send + Sync>;

/// Asks whether somebody wants the transfers of a session; others are only counted.
pub type Asked = Box<dyn FnMut(Id) -> bool + Send + Sync>;

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
    Trusted(Box<Session>),
    Foreign,
    /// On probation, as long as few frames have come, or few since it was foreign.
    Early(Early),
    Probation(Box<Trial>),
}

impl Standing {
    /// The lowest number of the frames whose verdicts may still change.
    fn oldest_held(&self) -> Option<u64> {
        match self {
            Standing::Trusted(_) | Standing::Foreign => None,
            Standing::Early(early) => early.oldest(),
            Standing::Probation(trial) => trial.probation.held.iter().map(|held| held.frame).min(),
        }
    }
}

/// A session on probation.
struct Trial {
    probation: Probation,
    session: Session,
}

/// A session that was opened.
struct Place {
    bus: u8,
    /// What [`session_bits`] or [`crate::wire::nameless_bits`] say of it.
    bits: u32,
    standing: Standing,
}

impl Place {
    fn id(&self) -> Id {
        Id::of_session(self.bits)
    }
}

pub struct Reassembler {
    resolve: Resolve,
    /// None when all are asked.
    asked: Option<Asked>,
    /// Known types in the order in which they occurred.
    types: Vec<TypeName>,
    resolved: Resolved,
    index: Index,
    sessions: Vec<Place>,
    /// Which (bus, node) have sent DroneCAN.
    speakers: Vec<bool>,
    results: Results,
    /// The transfers of `results`, under way.
    staged: Staged,
    next_frame: u64,
    counts: [u64; VERDICTS],
    /// Frames held back by sessions on probation.
    held: usize,
    /// The room of a trial that is over: each frame of a session on probation may need one.
    spare: Option<Box<Trial>>,
    /// The session that held the oldest of them when somebody asked, and that frame.
    oldest: Option<(usize, u64)>,
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
            asked: None,
            types: vec![],
            resolved: Resolved::default(),
            index: Index::default(),
            sessions: vec![],
            speakers: vec![false; 256 * SPEAKERS],
            results: Results::default(),
            staged: Staged::default(),
            next_frame: 0,
            counts: [0; VERDICTS],
            held: 0,
            spare: None,
            oldest: None,
            now: NO_TIME,
            bus_time: [NO_TIME; 256],
            next_sweep: NO_TIME,
            since_sweep: 0,
        }
    }

    /// Only counts the transfers of sessions of which `asked` says so, but for those that prove one, so that
    /// whatever occurs has a row; to be called before the first frame.
    pub fn ask_only(&mut self, asked: Asked) {
        self.asked = Some(asked);
    }

    /// Transfers that were only counted so far.
    pub fn unasked(&self) -> u64 {
        self.staged.unasked()
    }

    /// Frames by verdict so far; their sum is the number of frames.
    pub fn counts(&self) -> [u64; VERDICTS] {
        self.counts
    }

    /// Frames before this number have their last verdicts. Noise opens sessions by the ten thousands, and what one of
    /// them holds is the oldest for long: no frame before it is ever held again.
    pub fn settled_before(&mut self) -> u64 {
        if self.held == 0 {
            return self.next_frame;
        }
        let held_by = |at: usize| self.sessions[at].standing.oldest_held();
        if self.oldest.is_none_or(|(at, frame)| held_by(at) != Some(frame)) {
            let held = (0..self.sessions.len()).filter_map(|at| Some((held_by(at)?, at)));
            self.oldest = held.min().map(|(frame, at)| (at, frame));
        }
        self.oldest.map_or(self.next_frame, |(_, frame)| frame)
    }

    pub fn types(&self) -> &[TypeName] {
        &self.types
    }

    /// The time of the last frame, or [`NO_TIME`].
    pub fn now(&self) -> i64 {
        self.now
    }

    /// Hands over what was found and starts the next batch.
    pub fn take(&mut self) -> Results {
        let rows = room_like(self.results.verdict.len());
        let next = Results {
            first_frame: self.next_frame,
            verdict: Vec::with_capacity(rows),
            anomaly: Vec::with_capacity(rows),
            ..Results::default()
        };
        self.results.transfers = self.staged.take();
        std::mem::replace(&mut self.results, next)
    }

    #[inline]
    fn extended(&mut self, bus: u8, frame: &Frame<'_>, remote: bool) -> Outcome {
        if frame.id as u8 == 0 {
            let bits = self.bits_without_source(bus, frame);
            return self.follow(bus, bits, frame, remote);
        }
        self.follow(bus, session_bits(frame.id), frame, remote)
    }

    #[inline]
    fn follow(&mut self, bus: u8, bits: u32, frame: &Frame<'_>, remote: bool) -> Outcome {
        let found = self.index.find(key(bus, bits));
        let Some(at) = found.or_else(|| self.open_session(bus, bits)) else {
            return Outcome::with(Verdict::Foreign, frame_anomaly::LIMIT);
        };
        match &mut self.sessions[at].standing {
            Standing::Trusted(session) if !remote => session.accept(frame, &mut self.staged),
            Standing::Trusted(_) => REMOTE_FRAME,
            Standing::Foreign => Outcome::FOREIGN,
            Standing::Early(_) | Standing::Probation(_) => self.probe(at, frame, remote),
        }
    }

    #[cold]
    fn open_session(&mut self, bus: u8, bits: u32) -> Option<usize> {
        let at = self.index.insert(key(bus, bits))?;
        let standing = Standing::Early(Early::new(None));
        self.sessions.push(Place { bus, bits, standing });
        Some(at)
    }

    fn known(&mut self, id: Id) -> Candidates {
        let (service, type_id) = (id.kind.is_service(), id.type_id);
        if let Some(known) = self.resolved.get(service, type_id) {
            return known;
        }
        let types = &mut self.types;
        let add = |(variant, signature)| {
            types.push((service, type_id, variant));
            Known {
                index: (types.len() - 1) as u16,
                crc_start: crc_start(signature),
            }
        };
        let known = (0..=u8::MAX).zip((self.resolve)(service, type_id)).map(add).collect();
        self.resolved.insert(service, type_id, known)
    }
}

/// A session in [`Index`].
fn key(bus: u8, bits: u32) -> u32 {
    u32::from(bus) << 24 | bits
}

const REMOTE_FRAME: Outcome = Outcome::with(Verdict::NoTail, frame_anomaly::REMOTE);
