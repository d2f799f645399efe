//! Rows on their way into `Frames`: fixed columns, so that a row costs stores and no growth checks.
#![forbid(unsafe_code)]

use crate::frames::{Frames, MAX_CLASSIC};

pub(super) const ROWS: usize = 512;

/// One decoded line.
#[derive(Clone, Copy, Debug)]
pub(super) struct Row {
    pub(super) ns: i64,
    pub(super) bus: u8,
    pub(super) id: u32,
    pub(super) flags: u16,
    /// The first byte lowest; only `len` of them count.
    pub(super) data: u64,
    pub(super) len: usize,
}

#[derive(Clone, Debug)]
pub struct Block {
    rows: usize,
    bytes: usize,
    digits: usize,
    t: [i64; ROWS],
    bus: [u8; ROWS],
    id: [u32; ROWS],
    flags: [u16; ROWS],
    /// End of each row's data.
    end: [u16; ROWS],
    data: [u8; ROWS * MAX_CLASSIC],
}

impl Default for Block {
    fn default() -> Self {
        Block {
            rows: 0,
            bytes: 0,
            digits: 0,
            t: [0; ROWS],
            bus: [0; ROWS],
            id: [0; ROWS],
            flags: [0; ROWS],
            end: [0; ROWS],
            data: [0; ROWS * MAX_CLASSIC],
        }
    }
}

impl Block {
    pub fn len(&self) -> usize {
        self.rows
    }

    pub fn is_empty(&self) -> bool {
        self.rows == 0
    }

    /// Digits of the fraction of every time stamp in the block.
    pub fn digits(&self) -> usize {
        self.digits
    }

    pub(super) fn clear(&mut self, digits: usize) {
        self.rows = 0;
        self.bytes = 0;
        self.digits = digits;
    }

    pub(super) fn is_full(&self) -> bool {
        self.rows >= ROWS
    }

    #[inline]
    pub(super) fn push(&mut self, row: &Row) {
        let at = self.rows;
        self.t[at] = row.ns;
        self.bus[at] = row.bus;
        self.id[at] = row.id;
        self.flags[at] = row.flags;
        self.data[self.bytes..self.bytes + MAX_CLASSIC].copy_from_slice(&row.data.to_le_bytes());
        self.bytes += row.len;
        self.end[at] = self.bytes as u16;
        self.rows += 1;
    }

    /// Appends the rows as lines `first_line` and following.
    pub fn append_to(&self, frames: &mut Frames, first_line: u64) {
        let rows = self.rows;
        let start = frames.data.len() as i32;
        let first_line = u32::try_from(first_line).unwrap_or(u32::MAX);
        frames.t.extend_from_slice(&self.t[..rows]);
        frames.bus.extend_from_slice(&self.bus[..rows]);
        frames.id.extend_from_slice(&self.id[..rows]);
        frames.flags.extend_from_slice(&self.flags[..rows]);
        frames
            .line
            .extend((0..rows as u32).map(|row| first_line.saturating_add(row)));
        frames
            .offset
            .extend(self.end[..rows].iter().map(|&end| start + i32::from(end)));
        frames.data.extend_from_slice(&self.data[..self.bytes]);
    }
}
