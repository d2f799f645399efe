//! Rows of frames as the short way sees them: classic data frames, alone or as one whole transfer.
#![forbid(unsafe_code)]

use crate::frames::{Frames, ERROR, EXTENDED, FD, REMOTE};
use crate::slot::{Rest, Word, PAUSE_NS};
use crate::transfers::SHORT_FRAMES;
use crate::wire::Tail;

/// Bytes of a full frame.
const FULL: usize = 8;

/// Columns of equal length.
pub(super) struct Columns<'a> {
    pub(super) t: &'a [i64],
    bus: &'a [u8],
    id: &'a [u32],
    flags: &'a [u16],
    start: &'a [i32],
    end: &'a [i32],
    data: &'a [u8],
}

impl<'a> Columns<'a> {
    /// Rows from `first` on.
    pub(super) fn of(frames: &'a Frames, first: usize) -> Self {
        let count = frames.len() - first;
        Columns {
            t: &frames.t[first..][..count],
            bus: &frames.bus[first..][..count],
            id: &frames.id[first..][..count],
            flags: &frames.flags[first..][..count],
            start: &frames.offset[first..][..count],
            end: &frames.offset[first + 1..][..count],
            data: &frames.data,
        }
    }

    /// A classic data frame with a tail byte, and its bus; none for others, and where no whole word can be read.
    /// Row 0 has the number `first`.
    #[inline]
    pub(super) fn word(&self, row: usize, first: u64) -> Option<(u8, Word)> {
        let (&t, &bus, &id, &flags) = (self.t.get(row)?, &self.bus[row], &self.id[row], &self.flags[row]);
        let (start, end) = (self.start[row] as usize, self.end[row] as usize);
        let size = end.wrapping_sub(start).wrapping_sub(1);
        let bytes = self.data.get(start..)?.first_chunk()?;
        let plain = is_plain(flags) && size < FULL;
        plain.then(|| (bus, Word::of(first + row as u64, t, id, *bytes, size)))
    }

    /// What follows `word` in `row` if that begins a transfer, and the next rows hold the rest of it without a pause.
    #[inline]
    pub(super) fn rest(&self, row: usize, word: &Word) -> Option<Rest<'a>> {
        if word.tail.0 & 0xE0 != 0x80 {
            return None;
        }
        let (mut next, mut t_last, mut end) = (word.tail.0 & 0x1F, word.t, self.end[row] as usize);
        let (from, bus) = (end, self.bus[row]);
        for at in row + 1..self.t.len().min(row + SHORT_FRAMES) {
            let start = end;
            next ^= 0x20;
            end = self.end[at] as usize;
            let same = self.id[at] == word.id && self.bus[at] == bus && is_plain(self.flags[at]);
            let pause = self.t[at].wrapping_sub(t_last) as u64;
            t_last = self.t[at];
            let tail = Tail(*self.data.get(end.wrapping_sub(1))?);
            let size = end.wrapping_sub(start).wrapping_sub(1);
            if !same || pause > PAUSE_NS as u64 || tail.0 & 0xBF != next || size >= FULL {
                return None;
            }
            if tail.end() {
                let words = self.data.get(from..start + FULL)?.as_chunks().0;
                return Some(Rest {
                    words,
                    t_last,
                    last_tail: tail,
                    last_size: size,
                });
            }
            if size != FULL - 1 {
                return None;
            }
        }
        None
    }
}

fn is_plain(flags: u16) -> bool {
    flags & (EXTENDED | REMOTE | ERROR | FD) == EXTENDED
}
