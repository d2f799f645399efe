//! One session: the transfers of one (bus, kind, type, source, destination), one slot a transfer ID.
//!
//! A start of transfer restarts only the slot of its own transfer ID. After a broken sequence the
//! slot is poisoned: it still collects its frames, as evidence, but never gets a CRC verdict. So one
//! lost frame is one broken transfer, whichever frame was lost.
#![forbid(unsafe_code)]

use std::sync::Arc;

use crate::ending::come_around;
use crate::slot::{elapsed, Frame, Overtaken, Slot, State, TIMEOUT_NS};
use crate::transfers::{anomaly, when, Status, Transfers, NO_GAP, NO_STEP};
use crate::verdict::{flaw, Outcome, Verdict};
use crate::wire::{Id, Kind, Tail};

/// What the core knows of a data type.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Known {
    /// Position among the known types.
    pub index: u16,
    /// CRC start value, which is the CRC of the signature.
    pub crc_start: u16,
}

/// The types that share a data type ID, the preferred one first; only a CRC can tell them apart.
pub type Candidates = Arc<[Known]>;

#[derive(Debug)]
pub struct Session {
    pub id: Id,
    pub bus: u8,
    pub known: Candidates,
    pub(crate) hot: Slot,
    /// Slots of other transfer IDs that are under way at the same time: nearly always none.
    pub(crate) others: Vec<Slot>,
    /// Transfer ID and time of the latest start.
    pub(crate) previous: Option<(u8, i64)>,
    /// Whether `hot` still holds the payload of the latest complete transfer.
    pub(crate) holds_last: bool,
    /// That payload, when a transfer with the same transfer ID is under way.
    pub(crate) repeated: Option<Vec<u8>>,
    /// The time between the latest two starts with consecutive IDs, 0 before there were any.
    pub(crate) period: i64,
    /// Bits that every transfer of this session carries.
    pub(crate) constant: u32,
}

impl Session {
    pub fn new(id: Id, bus: u8, known: Candidates) -> Self {
        let service = id.kind.is_service();
        Session {
            id,
            bus,
            known,
            hot: Slot::default(),
            others: vec![],
            previous: None,
            holds_last: false,
            repeated: None,
            period: 0,
            constant: when(service && id.dst == 0, anomaly::DESTINATION_ZERO)
                | when(service && id.src == 0, anomaly::SOURCE_ZERO)
                | when(service && id.src == id.dst, anomaly::ADDRESSED_TO_ITSELF),
        }
    }

    pub fn is_known(&self) -> bool {
        !self.known.is_empty()
    }

    /// False for the service identifiers that no node may send (clause 4.1.2).
    pub fn legal_id(&self) -> bool {
        self.constant == 0
    }

    /// Takes one data frame; transfers that it completes or breaks are appended to `out`.
    #[inline]
    pub fn accept(&mut self, frame: &Frame<'_>, out: &mut Transfers) -> Outcome {
        let Some((tail, body)) = frame.split() else {
            return Outcome::flawed(Verdict::NoTail, flaw::NO_TAIL);
        };
        let in_time = frame.t.saturating_sub(self.hot.t) <= TIMEOUT_NS;
        if tail.0 & 0xBF == self.hot.expect && in_time {
            self.hot.append(frame, tail, body);
            if tail.end() {
                self.complete(out);
            } else if self.hot.overfull() {
                self.close_hot(Status::Interrupted, anomaly::LIMIT | anomaly::ABANDONED, out);
            }
            return Outcome::USED;
        }
        let plain_start = tail.0 & 0xA0 == 0x80 && !self.hot.active() && self.others.is_empty();
        if plain_start && self.id.kind != Kind::Anonymous {
            if tail.end() {
                self.single(frame, tail, body, out);
            } else {
                self.begin(frame, tail, body);
            }
            return Outcome::USED;
        }
        self.odd(frame, tail, body, out)
    }

    #[cold]
    fn odd(&mut self, frame: &Frame<'_>, tail: Tail, body: &[u8], out: &mut Transfers) -> Outcome {
        let single = tail.start() && tail.end();
        if self.id.kind == Kind::Anonymous {
            if !single {
                return Outcome::of(Verdict::AnonymousMulti);
            }
            self.single(frame, tail, body, out);
            return Outcome::USED;
        }
        self.expire(frame.t, out);
        let outcome = if tail.start() {
            self.restart(frame, tail, body, out)
        } else {
            self.resume(frame, tail, body, out)
        };
        if outcome.verdict != Verdict::Duplicate {
            self.cross(tail);
        }
        if !self.others.is_empty() {
            // While several are under way every frame has to pass by here.
            self.hot.expect = Slot::NOTHING;
        }
        outcome
    }

    /// A start of transfer that is not the plain case.
    fn restart(&mut self, frame: &Frame<'_>, tail: Tail, body: &[u8], out: &mut Transfers) -> Outcome {
        if self.select(tail.transfer_id()) {
            let lone = self.hot.state != State::Poisoned && self.hot.frames.len() == 1;
            // Only the very next frame can be a copy: later the same bytes are the same values again.
            let next = self.hot.overtaken == Overtaken::No && !self.came_around(frame.t);
            if lone && next && self.hot.repeats(tail, body) {
                self.hot.anomaly |= anomaly::DUPLICATE_FRAME;
                return Outcome::of(Verdict::Duplicate);
            }
            self.forget_start(frame.t);
            self.close_hot(Status::Interrupted, anomaly::ABANDONED, out);
        }
        if tail.end() {
            self.single(frame, tail, body, out);
            return Outcome::USED;
        }
        if self.hot.active() {
            let open = std::mem::take(&mut self.hot);
            self.others.push(open);
            self.holds_last = false;
        }
        self.begin(frame, tail, body);
        if tail.toggle() {
            self.hot.state = State::Refused;
            self.hot.expect = Slot::NOTHING;
            return Outcome::flawed(Verdict::WrongToggle, flaw::START_TOGGLE);
        }
        Outcome::USED
    }

    /// A later frame that is not the plain case.
    fn resume(&mut self, frame: &Frame<'_>, tail: Tail, body: &[u8], out: &mut Transfers) -> Outcome {
        if !self.select(tail.transfer_id()) {
            if self.hot.transfer_id == tail.transfer_id() && self.hot.repeats(tail, body) {
                return Outcome::of(Verdict::Duplicate);
            }
            if !self.hot.active() {
                // Only the very next frame can be a copy of the last one.
                self.hot.frames.clear();
            }
            let astray = self.hot.active() || !self.others.is_empty();
            return Outcome::of(if astray {
                Verdict::WrongTransferId
            } else {
                Verdict::Orphan
            });
        }
        let hot = &mut self.hot;
        if hot.state == State::Refused {
            if tail.end() {
                hot.state = State::Closed;
            }
            return Outcome::of(Verdict::WrongToggle);
        }
        let expected = hot.expects(tail);
        if !expected && hot.repeats(tail, body) {
            hot.anomaly |= anomaly::DUPLICATE_FRAME;
            return Outcome::of(Verdict::Duplicate);
        }
        hot.anomaly |= when(hot.overtaken != Overtaken::No, anomaly::INTERLEAVED);
        hot.overtaken = Overtaken::No;
        let mut outcome = Outcome::USED;
        if expected {
            hot.append(frame, tail, body);
        } else {
            if hot.state == State::Open {
                hot.state = State::Poisoned;
                hot.anomaly |= anomaly::TOGGLE;
                outcome.flaws = flaw::TOGGLE;
            }
            hot.attach(frame, tail, body);
        }
        if tail.end() && hot.state == State::Open {
            self.complete(out);
        } else if tail.end() {
            self.close_hot(Status::Interrupted, anomaly::ABANDONED, out);
        } else if hot.overfull() {
            self.close_hot(Status::Interrupted, anomaly::LIMIT | anomaly::ABANDONED, out);
        }
        outcome
    }

    /// Makes the active slot of `transfer_id` the hot one; false when there is none.
    pub(crate) fn select(&mut self, transfer_id: u8) -> bool {
        if self.hot.active() && self.hot.transfer_id == transfer_id {
            return true;
        }
        let Some(at) = self.others.iter().position(|slot| slot.transfer_id == transfer_id) else {
            return false;
        };
        let slot = self.others.swap_remove(at);
        let was = std::mem::replace(&mut self.hot, slot);
        self.holds_last = false;
        if was.active() {
            self.others.push(was);
        }
        true
    }

    /// Tells every other slot under way that a frame went past it.
    fn cross(&mut self, tail: Tail) {
        let by = if tail.start() {
            Overtaken::ByStart
        } else {
            Overtaken::ByFrame
        };
        let slots = self.others.iter_mut().chain(std::iter::once(&mut self.hot));
        for slot in slots.filter(|slot| slot.active() && slot.transfer_id != tail.transfer_id()) {
            slot.overtake(by);
        }
    }

    /// Distance from the previous start, and what the previous payload was if the ID is the same.
    pub(crate) fn measure(&mut self, transfer_id: u8, t: i64) -> (u8, i64) {
        self.repeated = None;
        let before = self.previous.replace((transfer_id, t));
        let Some((id, at)) = before else {
            return (NO_STEP, NO_GAP);
        };
        let timed = at != crate::frames::NO_TIME && t != crate::frames::NO_TIME;
        let gap = if timed { t.saturating_sub(at) } else { NO_GAP };
        let step = transfer_id.wrapping_sub(id) & 31;
        if step == 1 && gap != NO_GAP {
            self.period = gap;
        }
        (step, gap)
    }

    /// A transfer that is begun again at `t` does not count twice: its first start is no predecessor of the second.
    /// Not so when others have started since.
    fn forget_start(&mut self, t: i64) {
        let latest = self.previous.is_some_and(|(id, _)| id == self.hot.transfer_id);
        if latest && !self.came_around(t) {
            self.previous = self.hot.before;
        }
    }

    /// Whether from the start of the hot slot to `t` there was time for all other transfer IDs.
    fn came_around(&self, t: i64) -> bool {
        come_around(elapsed(self.hot.t, t), self.period)
    }

    fn begin(&mut self, frame: &Frame<'_>, tail: Tail, body: &[u8]) {
        let before = self.previous;
        let (step, gap) = self.measure(tail.transfer_id(), frame.t);
        if step == 0 && self.holds_last {
            self.repeated = Some(self.hot.payload().to_vec());
        }
        self.holds_last = false;
        self.hot.start(frame, tail, body);
        (self.hot.step, self.hot.gap, self.hot.before) = (step, gap, before);
    }
}
