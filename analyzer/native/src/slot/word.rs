//! Frames that go the short way into a slot: their data in whole words, and no anomaly.
#![forbid(unsafe_code)]

use super::{Slot, KEPT, PADDED, PAUSE_NS, TIMEOUT_NS, WORD};
use crate::transfers::{SHORT_FRAMES, SHORT_PAYLOAD};
use crate::wire::{priority, Tail};

/// Transfers of more frames go the long way, which knows of the bounds.
const SHORT: usize = 512;

/// A classic frame with a tail byte, data in one word.
#[derive(Clone, Copy, Debug)]
pub struct Word {
    pub number: u64,
    pub t: i64,
    pub id: u32,
    pub tail: Tail,
    /// The payload, and behind it whatever follows.
    pub bytes: [u8; WORD],
    /// Bytes of the payload, at most 7.
    pub size: usize,
}

impl Word {
    /// `bytes` hold `size` bytes of payload and then the tail byte.
    #[inline]
    pub fn of(number: u64, t: i64, id: u32, bytes: [u8; WORD], size: usize) -> Word {
        let tail = Tail((u64::from_le_bytes(bytes) >> (8 * (size % WORD))) as u8);
        Word {
            number,
            t,
            id,
            tail,
            bytes,
            size,
        }
    }
}

/// All frames of a transfer but the first, one behind the other: full ones, and the last one.
#[derive(Clone, Copy, Debug)]
pub struct Rest<'a> {
    /// Their data, the last one's at the start of a word.
    pub words: &'a [[u8; WORD]],
    pub t_last: i64,
    pub last_tail: Tail,
    /// Bytes of the last one's payload.
    pub last_size: usize,
}

impl Slot {
    /// The payload behind a CRC and the numbers of the frames, each at the start of as much as is copied at once; none
    /// when they are longer.
    #[inline]
    pub fn short(&self) -> Option<(&[u8; SHORT_PAYLOAD], &[u64; SHORT_FRAMES])> {
        let bytes: &[u8; PADDED] = self.bytes.first_chunk()?;
        let fits = self.used <= SHORT_PAYLOAD + 2 && self.count <= SHORT_FRAMES;
        let numbers = self.numbers.first_chunk().filter(|_| fits)?;
        Some((bytes[2..].first_chunk()?, numbers))
    }

    /// [`Slot::start`] for the first of several frames if it adds no anomaly and there is room; false, and nothing done,
    /// for others.
    #[inline]
    pub fn start_word(&mut self, frame: &Word) -> bool {
        if frame.size < WORD - 1
            || !(PADDED..=KEPT).contains(&self.bytes.len())
            || !(SHORT_FRAMES..=KEPT).contains(&self.numbers.len())
        {
            return false;
        }
        self.reset(frame.t, frame.id, frame.tail, false);
        self.anomaly = 0;
        self.store(frame)
    }

    /// [`Slot::append`] for a frame that adds no anomaly; false, and nothing done, for others.
    #[inline]
    pub fn append_word(&mut self, frame: &Word) -> bool {
        (frame.tail.end() || frame.size == WORD - 1)
            && priority(frame.id) == self.priority
            && frame.t.wrapping_sub(self.t_last) as u64 <= PAUSE_NS as u64
            && frame.t.wrapping_sub(self.t) as u64 <= TIMEOUT_NS as u64
            && self.count < SHORT
            && self.store(frame)
    }

    /// Takes all that follows the first frame; false, and nothing done, when there is no room.
    #[inline]
    pub fn append_rest(&mut self, number: u64, rest: &Rest<'_>) -> bool {
        let bytes: Option<&mut [u8; PADDED]> = self.bytes.first_chunk_mut();
        let numbers: Option<&mut [u64; SHORT_FRAMES]> = self.numbers.first_chunk_mut();
        let (Some(bytes), Some(numbers), 1..SHORT_FRAMES) = (bytes, numbers, rest.words.len()) else {
            return false;
        };
        for (at, word) in (1..).zip(rest.words) {
            bytes[(WORD - 1) * at..][..WORD].copy_from_slice(word);
            numbers[at] = number + at as u64;
        }
        self.count = 1 + rest.words.len();
        self.t_last = rest.t_last;
        self.last_tail = rest.last_tail.0;
        self.last_length = rest.last_size as u8;
        self.last_at = (WORD - 1) * rest.words.len();
        self.used = self.last_at + rest.last_size;
        true
    }

    /// Takes what is in a frame; false, and nothing done, when there is no room.
    #[inline]
    fn store(&mut self, frame: &Word) -> bool {
        let room = self.bytes.get_mut(self.used..).and_then(<[u8]>::first_chunk_mut);
        let (Some(room), Some(number)) = (room, self.numbers.get_mut(self.count)) else {
            return false;
        };
        *room = frame.bytes;
        *number = frame.number;
        self.count += 1;
        self.t_last = frame.t;
        self.last_tail = frame.tail.0;
        self.last_length = frame.size as u8;
        self.last_at = self.used;
        self.used += frame.size;
        self.turn();
        true
    }
}
