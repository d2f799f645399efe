//! One transfer under way: its frames, its bytes, and which frame must come next.
#![forbid(unsafe_code)]

mod word;

pub use word::{Rest, Word};

use crate::frames::NO_TIME;
use crate::transfers::{anomaly, when, NO_GAP, NO_STEP, SHORT_FRAMES};
use crate::wire::{priority, Tail};

/// A transfer is given up this long after its first frame (the transfer-ID timeout of DroneCAN).
pub const TIMEOUT_NS: i64 = 2_000_000_000;
/// A sender should give up a transfer that takes longer than this.
pub const ABORT_NS: i64 = 1_000_000_000;
/// Longer silence between two frames of one transfer is remarked on.
pub const PAUSE_NS: i64 = 100_000_000;
/// The most payload bytes, and the most frames, that one transfer may hold.
pub const MAX_TRANSFER: usize = 65_536;
/// Room that a slot keeps from one transfer to the next.
const KEPT: usize = 4096;
/// Bytes that are stored at once.
const WORD: usize = 8;
/// Room for what is copied at once from a transfer with a CRC in front.
const PADDED: usize = 64;

/// One CAN frame on its way into a transfer; `data` ends with the tail byte.
#[derive(Clone, Copy, Debug)]
pub struct Frame<'a> {
    pub number: u64,
    pub t: i64,
    pub id: u32,
    pub fd: bool,
    pub data: &'a [u8],
}

impl Frame<'_> {
    /// A length that no CAN controller sends (ISO 11898-1): above 8 classic, off the DLC steps for FD.
    #[inline]
    pub fn impossible_length(&self) -> bool {
        let length = self.data.len();
        length > 8 && !(self.fd && matches!(length, 12 | 16 | 20 | 24 | 32 | 48 | 64))
    }

    /// The tail byte and the payload before it; none when the frame has no data.
    pub fn split(&self) -> Option<(Tail, &[u8])> {
        self.data.split_last().map(|(&tail, body)| (Tail(tail), body))
    }
}

/// Nanoseconds from `a` to `b`; 0 when either has no time.
pub fn elapsed(a: i64, b: i64) -> i64 {
    if a == NO_TIME || b == NO_TIME {
        0
    } else {
        b.saturating_sub(a)
    }
}

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum State {
    #[default]
    Closed,
    Open,
    /// The sequence broke: what follows is evidence, not payload.
    Poisoned,
    /// It began with toggle 1, which no receiver accepts; its frames are only counted.
    Refused,
}

/// What else came on the session since this slot's last frame.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub enum Overtaken {
    #[default]
    No,
    ByFrame,
    ByStart,
}

#[derive(Clone, Debug)]
pub struct Slot {
    pub state: State,
    /// Toggle and transfer ID of the next frame, or [`Slot::NOTHING`] when the short way is closed.
    pub expect: u8,
    /// Toggle and transfer ID of the frame that would continue the sequence.
    next: u8,
    pub transfer_id: u8,
    pub priority: u8,
    last_tail: u8,
    last_length: u8,
    /// Where in `bytes` the last frame's part stands.
    last_at: usize,
    pub fd: bool,
    pub overtaken: Overtaken,
    pub step: u8,
    pub gap: i64,
    pub anomaly: u32,
    pub t: i64,
    pub t_last: i64,
    /// The start before this one, so that a restart can be measured from there.
    pub before: Option<(u8, i64)>,
    /// Numbers of its frames; what stands behind `count` does not count.
    numbers: Vec<u64>,
    count: usize,
    /// What they held; likewise behind `used`, so that a frame can be stored and a transfer copied in whole words.
    bytes: Vec<u8>,
    used: usize,
    /// 2 when the CRC leads the bytes.
    pub skip: usize,
}

impl Default for Slot {
    fn default() -> Self {
        Slot {
            state: State::Closed,
            expect: Self::NOTHING,
            next: 0,
            transfer_id: 0,
            priority: 0,
            last_tail: 0,
            last_length: 0,
            last_at: 0,
            fd: false,
            overtaken: Overtaken::No,
            step: NO_STEP,
            gap: NO_GAP,
            anomaly: 0,
            t: NO_TIME,
            t_last: NO_TIME,
            before: None,
            numbers: vec![],
            count: 0,
            bytes: vec![],
            used: 0,
            skip: 0,
        }
    }
}

impl Slot {
    pub const NOTHING: u8 = 0xFF;

    /// As a new one, with the room of this one.
    pub fn renew(&mut self) {
        *self = Slot {
            numbers: std::mem::take(&mut self.numbers),
            bytes: std::mem::take(&mut self.bytes),
            ..Slot::default()
        };
    }

    pub fn active(&self) -> bool {
        self.state != State::Closed
    }

    /// Everything received so far, the CRC included.
    pub fn bytes(&self) -> &[u8] {
        &self.bytes[..self.used]
    }

    /// Numbers of the frames so far.
    pub fn frames(&self) -> &[u64] {
        &self.numbers[..self.count]
    }

    pub fn forget_frames(&mut self) {
        self.count = 0;
    }

    pub fn payload(&self) -> &[u8] {
        self.bytes().get(self.skip..).unwrap_or(&[])
    }

    pub fn start(&mut self, frame: &Frame<'_>, tail: Tail, body: &[u8]) {
        self.reset(frame.t, frame.id, tail, frame.fd);
        if self.bytes.len().max(self.numbers.len()) > KEPT {
            self.bytes = vec![];
            self.numbers = vec![];
        }
        self.anomaly = when(frame.fd, anomaly::CAN_FD) | when(!tail.end() && body.len() <= 2, anomaly::FIRST_TOO_SHORT);
        self.append(frame, tail, body);
    }

    #[inline]
    fn reset(&mut self, t: i64, id: u32, tail: Tail, fd: bool) {
        self.state = State::Open;
        self.transfer_id = tail.transfer_id();
        self.priority = priority(id);
        self.fd = fd;
        self.overtaken = Overtaken::No;
        self.t = t;
        self.t_last = t;
        self.forget_frames();
        self.used = 0;
        self.skip = if tail.end() { 0 } else { 2 };
        self.next = self.transfer_id;
    }

    /// Takes the frame that was expected.
    pub fn append(&mut self, frame: &Frame<'_>, tail: Tail, body: &[u8]) {
        let full = if frame.fd { 63 } else { 7 };
        self.anomaly |= when(!tail.end() && body.len() < full, anomaly::FRAME_NOT_FULL)
            | when(priority(frame.id) != self.priority, anomaly::PRIORITY_CHANGED)
            | when(elapsed(self.t_last, frame.t) > PAUSE_NS, anomaly::PAUSE);
        self.fd |= frame.fd;
        self.remember(frame, tail, body);
        self.used += body.len();
        self.turn();
    }

    /// The next frame has the other toggle.
    fn turn(&mut self) {
        self.next ^= 0x20;
        self.expect = self.next;
    }

    /// Keeps a frame that does not belong into the payload as evidence of a broken transfer.
    pub fn attach(&mut self, frame: &Frame<'_>, tail: Tail, body: &[u8]) {
        self.remember(frame, tail, body);
        self.expect = Self::NOTHING;
    }

    fn remember(&mut self, frame: &Frame<'_>, tail: Tail, body: &[u8]) {
        self.t_last = frame.t;
        self.last_tail = tail.0;
        self.last_length = body.len() as u8;
        self.last_at = self.used;
        let end = self.used + body.len();
        if self.bytes.len() < end + WORD || self.numbers.len() == self.count {
            self.grow(end + WORD);
        }
        self.bytes[self.used..end].copy_from_slice(body);
        self.numbers[self.count] = frame.number;
        self.count += 1;
    }

    #[cold]
    fn grow(&mut self, bytes: usize) {
        self.bytes
            .resize(bytes.next_power_of_two().max(PADDED).max(self.bytes.len()), 0);
        self.numbers.resize(
            (self.count + 1)
                .next_power_of_two()
                .max(SHORT_FRAMES)
                .max(self.numbers.len()),
            0,
        );
    }

    pub fn expects(&self, tail: Tail) -> bool {
        self.state == State::Open && self.next & 0x20 == tail.0 & 0x20
    }

    /// Whether `tail` and `body` repeat, byte for byte, the last frame that was taken.
    pub fn repeats(&self, tail: Tail, body: &[u8]) -> bool {
        let length = usize::from(self.last_length);
        self.count > 0 && self.last_tail == tail.0 && self.bytes[self.last_at..][..length] == *body
    }

    pub fn last_was_empty(&self) -> bool {
        self.last_length == 0
    }

    pub fn overfull(&self) -> bool {
        self.used > MAX_TRANSFER || self.count > MAX_TRANSFER
    }

    /// From here on the session's frames take the long way, which knows of other slots.
    pub fn overtake(&mut self, by: Overtaken) {
        self.overtaken = self.overtaken.max(by);
        self.expect = Self::NOTHING;
    }

    pub fn expired(&self, now: i64) -> bool {
        self.active() && elapsed(self.t, now) > TIMEOUT_NS
    }
}
