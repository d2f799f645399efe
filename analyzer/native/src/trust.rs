//! Whose traffic is it? A session is on probation until its frames prove that it is DroneCAN.
//!
//! What is decoded meanwhile is held back, so that another protocol on the same bus (J1939, VESC,
//! Cyphal) never turns into messages. The proof depends on the order of the frames alone, not on
//! how the capture was cut into chunks.
//!
//! A legal transfer is the usual proof. A known type none of whose transfers is legal may still be
//! DroneCAN from a sender with a systematic fault, which is what the analyzer must not miss: then
//! the [`Cadence`] of the tail bytes is the proof. It is sharper for a source that has sent other
//! DroneCAN, and the only way in for one whose toggles begin with 1.
#![forbid(unsafe_code)]

use crate::cadence::Cadence;
use crate::session::Session;
use crate::slot::Frame;
use crate::transfers::{KeptRows, Row, Status};
use crate::verdict::{frame_anomaly, Outcome, Verdict};
use crate::wire::{crc_start_from, Kind};

// None of these numbers follows from the protocol. They were chosen for the traffic that the tests of `tests/reassembly`
// make: faulty senders, which must be believed, and J1939, VESC, Cyphal, noise and counters, which must not. A remark
// names the nearest values that were tried instead and at which such a test fails; where that is the test of the number
// itself ("pinned"), other values of about its size would serve as well.

/// Frames after which a session of an unknown type without a proof is foreign. Too small, and a sender that was damaged
/// at first is lost for the whole capture, for an unknown type has no second chance; too large, and each identifier of
/// another protocol holds as many frames back. Pinned.
const PATIENCE_UNKNOWN: usize = 64;
/// The same of a known type none of whose frames formed a legal transfer. Too small, and a faulty sender is not heard
/// out (it has a second chance, with a real proof); too large, and what another protocol sends with that identifier
/// looks like proof by chance. 4 to 32 make no difference to the tests, with 64 a counter of bytes is believed.
const PATIENCE_KNOWN: usize = 16;
/// The same of a session whose every frame was legal, as in a long transfer of an unknown type, and of a known type
/// whose transfer IDs count up. Too small, and long transfers are cut off from their proof (128 is, 256 is not); too
/// large, and frames are held back for longer than a listing should wait (4096 breaks that bound). Pinned.
const PATIENCE_LEGAL: usize = 512;
/// Transfer IDs that rise by one over this many transfers are a proof. With 2 any two frames with neighbouring last
/// bytes are one; the more there are, the later the first transfers of an unknown type are shown. Pinned.
const RUN: usize = 3;
/// At the end of a capture so few frames of a known type are given the benefit of the doubt. With 2 short captures of a
/// faulty sender show nothing; with 4 single frames of requests that nobody proves are believed.
const FEW: usize = 3;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Judgement {
    Wait,
    Believe,
    Foreign,
}

/// One frame held back: its number, what became of it, and what was reported so far.
#[derive(Clone, Copy, Debug)]
pub struct Held {
    pub frame: u64,
    pub outcome: Outcome,
    pub reported: Verdict,
}

/// A frame that another session gets if this one is foreign.
#[derive(Clone, Debug)]
pub struct Kept {
    number: u64,
    t: i64,
    id: u32,
    fd: bool,
    pub remote: bool,
    data: Vec<u8>,
}

impl Kept {
    pub fn of(frame: &Frame<'_>, remote: bool) -> Self {
        Kept {
            number: frame.number,
            t: frame.t,
            id: frame.id,
            fd: frame.fd,
            remote,
            data: frame.data.to_vec(),
        }
    }

    pub fn frame(&self) -> Frame<'_> {
        Frame {
            number: self.number,
            t: self.t,
            id: self.id,
            fd: self.fd,
            data: &self.data,
        }
    }
}

/// What is known of a session of a known type that once was foreign: it has to bring a real proof.
#[derive(Clone, Copy, Debug)]
pub struct Doubt {
    carried: u8,
}

/// The evidence about one session.
#[derive(Debug, Default)]
pub struct Probation {
    pub held: Vec<Held>,
    /// All that came, if it may be anonymous after all.
    pub kept: Vec<Kept>,
    pub transfers: KeptRows,
    cadence: Cadence,
    /// A known type that once was foreign has to bring a real proof.
    strict: bool,
    illegal: usize,
    starts: usize,
    toggled_starts: usize,
    /// The last frame was a proper part of a transfer that goes on.
    under_way: bool,
    /// Transfers that a judgement has seen; without a new one there is no new proof.
    seen: usize,
}

impl Probation {
    /// What to know for another chance.
    pub fn doubt(&self) -> Doubt {
        Doubt {
            carried: self.cadence.carried(),
        }
    }

    /// As a new one, with the room of this one.
    pub fn renew(&mut self, doubt: Option<Doubt>) {
        self.held.clear();
        self.kept.clear();
        self.transfers.clear();
        *self = Probation {
            held: std::mem::take(&mut self.held),
            kept: std::mem::take(&mut self.kept),
            transfers: std::mem::take(&mut self.transfers),
            cadence: Cadence::anew(doubt.map_or(0, |doubt| doubt.carried)),
            strict: doubt.is_some(),
            ..Probation::default()
        };
    }

    /// Takes note of one frame; returns the verdict to report for now. A known type is taken at its
    /// word until it fails, an unknown one is foreign until it proves itself.
    pub fn note(&mut self, frame: u64, outcome: Outcome, tail: Option<u8>, known: bool) -> Verdict {
        let start = tail.is_some_and(|tail| tail & 0x80 != 0);
        let toggle = tail.is_some_and(|tail| tail & 0x20 != 0);
        self.starts += usize::from(start);
        self.toggled_starts += usize::from(start && toggle);
        if let Some(tail) = tail.filter(|_| outcome.verdict != Verdict::Duplicate) {
            self.cadence.note(tail);
        }
        let legal = (outcome == Outcome::USED && !(start && toggle)) || outcome.verdict == Verdict::Duplicate;
        self.illegal += usize::from(!legal);
        self.under_way = legal && tail.is_some_and(|tail| tail & 0x40 == 0);
        let reported = if known && !self.strict {
            outcome.verdict
        } else {
            Verdict::Foreign
        };
        self.held.push(Held {
            frame,
            outcome,
            reported,
        });
        reported
    }

    pub fn judge(&mut self, session: &Session, source_is_known: bool) -> Judgement {
        if self.transfers.len() > self.seen && self.proven(session, source_is_known) {
            return Judgement::Believe;
        }
        self.wait();
        let counts = session.is_known() && session.id.kind != Kind::Anonymous;
        if counts && self.cadence.proves(source_is_known) {
            return Judgement::Believe;
        }
        let patience = if self.illegal == 0 || self.under_way || (counts && self.cadence.promising()) {
            PATIENCE_LEGAL
        } else if session.is_known() && self.complete().next().is_none() && !self.strict {
            PATIENCE_KNOWN
        } else {
            PATIENCE_UNKNOWN
        };
        if self.held.len() >= patience {
            Judgement::Foreign
        } else {
            Judgement::Wait
        }
    }

    /// Whatever came so far is no proof.
    pub fn wait(&mut self) {
        self.seen = self.transfers.len();
    }

    /// The capture ends without a proof.
    pub fn last_word(&self, session: &Session, source_is_known: bool) -> Judgement {
        let bare = self.held.iter().all(|held| held.outcome.verdict == Verdict::NoTail);
        let doubtful = self.held.len() <= FEW && (source_is_known || self.starts > 0 || bare);
        let plausible =
            !self.is_counter(session) && (self.illegal == 0 || doubtful || self.complete().count() > self.illegal);
        let faulty = source_is_known && session.id.kind != Kind::Anonymous && self.cadence.suits();
        let doubted = session.id.is_nameless() && !source_is_known;
        if session.is_known() && !doubted && !self.strict && ((plausible && !self.cyphal()) || faulty) {
            Judgement::Believe
        } else {
            Judgement::Foreign
        }
    }

    /// Every transfer started with toggle 1, as Cyphal/CAN does.
    pub fn cyphal(&self) -> bool {
        self.starts > 0 && self.starts == self.toggled_starts
    }

    /// The anomaly to report with the frame at which the session was found foreign.
    pub fn note_of_refusal(&self) -> u16 {
        if self.cyphal() && !self.strict {
            frame_anomaly::CYPHAL
        } else {
            0
        }
    }

    fn proven(&self, session: &Session, source_is_known: bool) -> bool {
        let checked = |row: Row<'_>| row.status == Status::Ok && row.crc_wire.is_some() && row.crc_here.is_some();
        if self.complete().any(checked) {
            return true;
        }
        let counter = self.is_counter(session);
        if (self.rising_run() && !counter) || self.one_start_value() {
            return true;
        }
        // Any 29-bit identifier that ends in 00 may read as a known type without a source.
        if counter || !session.is_known() || session.id.is_nameless() || self.strict || self.illegal > 0 {
            return false;
        }
        let needed = match session.id.kind {
            _ if !session.legal_id() && !source_is_known => 4,
            Kind::Message => 1,
            Kind::Request | Kind::Response if source_is_known => 1,
            Kind::Request | Kind::Response => 2,
            // Any 29-bit identifier that ends in 00 looks like one of these.
            Kind::Anonymous => 4,
        };
        self.complete().count() >= needed
    }

    /// A transfer ID that overflows its 5 bits is a fault; the counters of other protocols do the same, and more.
    fn is_counter(&self, session: &Session) -> bool {
        if session.is_known() {
            self.cadence.carries_into_marks()
        } else {
            self.cadence.is_wide_counter()
        }
    }

    fn complete(&self) -> impl Iterator<Item = Row<'_>> {
        let whole = |row: &Row<'_>| matches!(row.status, Status::Ok | Status::Unchecked | Status::BadCrc);
        let toggled = |row: &Row<'_>| row.anomaly & crate::transfers::anomaly::SINGLE_TOGGLE != 0;
        self.transfers.rows().filter(move |row| whole(row) && !toggled(row))
    }

    fn rising_run(&self) -> bool {
        let mut run = 0;
        let mut next = None;
        for row in self.complete() {
            run = if next == Some(row.transfer_id) { run + 1 } else { 1 };
            next = Some((row.transfer_id + 1) & 31);
            if run >= RUN && row.id.kind != Kind::Anonymous {
                return true;
            }
        }
        false
    }

    /// Two multi-frame transfers of an unknown type whose CRCs run back to one start value.
    fn one_start_value(&self) -> bool {
        let multi = self.complete().filter(|row| row.crc_here.is_none());
        let mut starts = multi.filter_map(|row| Some(crc_start_from(row.crc_wire?, row.payload)));
        let Some(mut last) = starts.next() else {
            return false;
        };
        starts.any(|start| std::mem::replace(&mut last, start) == start)
    }
}
