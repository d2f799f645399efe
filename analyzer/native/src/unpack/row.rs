//! One row, field by field: everything whose place or size the row itself decides.
#![forbid(unsafe_code)]

use super::column::{Column, Data};
use super::{BYTE_PREFIX, TAIL};
use crate::bits::{half, uint, Cursor, BAD_TAG};
use crate::plan::{Form, Kind, Node};

/// What becomes of the length field of a dynamic array that ends the type.
#[derive(Clone, Copy, PartialEq, Eq)]
pub enum Tail {
    Usual,
    Absent,
    Byte,
}

impl Tail {
    pub fn of(layout: Option<&u8>) -> Tail {
        match layout {
            None | Some(&TAIL) => Tail::Absent,
            Some(&BYTE_PREFIX) => Tail::Byte,
            Some(_) => Tail::Usual,
        }
    }

    fn when(self, last: bool) -> Tail {
        if last {
            self
        } else {
            Tail::Usual
        }
    }
}

/// The cell of a scalar, in the low bytes.
#[inline(always)]
#[expect(
    clippy::inline_always,
    reason = "everything about the form is then decided before a loop, not in it"
)]
fn cell(form: Form, bits: u32, raw: u64) -> u64 {
    if (form, bits) == (Form::Float, 16) {
        return u64::from(half(raw as u16));
    }
    let sign = u64::from(form == Form::Int) << (bits - 1);
    (raw ^ sign).wrapping_sub(sign)
}

/// Appends the cells of the `count` scalars at `places` (bits of the arena).
pub fn scalars(
    form: (Form, u32),
    arena: &[u8],
    places: impl Iterator<Item = usize>,
    count: usize,
    values: &mut Vec<u8>,
    width: usize,
) {
    match (form, width) {
        ((Form::Float, 16), _) => append::<4>((Form::Float, 16), arena, places, count, values),
        (_, 1) => append::<1>(form, arena, places, count, values),
        (_, 2) => append::<2>(form, arena, places, count, values),
        (_, 4) => append::<4>(form, arena, places, count, values),
        _ => append::<8>(form, arena, places, count, values),
    }
}

fn append<const WIDTH: usize>(
    (form, bits): (Form, u32),
    arena: &[u8],
    places: impl Iterator<Item = usize>,
    count: usize,
    values: &mut Vec<u8>,
) {
    let old = values.len();
    values.resize(old + WIDTH * count, 0);
    let mut cells = values[old..].as_chunks_mut::<WIDTH>().0.iter_mut();
    places.for_each(|at| {
        if let Some(to) = cells.next() {
            let cell = cell(form, bits, uint(arena, at, bits));
            to.copy_from_slice(&cell.to_le_bytes()[..WIDTH]);
        }
    });
}

/// One value of one row.
pub fn read(node: &Node, column: &mut Column, cursor: &mut Cursor<'_>, tail: Tail) {
    match (&node.kind, &mut column.data) {
        (Kind::Void { bits }, _) => cursor.void(*bits),
        (Kind::Bool, Data::Bool(bits)) => match cursor.take(1) {
            Some(raw) => {
                bits.push(raw != 0);
                column.mark(true);
            }
            None => column.null(),
        },
        (Kind::Scalar { form, bits }, Data::Scalar { width, values }) => match cursor.take(*bits) {
            Some(raw) => {
                values.extend_from_slice(&cell(*form, *bits, raw).to_le_bytes()[..*width]);
                column.mark(true);
            }
            None => column.null(),
        },
        (Kind::Array { count, element }, Data::List { offsets, child }) => {
            let read = counted(element, child, cursor, *count, *count, tail);
            offsets.push(child.end());
            column.mark(read > 0);
        }
        (
            Kind::List {
                max,
                length_bits,
                element,
            },
            Data::List { offsets, child },
        ) => {
            let (own, inner) = if element.fills_tail() {
                (tail, Tail::Usual)
            } else {
                (Tail::Usual, tail)
            };
            let known = match own {
                Tail::Absent => {
                    let known = !cursor.is_lost();
                    let most = room(child).min(*max);
                    elements(element, child, cursor, most, Broken::Left, |_| Tail::Usual);
                    known
                }
                Tail::Usual | Tail::Byte => {
                    let bits = if own == Tail::Byte { 8 } else { *length_bits };
                    let count = cursor.take(bits).map(|count| count as u32);
                    if let Some(count) = count {
                        counted(element, child, cursor, count, *max, inner);
                    }
                    count.is_some()
                }
            };
            offsets.push(child.end());
            column.mark(known);
        }
        (Kind::Struct(fields), Data::Struct(columns)) => {
            read_fields(fields, columns, cursor, tail);
            column.mark(true);
        }
        (Kind::Union { tag_bits, members }, Data::Struct(columns)) => {
            let Some(tag) = cursor.take(*tag_bits) else {
                cursor.skip(node.min_bits - u64::from(*tag_bits));
                return column.null();
            };
            for ((at, member), column) in (0..).zip(members).zip(columns) {
                if at == tag {
                    read(member, column, cursor, tail);
                } else {
                    column.null();
                }
            }
            if tag >= members.len() as u64 {
                cursor.flags |= BAD_TAG;
                cursor.stop();
            }
            column.mark(true);
        }
        _ => unreachable!("a column is made from its node"),
    }
}

pub fn read_fields(fields: &[Node], columns: &mut [Column], cursor: &mut Cursor<'_>, tail: Tail) {
    let last = fields.len().saturating_sub(1);
    for (at, (field, column)) in fields.iter().zip(columns).enumerate() {
        read(field, column, cursor, tail.when(at == last));
    }
}

/// `count` elements that a length field or the type asks for; returns how many are kept.
fn counted(element: &Node, child: &mut Column, cursor: &mut Cursor<'_>, count: u32, max: u32, tail: Tail) -> u32 {
    let most = count.min(max).min(room(child));
    let kept = elements(element, child, cursor, most, Broken::Missed, |at| {
        tail.when(at + 1 == count)
    });
    if kept < count && cursor.remaining() > 0 {
        cursor.stop();
    } else if kept < count {
        // The first that was not whole has been walked over.
        let more = count - kept - u32::from(kept < most);
        cursor.skip(element.min_bits.saturating_mul(u64::from(more)));
    }
    kept
}

/// How many elements a list column can still take.
fn room(child: &Column) -> u32 {
    i32::MAX.unsigned_abs() - child.len() as u32
}

/// Where reading goes on behind an element that is not whole.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Broken {
    /// At its start: the element is none, its bits are left over.
    Left,
    /// Behind its end: the element should be there, bits are missing.
    Missed,
}

/// Keeps elements until there are `most`, or one is not whole: that leaves no cell. Returns how many are kept.
fn elements(
    element: &Node,
    child: &mut Column,
    cursor: &mut Cursor<'_>,
    most: u32,
    broken: Broken,
    tail: impl Fn(u32) -> Tail,
) -> u32 {
    let (arena, at) = (cursor.arena(), cursor.at());
    let kept = match (&element.kind, &mut child.data) {
        (Kind::Scalar { form, bits }, Data::Scalar { width, values }) => {
            let kept = walk(cursor, *bits, most, broken);
            let (step, count) = (*bits as usize, kept as usize);
            match arena.get(at / 8..at / 8 + count * *width) {
                Some(bytes) if at % 8 == 0 && step == *width * 8 => values.extend_from_slice(bytes),
                _ => scalars(
                    (*form, *bits),
                    arena,
                    (0..count).map(|i| at + i * step),
                    count,
                    values,
                    *width,
                ),
            }
            kept
        }
        (Kind::Bool, Data::Bool(values)) => {
            let kept = walk(cursor, 1, most, broken);
            (at..at + kept as usize).for_each(|at| values.push(uint(arena, at, 1) != 0));
            kept
        }
        _ => return rows(element, child, cursor, most, broken, tail),
    };
    child.mark_all(kept as usize);
    kept
}

/// As [`elements`], for those of one size, without reading them.
fn walk(cursor: &mut Cursor<'_>, bits: u32, most: u32, broken: Broken) -> u32 {
    let fit = u32::try_from(cursor.remaining() / bits as usize).unwrap_or(u32::MAX);
    let kept = most.min(fit);
    let missed = kept < most && broken == Broken::Missed;
    cursor.skip(u64::from(bits) * (u64::from(kept) + u64::from(missed)));
    kept
}

/// As [`elements`], for those that must be read one by one.
fn rows(
    element: &Node,
    child: &mut Column,
    cursor: &mut Cursor<'_>,
    most: u32,
    broken: Broken,
    tail: impl Fn(u32) -> Tail,
) -> u32 {
    for index in 0..most {
        let (before, rows) = (*cursor, child.len());
        if (cursor.remaining() as u64) < element.min_bits {
            cursor.skip(element.min_bits);
        } else {
            read(element, child, cursor, tail(index));
        }
        if cursor.is_short() {
            child.truncate(rows);
            if broken == Broken::Left {
                cursor.back_to(&before);
            }
            return index;
        }
    }
    most
}
