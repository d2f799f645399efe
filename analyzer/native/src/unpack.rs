//! Payload bytes to typed columns, by a plan that was checked before the first row.
//!
//! Fields at constant places are read column by column, and so is a list of numbers that fills what follows them;
//! everything else row by row. A row is read as far as its bits go: what is missing becomes null, and `left` says how much it was.
#![forbid(unsafe_code)]

mod block;
pub mod column;
pub mod ipc;
mod row;

use crate::bits::{inside, Span};
use crate::plan::{Kind, Plan};
use block::Block;
use column::{Column, Data};
use row::{read, read_fields, Tail};

/// Layout code: the tail array has no length field (classic CAN).
pub const TAIL: u8 = 0;
/// Layout code: every dynamic array has the length field of its type (CAN FD).
pub const PREFIX: u8 = 1;
/// Layout code: as [`PREFIX`], with a whole byte as length of the array that [`TAIL`] would leave without.
pub const BYTE_PREFIX: u8 = 2;

/// Rows of one type: any spans of the payload arena, in any order.
#[derive(Clone, Copy, Debug)]
pub struct Rows<'a> {
    pub spans: &'a [Span],
    /// One layout code a row; [`TAIL`] where none is given, [`PREFIX`] for an unknown one.
    pub layouts: &'a [u8],
}

/// The outermost struct or union as a column, and two columns about the rows.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Unpacked {
    pub root: Column,
    /// Bits behind the last field, or, negative, bits that were missing. Saturates.
    pub left: Vec<i32>,
    /// `DIRTY | BAD_TAG` of `bits.rs`.
    pub dirty: Vec<u8>,
}

/// Reads every row. Nothing in a payload makes it fail:
/// * a field whose bits are not all there is null, as is a list without its length field; a list keeps the whole
///   elements that are there (an array too, unless there is none);
/// * behind a length above the maximum or a union tag without member no field has a known place: they are null and
///   all those bits count as left;
/// * a list column holds at most 2^31 - 1 elements; those beyond are treated like those above the maximum.
pub fn unpack(plan: &Plan, rows: Rows<'_>, payload: &[u8]) -> Unpacked {
    let spans = &*inside(rows.spans, payload.len());
    let mut root = Column::new(&plan.root, spans.len());
    let mut block = Block::new(payload, spans);
    let mut done = plan.prefix;
    if let (Kind::Struct(fields), Data::Struct(columns)) = (&plan.root.kind, &mut root.data) {
        let (fixed, variable) = columns.split_at_mut(plan.prefix);
        for (field, column) in fields.iter().zip(fixed) {
            block.read(field, column);
        }
        if let ([list], [column]) = (&fields[plan.prefix..], variable) {
            let tails = rows.layouts.iter().all(|&layout| layout == TAIL);
            done += usize::from(tails && block.read_tail(list, column));
        }
    }
    if matches!(&plan.root.kind, Kind::Struct(fields) if fields.len() == done) && block.is_spent() {
        root.mark_all(spans.len());
        let (left, dirty) = (vec![0; spans.len()], vec![0; spans.len()]);
        return Unpacked { root, left, dirty };
    }
    let (mut left, mut dirty) = (Vec::with_capacity(spans.len()), Vec::with_capacity(spans.len()));
    for row in 0..spans.len() {
        let mut cursor = block.cursor(row);
        let tail = Tail::of(rows.layouts.get(row));
        if let (Kind::Struct(fields), Data::Struct(columns)) = (&plan.root.kind, &mut root.data) {
            read_fields(&fields[done..], &mut columns[done..], &mut cursor, tail);
            root.mark(true);
        } else {
            read(&plan.root, &mut root, &mut cursor, tail);
        }
        let (bits, flags) = cursor.close();
        left.push(bits);
        dirty.push(flags);
    }
    Unpacked { root, left, dirty }
}
