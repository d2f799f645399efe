//! How transfers end: what is measured when one is complete, broken, or too old.
#![forbid(unsafe_code)]

use crate::session::{come_around, Known, Session};
use crate::slot::{elapsed, Frame, Overtaken, Slot, State, ABORT_NS, TIMEOUT_NS};
use crate::transfers::{anomaly, when, Row, Sink, Status, NO_GAP, NO_STEP, UNKNOWN};
use crate::wire::{crc, priority, Kind, Tail};

impl Session {
    pub(crate) fn single(&mut self, frame: &Frame<'_>, tail: Tail, body: &[u8], out: &mut impl Sink) {
        let (step, gap) = match self.id.kind {
            Kind::Anonymous => (NO_STEP, NO_GAP),
            _ => self.measure(tail.transfer_id(), frame.t),
        };
        let repeats = step == 0 && self.holds_last && self.hot.payload() == body;
        let bits = when(tail.toggle(), anomaly::SINGLE_TOGGLE) | when(frame.fd, anomaly::CAN_FD);
        out.push(&Row {
            id: self.id,
            bus: self.bus,
            t: frame.t,
            t_end: frame.t,
            priority: priority(frame.id),
            transfer_id: tail.transfer_id(),
            status: if self.known.is_empty() {
                Status::Unchecked
            } else {
                Status::Ok
            },
            crc_wire: None,
            crc_here: None,
            step,
            gap,
            anomaly: bits | self.constant | id_anomaly(step, gap, tail.transfer_id(), repeats, self.period),
            fd: frame.fd,
            known: self.preferred(),
            asked: self.asked,
            frames: &[frame.number],
            payload: body,
        });
        if !self.hot.active() {
            self.hot.start(frame, tail, body);
            self.hot.state = State::Closed;
            self.hot.expect = Slot::NOTHING;
            self.holds_last = true;
        }
    }

    /// The type that a payload has which no CRC speaks for.
    fn preferred(&self) -> u16 {
        self.known.first().map_or(UNKNOWN, |known| known.index)
    }

    /// The hot slot has all its frames: the CRC decides.
    pub(crate) fn complete(&mut self, out: &mut impl Sink) {
        let [low, high, payload @ ..] = self.hot.bytes() else {
            self.close_hot(Status::TooShort, 0, out);
            return;
        };
        let wire = u16::from_le_bytes([*low, *high]);
        let checked = |known: &Known| (known.index, crc(known.crc_start, payload));
        let preferred = self.known.first().map(checked);
        let other = |&(_, here): &(u16, u16)| here == wire;
        let found = match preferred {
            Some((_, here)) if here != wire => self.known.iter().skip(1).map(checked).find(other),
            _ => None,
        };
        let status = match found.or(preferred) {
            Some((_, here)) if here == wire => Status::Ok,
            Some(_) => Status::BadCrc,
            None => Status::Unchecked,
        };
        let longest_single = if self.hot.fd { 63 } else { 7 };
        let bits = when(status == Status::BadCrc, anomaly::CRC)
            | when(payload.len() <= longest_single, anomaly::NEEDLESS_MULTI)
            | when(found.is_some(), anomaly::OTHER_TYPE);
        self.close_with(status, bits, Some(wire), found.or(preferred), out);
    }

    pub(crate) fn close_hot(&mut self, status: Status, bits: u32, out: &mut impl Sink) {
        let wire = match self.hot.bytes() {
            [low, high, ..] => Some(u16::from_le_bytes([*low, *high])),
            _ => None,
        };
        self.close_with(status, bits, wire, None, out);
    }

    /// Turns the hot slot into one row.
    fn close_with(
        &mut self,
        status: Status,
        bits: u32,
        wire: Option<u16>,
        here: Option<(u16, u16)>,
        out: &mut impl Sink,
    ) {
        let refused = self.hot.state == State::Refused;
        self.hot.state = State::Closed;
        self.hot.expect = Slot::NOTHING;
        let slot = &self.hot;
        if refused {
            return;
        }
        let payload = slot.payload();
        let whole = matches!(status, Status::Ok | Status::Unchecked | Status::BadCrc);
        let repeats = whole && slot.step == 0 && self.repeated.take().is_some_and(|last| last == payload);
        let ids = if whole {
            id_anomaly(slot.step, slot.gap, slot.transfer_id, repeats, self.period)
        } else {
            0
        };
        let last_empty = whole && slot.last_was_empty();
        out.push(&Row {
            id: self.id,
            bus: self.bus,
            t: slot.t,
            t_end: slot.t_last,
            priority: slot.priority,
            transfer_id: slot.transfer_id,
            status,
            crc_wire: wire,
            crc_here: here.map(|(_, crc)| crc),
            step: slot.step,
            gap: slot.gap,
            anomaly: slot.anomaly
                | bits
                | ids
                | self.constant
                | when(last_empty, anomaly::LAST_EMPTY)
                | when(payload.len() > 1023, anomaly::LONG)
                | when(elapsed(slot.t, slot.t_last) > ABORT_NS, anomaly::SLOW),
            fd: slot.fd,
            known: here.map_or_else(|| self.preferred(), |(known, _)| known),
            asked: self.asked,
            frames: slot.frames(),
            payload,
        });
        self.holds_last = whole;
    }

    /// Closes what is older than the timeout at the capture time `now`.
    pub fn expire(&mut self, now: i64, out: &mut impl Sink) {
        self.close_where(|slot| slot.expired(now), Status::TimedOut, anomaly::TIMEOUT, out);
    }

    /// The capture ends at `now`: closes everything.
    pub fn finish(&mut self, now: i64, out: &mut impl Sink) {
        self.expire(now, out);
        self.close_where(|_| true, Status::Open, anomaly::CUT_BY_END, out);
    }

    /// Closes the active slots that `which` names, oldest first, with `status` and `bits`; but a
    /// poisoned slot, and one that later starts have left behind, is `interrupted`.
    fn close_where(&mut self, which: impl Fn(&Slot) -> bool, status: Status, bits: u32, out: &mut impl Sink) {
        loop {
            let slots = std::iter::once(&self.hot).chain(&self.others);
            let due = slots.filter(|slot| slot.active() && which(slot));
            let Some(oldest) = due.min_by_key(|slot| slot.frames().first().copied()) else {
                return;
            };
            let broken = oldest.state == State::Poisoned || oldest.overtaken == Overtaken::ByStart;
            let transfer_id = oldest.transfer_id;
            self.select(transfer_id);
            if broken {
                self.close_hot(Status::Interrupted, anomaly::ABANDONED, out);
            } else {
                self.close_hot(status, bits, out);
            }
        }
    }
}

/// What the transfer ID says against the previous start of the session (clause 4.1.3). After the
/// timeout any ID may follow. The same ID after a time for many transfers has come around again:
/// 31 are missing.
fn id_anomaly(step: u8, gap: i64, transfer_id: u8, repeats: bool, period: i64) -> u32 {
    if step == 1 || step == NO_STEP || (gap != NO_GAP && gap > TIMEOUT_NS) {
        0
    } else if step == 0 && gap != NO_GAP && come_around(gap, period) {
        anomaly::ID_GAP
    } else if step == 0 {
        if repeats {
            anomaly::DUPLICATE
        } else {
            anomaly::ID_REPEATED
        }
    } else if transfer_id == 0 {
        anomaly::ID_RESTARTED
    } else {
        anomaly::ID_GAP
    }
}
