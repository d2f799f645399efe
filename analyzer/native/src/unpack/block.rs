//! All rows at once: fields that have one place in every row.
#![forbid(unsafe_code)]

use super::column::{Column, Data};
use super::row::{read, scalars, Tail};
use crate::bits::{half, uint, Cursor, Span};
use crate::plan::{Form, Kind, Node};

/// Rows that have been read up to one and the same bit.
pub struct Block<'a> {
    payload: &'a [u8],
    /// Inside `payload`.
    spans: &'a [Span],
    /// Bits of the shortest row.
    shortest: usize,
    /// Bits behind the start of each row.
    at: usize,
    /// Bits that a list took behind `at`, by row; empty if there is none.
    taken: Vec<usize>,
    /// What reading noticed, by row; empty if nothing could be.
    flags: Vec<u8>,
}

impl<'a> Block<'a> {
    pub fn new(payload: &'a [u8], spans: &'a [Span]) -> Block<'a> {
        Block {
            payload,
            spans,
            shortest: spans.iter().map(|s| s.end - s.start).min().unwrap_or(0) * 8,
            at: 0,
            taken: vec![],
            flags: vec![],
        }
    }

    /// Where reading of a row goes on.
    #[inline]
    pub fn cursor(&self, row: usize) -> Cursor<'a> {
        let taken = self.taken.get(row).copied().unwrap_or(0);
        let mut cursor = Cursor::new(self.payload, self.spans[row], self.at.saturating_add(taken));
        cursor.flags = self.flags.get(row).copied().unwrap_or(0);
        cursor
    }

    /// Whether every row has been read to its last bit, and nothing was noticed in it.
    pub fn is_spent(&self) -> bool {
        let taken = |row: usize| self.taken.get(row).copied().unwrap_or(0);
        let spent = |(row, span): (usize, &Span)| (span.end - span.start) * 8 == self.at + taken(row);
        self.flags.is_empty() && self.spans.iter().enumerate().all(spent)
    }

    /// A field of fixed size.
    pub fn read(&mut self, node: &Node, column: &mut Column) {
        let from = self.at;
        let to = from.saturating_add(usize::try_from(node.min_bits).unwrap_or(usize::MAX));
        let places = self.spans.iter().map(|s| s.start * 8 + from);
        match (&node.kind, &mut column.data) {
            (Kind::Struct(fields), Data::Struct(columns)) => {
                for (field, column) in fields.iter().zip(columns) {
                    self.read(field, column);
                }
                column.mark_all(self.spans.len());
            }
            (Kind::Bool, Data::Bool(bits)) if to <= self.shortest => {
                places.for_each(|at| bits.push(uint(self.payload, at, 1) != 0));
                column.mark_all(self.spans.len());
            }
            (Kind::Scalar { form, bits }, Data::Scalar { width, values }) if to <= self.shortest => {
                if !self.read_bytes((*form, *bits), from, values) {
                    scalars((*form, *bits), self.payload, places, self.spans.len(), values, *width);
                }
                column.mark_all(self.spans.len());
            }
            _ => {
                self.flags.resize(self.spans.len(), 0);
                for (row, flags) in self.flags.iter_mut().enumerate() {
                    let mut cursor = Cursor::new(self.payload, self.spans[row], from);
                    read(node, column, &mut cursor, Tail::Usual);
                    *flags |= cursor.flags;
                }
            }
        }
        self.at = to;
    }

    /// Numbers of whole bytes from bit `from` on, if that is where a byte begins and every row reaches them.
    fn read_bytes(&self, form: (Form, u32), from: usize, values: &mut Vec<u8>) -> bool {
        if !from.is_multiple_of(8) {
            return false;
        }
        let at = from / 8;
        match form {
            (Form::Float, 16) => self.append(at, values, |cell| half(u16::from_le_bytes(cell)).to_le_bytes()),
            (_, 8) => self.append(at, values, |cell: [u8; 1]| cell),
            (_, 16) => self.append(at, values, |cell: [u8; 2]| cell),
            (_, 32) => self.append(at, values, |cell: [u8; 4]| cell),
            (_, 64) => self.append(at, values, |cell: [u8; 8]| cell),
            _ => return false,
        }
        true
    }

    fn append<const W: usize, const O: usize>(&self, at: usize, values: &mut Vec<u8>, of: impl Fn([u8; W]) -> [u8; O]) {
        let bytes = |span: &Span| self.payload.get(span.start + at..).and_then(<[u8]>::first_chunk);
        let cell = |span: &Span| of(bytes(span).copied().unwrap_or([0; W]));
        let mut cells = self.spans.iter().map(cell).collect::<Vec<_>>().into_flattened();
        if values.is_empty() {
            *values = cells;
        } else {
            values.append(&mut cells);
        }
    }

    /// A list without length field, if it is one of numbers and every row reaches it; else does nothing.
    pub fn read_tail(&mut self, node: &Node, column: &mut Column) -> bool {
        let (Kind::List { max, element, .. }, Data::List { offsets, child }) = (&node.kind, &mut column.data) else {
            return false;
        };
        let (Kind::Scalar { form, bits }, Data::Scalar { width, values }) = (&element.kind, &mut child.data) else {
            return false;
        };
        let bytes: usize = self.spans.iter().map(|s| s.end - s.start).sum();
        // No list of this size has more elements than an offset can count.
        let countable = bytes <= i32::MAX as usize / 8;
        if !element.fills_tail() || self.at > self.shortest || !countable {
            return false;
        }
        let (step, max) = (*bits as usize, *max as usize);
        let mut count = 0;
        for span in self.spans {
            let first = span.start * 8 + self.at;
            let fit = max.min((span.end * 8 - first) / step);
            count += fit;
            offsets.push(count as i32);
            self.taken.push(fit * step);
        }
        let firsts = self.spans.iter().map(|s| s.start * 8 + self.at);
        if step == *width * 8 && self.at.is_multiple_of(8) {
            for (at, taken) in firsts.zip(&self.taken) {
                values.extend_from_slice(&self.payload[at / 8..(at + taken) / 8]);
            }
        } else {
            values.reserve(count * *width);
            let fits = offsets.windows(2).map(|ends| (ends[1] - ends[0]) as usize);
            for (first, fit) in firsts.zip(fits) {
                let places = (0..fit).map(|i| first + i * step);
                scalars((*form, *bits), self.payload, places, fit, values, *width);
            }
        }
        child.mark_all(count);
        column.mark_all(self.spans.len());
        true
    }
}
