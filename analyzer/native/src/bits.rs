//! Bits of `DroneCAN` payloads: a value of n bits is its whole low-order bytes first, then the other n % 8 bits,
//! left-aligned at the current position; within a byte the highest bit comes first.
#![forbid(unsafe_code)]

use std::borrow::Cow;

/// Set in [`Cursor::flags`]: padding, or what follows the last field, is not all zero.
pub const DIRTY: u8 = 1;
/// Set in [`Cursor::flags`]: a union's tag names no member.
pub const BAD_TAG: u8 = 2;

/// The bytes `start..end` of an arena.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Span {
    pub start: usize,
    pub end: usize,
}

/// The rows of a binary column: all, or those that `rows` names, in its order. A row that is not there is empty.
pub fn spans(offsets: &[i32], rows: Option<&[u32]>) -> Vec<Span> {
    let span = |row: usize| {
        let place = |at: usize| offsets.get(at).and_then(|&o| usize::try_from(o).ok());
        let start = place(row).unwrap_or(0);
        let end = place(row.saturating_add(1)).unwrap_or(start);
        Span { start, end }
    };
    match rows {
        Some(rows) => rows.iter().map(|&row| span(row as usize)).collect(),
        None => (0..offsets.len().saturating_sub(1)).map(span).collect(),
    }
}

/// The same spans with every one inside an arena of `len` bytes.
pub fn inside(spans: &[Span], len: usize) -> Cow<'_, [Span]> {
    if spans.iter().all(|s| s.start <= s.end && s.end <= len) {
        return Cow::Borrowed(spans);
    }
    let clip = |s: &Span| {
        let end = s.end.min(len);
        Span {
            start: s.start.min(end),
            end,
        }
    };
    Cow::Owned(spans.iter().map(clip).collect())
}

/// Eight bytes as one big-endian number. Bytes behind the arena read as 0; an arena with room
/// behind its last row never takes the slow way.
#[inline]
fn window(arena: &[u8], at: usize) -> u64 {
    match arena.get(at..).and_then(<[u8]>::first_chunk) {
        Some(chunk) => u64::from_be_bytes(*chunk),
        None => last_window(arena, at),
    }
}

#[cold]
fn last_window(arena: &[u8], at: usize) -> u64 {
    let mut chunk = [0; 8];
    for (to, from) in chunk.iter_mut().zip(arena.iter().skip(at)) {
        *to = *from;
    }
    u64::from_be_bytes(chunk)
}

/// The value of the `bits` (1 to 64) bits from bit `at` of the arena on.
#[inline(always)]
#[expect(
    clippy::inline_always,
    reason = "what depends on `bits` alone moves out of the loop over places"
)]
pub fn uint(arena: &[u8], at: usize, bits: u32) -> u64 {
    let (byte, shift) = (at / 8, (at % 8) as u32);
    let mut word = window(arena, byte) << shift;
    if bits > 57 && shift + bits > 64 {
        word |= u64::from(arena.get(byte + 8).copied().unwrap_or(0)) >> (8 - shift);
    }
    if bits == 64 {
        return word.swap_bytes();
    }
    let whole = bits & !7;
    let low = word.swap_bytes() & !(u64::MAX << whole);
    // Two shifts, because none of 64 exists when no bits are over.
    let high = (word << whole) >> 1 >> (63 - bits % 8);
    low | high << whole
}

fn any_set(arena: &[u8], mut from: usize, to: usize) -> bool {
    while from < to {
        let bits = (to - from).min(64);
        if uint(arena, from, bits as u32) != 0 {
            return true;
        }
        from += bits;
    }
    false
}

/// float16 as the bits of the equal float32 (IEEE 754 binary16, section 5.2). NaN payloads stay.
#[inline]
pub fn half(raw: u16) -> u32 {
    let sign = u32::from(raw & 0x8000) << 16;
    let mantissa = u32::from(raw & 0x3FF);
    let magnitude = match u32::from(raw >> 10 & 0x1F) {
        0 => (f32::from(raw & 0x3FF) / 16_777_216.0).to_bits(),
        31 => 0x7F80_0000 | mantissa << 13,
        exponent => (exponent + 127 - 15) << 23 | mantissa << 13,
    };
    sign | magnitude
}

/// A place in one row. It walks on behind the end of the row, so that it knows what was missing.
#[derive(Clone, Copy)]
pub struct Cursor<'a> {
    arena: &'a [u8],
    at: usize,
    end: usize,
    /// Bits given up by [`Cursor::stop`].
    rest: usize,
    pub flags: u8,
}

impl<'a> Cursor<'a> {
    /// `at` bits behind the start of a row that lies inside the arena.
    #[inline]
    pub fn new(arena: &'a [u8], row: Span, at: usize) -> Cursor<'a> {
        Cursor {
            arena,
            at: (row.start * 8).saturating_add(at),
            end: row.end * 8,
            rest: 0,
            flags: 0,
        }
    }

    pub fn arena(&self) -> &'a [u8] {
        self.arena
    }

    /// Bit of the arena.
    pub fn at(&self) -> usize {
        self.at
    }

    pub fn remaining(&self) -> usize {
        self.end.saturating_sub(self.at)
    }

    /// Bits were asked for that are not there.
    pub fn is_short(&self) -> bool {
        self.at > self.end
    }

    /// Nothing that comes now has a known place.
    pub fn is_lost(&self) -> bool {
        self.is_short() || self.rest > 0
    }

    /// The next `bits` (0 to 64) as a number, or none when some of them are missing.
    #[inline]
    pub fn take(&mut self, bits: u32) -> Option<u64> {
        let from = self.at;
        self.skip(u64::from(bits));
        match bits {
            _ if self.is_short() => None,
            0 => Some(0),
            _ => Some(uint(self.arena, from, bits)),
        }
    }

    pub fn skip(&mut self, bits: u64) {
        self.at = self.at.saturating_add(usize::try_from(bits).unwrap_or(usize::MAX));
    }

    /// Padding: skipped, and looked at.
    pub fn void(&mut self, bits: u32) {
        let from = self.at;
        self.skip(u64::from(bits));
        if any_set(self.arena, from, self.at.min(self.end)) {
            self.flags |= DIRTY;
        }
    }

    /// Gives up the rest of the row: what it holds cannot be told, so nothing is read from it.
    pub fn stop(&mut self) {
        self.rest += self.remaining();
        self.end = self.end.min(self.at);
    }

    /// Takes back what was read since `before`, but not what was noticed.
    pub fn back_to(&mut self, before: &Cursor<'a>) {
        *self = Cursor {
            flags: self.flags,
            ..*before
        };
    }

    /// Bits left (negative: missing) and flags of a row that was read to its last field.
    #[inline]
    pub fn close(mut self) -> (i32, u8) {
        let end = self.end + self.rest;
        let over = if self.rest > 0 { self.end } else { self.at };
        if any_set(self.arena, over, end) {
            self.flags |= DIRTY;
        }
        let gap = i32::try_from(end.abs_diff(over)).unwrap_or(i32::MAX);
        (if over > end { -gap } else { gap }, self.flags)
    }
}
