//! What a capture holds beside frames: error frames, drop counts, gaps, unreadable lines, comments.
#![forbid(unsafe_code)]

use std::ops::Range;

use crate::frames::{rises, RX, TX};

/// The `kind` column, in the order of `EVENTS` in `analyzer/tables.py`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub enum EventKind {
    ErrorFrame = 0,
    Drop = 1,
    Gap = 2,
    Unreadable = 3,
    Comment = 4,
    /// On the frame or error frame of the same record, in front of it; no record of its own.
    FrameComment = 5,
}

/// One row. `None` becomes a null cell.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Event<'a> {
    pub t: i64,
    pub bus: Option<u8>,
    pub line: u64,
    pub kind: EventKind,
    /// Error class bits of an error frame, number of frames of a drop count, else 0.
    pub class: u32,
    /// Of an error frame whether it was sent or received: bits `TX` and `RX` of [`crate::frames`], no others are kept.
    pub flags: u16,
    /// Transmit and receive error counters of an error frame that carries them.
    pub counters: Option<(u8, u8)>,
    /// Data field of an error frame, else empty.
    pub data: &'a [u8],
    /// UTF-8; what a reader of the capture wants to see. Bounded by the one who writes it.
    pub text: &'a str,
}

impl<'a> Event<'a> {
    /// One that no frame of the bus stands behind.
    pub fn remark(t: i64, line: u64, kind: EventKind, text: &'a str) -> Self {
        Event {
            t,
            bus: None,
            line,
            kind,
            class: 0,
            flags: 0,
            counters: None,
            data: &[],
            text,
        }
    }
}

/// Columns of the `events` table; `*_valid` holds 1 for a cell that is not null.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Events {
    pub t: Vec<i64>,
    pub bus: Vec<u8>,
    pub bus_valid: Vec<u8>,
    pub line: Vec<u32>,
    pub kind: Vec<u8>,
    pub class: Vec<u32>,
    pub flags: Vec<u16>,
    pub tx_errors: Vec<u8>,
    pub rx_errors: Vec<u8>,
    pub errors_valid: Vec<u8>,
    /// End of each data field in `data`.
    pub data_end: Vec<i32>,
    pub data: Vec<u8>,
    /// End of each text in `text`.
    pub text_end: Vec<i32>,
    pub text: Vec<u8>,
}

impl Events {
    pub fn len(&self) -> usize {
        self.t.len()
    }

    pub fn is_empty(&self) -> bool {
        self.t.is_empty()
    }

    pub fn push(&mut self, event: &Event<'_>) {
        self.t.push(event.t);
        self.bus.push(event.bus.unwrap_or(0));
        self.bus_valid.push(u8::from(event.bus.is_some()));
        self.line.push(u32::try_from(event.line).unwrap_or(u32::MAX));
        self.kind.push(event.kind as u8);
        self.class.push(event.class);
        self.flags.push(event.flags & (TX | RX));
        let (tx, rx) = event.counters.unwrap_or((0, 0));
        self.tx_errors.push(tx);
        self.rx_errors.push(rx);
        self.errors_valid.push(u8::from(event.counters.is_some()));
        self.data.extend_from_slice(event.data);
        self.data_end.push(self.data.len() as i32);
        self.text.extend_from_slice(event.text.as_bytes());
        self.text_end.push(self.text.len() as i32);
    }

    /// Whether all columns have as many rows, and ends that lie in their bytes.
    pub fn fits(&self) -> bool {
        let rows = self.len();
        let bytes = [
            self.bus.len(),
            self.bus_valid.len(),
            self.kind.len(),
            self.tx_errors.len(),
            self.rx_errors.len(),
        ];
        let others = [
            self.line.len(),
            self.class.len(),
            self.flags.len(),
            self.errors_valid.len(),
            self.data_end.len(),
            self.text_end.len(),
        ];
        bytes == [rows; 5]
            && others == [rows; 6]
            && rises(&self.data_end, self.data.len())
            && rises(&self.text_end, self.text.len())
    }

    pub fn text_of(&self, row: usize) -> String {
        String::from_utf8_lossy(cell(&self.text_end, &self.text, row)).into_owned()
    }

    /// The data field of an error frame.
    pub fn data_of(&self, row: usize) -> &[u8] {
        cell(&self.data_end, &self.data, row)
    }

    /// Appends some rows of `other`.
    pub fn extend(&mut self, other: &Events, rows: Range<usize>) {
        extend_bytes(&mut self.data_end, &mut self.data, &other.data_end, &other.data, &rows);
        extend_bytes(&mut self.text_end, &mut self.text, &other.text_end, &other.text, &rows);
        self.t.extend_from_slice(&other.t[rows.clone()]);
        self.bus.extend_from_slice(&other.bus[rows.clone()]);
        self.bus_valid.extend_from_slice(&other.bus_valid[rows.clone()]);
        self.line.extend_from_slice(&other.line[rows.clone()]);
        self.kind.extend_from_slice(&other.kind[rows.clone()]);
        self.class.extend_from_slice(&other.class[rows.clone()]);
        self.flags.extend_from_slice(&other.flags[rows.clone()]);
        self.tx_errors.extend_from_slice(&other.tx_errors[rows.clone()]);
        self.rx_errors.extend_from_slice(&other.rx_errors[rows.clone()]);
        self.errors_valid.extend_from_slice(&other.errors_valid[rows]);
    }
}

/// Appends some cells of a column of byte strings, given by their ends.
fn extend_bytes(ends: &mut Vec<i32>, bytes: &mut Vec<u8>, other_ends: &[i32], other: &[u8], rows: &Range<usize>) {
    let end_of = |row: usize| row.checked_sub(1).map_or(0, |last| other_ends[last]);
    let (start, end) = (end_of(rows.start), end_of(rows.end));
    let moved = bytes.len() as i32 - start;
    bytes.extend_from_slice(&other[start as usize..end as usize]);
    ends.extend(other_ends[rows.clone()].iter().map(|end| end + moved));
}

fn cell<'a>(ends: &[i32], bytes: &'a [u8], row: usize) -> &'a [u8] {
    let start = row.checked_sub(1).map_or(0, |last| ends[last]);
    &bytes[start as usize..ends[row] as usize]
}
