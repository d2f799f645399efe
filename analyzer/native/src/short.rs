//! The short way: the next frame of a transfer, or the first one, where nothing is to be remarked on. Nearly every frame
//! of a sound capture goes it. The long way ([`crate::accept`]) would do the same; every other frame is left to it,
//! untouched.
#![forbid(unsafe_code)]

use crate::session::Session;
use crate::slot::{Frame, Rest, Slot, State, Word, ABORT_NS, PAUSE_NS, TIMEOUT_NS};
use crate::transfers::{Row, Staged, Status, SHORT_FRAMES};
use crate::wire::{crc, Kind};

/// The longest payload that would have had room in one frame.
const NEEDLESS: usize = 7;
// So few frames without a pause are never slow.
const _: () = assert!(SHORT_FRAMES as i64 * PAUSE_NS <= ABORT_NS);

impl Session {
    /// Takes a classic data frame; false, and nothing done, when it is one for the long way.
    #[inline]
    pub fn accept_short(&mut self, frame: &Word, out: &mut Staged) -> bool {
        let tail = frame.tail;
        if tail.0 & 0xBF == self.hot.expect {
            if !self.hot.append_word(frame) {
                return false;
            }
            if tail.end() && !self.complete_short(out) {
                self.complete(out);
            }
            return true;
        }
        let start = tail.0 & 0xA0 == 0x80 && !self.hot.active() && self.others.is_empty();
        if !start || self.id.kind == Kind::Anonymous {
            return false;
        }
        if self.begin_short(frame) {
            return true;
        }
        let (number, t, id) = (frame.number, frame.t, frame.id);
        let (fd, data, body) = (false, &frame.bytes[..], &frame.bytes[..frame.size % 8]);
        let frame = Frame {
            number,
            t,
            id,
            fd,
            data,
        };
        if tail.end() {
            self.single(&frame, tail, body, out);
        } else {
            self.begin(&frame, tail, body);
        }
        true
    }

    /// Takes a classic data frame that begins a transfer, and the others of that; returns how many were taken, which is
    /// all of them or fewer than two.
    #[inline]
    pub fn accept_whole(&mut self, first: &Word, rest: &Rest<'_>, out: &mut Staged) -> usize {
        let closed = !self.hot.active() && self.others.is_empty() && self.id.kind != Kind::Anonymous;
        if !closed || !self.begin_short(first) {
            return 0;
        }
        if !self.hot.append_rest(first.number, rest) {
            return 1;
        }
        if !self.complete_short(out) {
            self.complete(out);
        }
        1 + rest.words.len()
    }

    /// [`Session::begin`] for the transfer ID that follows the one before; false for others.
    #[inline]
    fn begin_short(&mut self, frame: &Word) -> bool {
        let Some((id, at)) = self.previous else {
            return false;
        };
        let (next, gap) = (frame.tail.transfer_id(), frame.t.wrapping_sub(at));
        let follows = next == (id + 1) % 32 && gap as u64 <= TIMEOUT_NS as u64;
        if frame.tail.end() || !follows || !self.hot.start_word(frame) {
            return false;
        }
        (self.hot.step, self.hot.gap, self.hot.before) = (1, gap, self.previous);
        self.previous = Some((next, frame.t));
        self.period = gap;
        self.holds_last = false;
        true
    }

    /// [`Session::complete`] for a transfer that follows the one before and is as it should be; false for others.
    #[inline]
    fn complete_short(&mut self, out: &mut Staged) -> bool {
        let slot = &self.hot;
        let (Some(known), Some((padded, numbers))) = (self.known.first(), slot.short()) else {
            return false;
        };
        let [low, high, payload @ ..] = slot.bytes() else {
            return false;
        };
        let wire = u16::from_le_bytes([*low, *high]);
        let usual = slot.step == 1
            && slot.anomaly | self.constant == 0
            && payload.len() > NEEDLESS
            && !slot.last_was_empty()
            && !slot.fd;
        if !usual || crc(known.crc_start, payload) != wire {
            return false;
        }
        let row = Row {
            id: self.id,
            bus: self.bus,
            t: slot.t,
            t_end: slot.t_last,
            priority: slot.priority,
            transfer_id: slot.transfer_id,
            status: Status::Ok,
            crc_wire: Some(wire),
            crc_here: Some(wire),
            step: slot.step,
            gap: slot.gap,
            anomaly: 0,
            fd: false,
            known: known.index,
            asked: self.asked,
            frames: slot.frames(),
            payload,
        };
        out.push_short(&row, numbers, padded);
        self.hot.state = State::Closed;
        self.hot.expect = Slot::NOTHING;
        self.holds_last = true;
        true
    }
}
