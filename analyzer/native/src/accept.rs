//! What one frame does to its session: it goes on with a transfer, begins one, or breaks one.
//!
//! A start of transfer restarts only the slot of its own transfer ID. After a broken sequence the
//! slot is poisoned: it still collects its frames, as evidence, but never gets a CRC verdict. So one
//! lost frame is one broken transfer, whichever frame was lost.
#![forbid(unsafe_code)]

use crate::session::{come_around, Session};
use crate::slot::{elapsed, Frame, Overtaken, Slot, State, TIMEOUT_NS};
use crate::transfers::{anomaly, when, Sink, Status};
use crate::verdict::{frame_anomaly, Outcome, Verdict};
use crate::wire::{Kind, Tail};

impl Session {
    /// Takes one data frame; transfers that it completes or breaks are appended to `out`.
    #[inline]
    pub fn accept(&mut self, frame: &Frame<'_>, out: &mut impl Sink) -> Outcome {
        let Some((tail, body)) = frame.split() else {
            return Outcome::with(Verdict::NoTail, frame_anomaly::NO_TAIL);
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
    fn odd(&mut self, frame: &Frame<'_>, tail: Tail, body: &[u8], out: &mut impl Sink) -> Outcome {
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
    fn restart(&mut self, frame: &Frame<'_>, tail: Tail, body: &[u8], out: &mut impl Sink) -> Outcome {
        if self.select(tail.transfer_id()) {
            let lone = self.hot.state != State::Poisoned && self.hot.frames().len() == 1;
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
            return Outcome::with(Verdict::WrongToggle, frame_anomaly::START_TOGGLE);
        }
        Outcome::USED
    }

    /// A later frame that is not the plain case.
    fn resume(&mut self, frame: &Frame<'_>, tail: Tail, body: &[u8], out: &mut impl Sink) -> Outcome {
        if !self.select(tail.transfer_id()) {
            if self.hot.transfer_id == tail.transfer_id() && self.hot.repeats(tail, body) {
                return Outcome::of(Verdict::Duplicate);
            }
            if !self.hot.active() {
                // Only the very next frame can be a copy of the last one.
                self.hot.forget_frames();
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
                outcome.anomaly = frame_anomaly::TOGGLE;
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

    pub(crate) fn begin(&mut self, frame: &Frame<'_>, tail: Tail, body: &[u8]) {
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
