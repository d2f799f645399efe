//! Rows of columns as Protocol Buffers messages, one message a row.
//!
//! A null cell is a field that is not there, everything else is written, zero too: readers then tell the two apart
//! (fields are `optional`). Unsigned numbers and flags are varints, signed ones zigzag varints (`sint32`, `sint64`),
//! floats are fixed, lists of numbers packed. What the elements of a list are, they all are: none is null.
#![forbid(unsafe_code)]

use std::fmt;

/// The values of a column, row by row.
pub enum Cells<'a> {
    U8(&'a [u8]),
    U16(&'a [u16]),
    U32(&'a [u32]),
    U64(&'a [u64]),
    I8(&'a [i8]),
    I16(&'a [i16]),
    I32(&'a [i32]),
    I64(&'a [i64]),
    F32(&'a [f32]),
    F64(&'a [f64]),
    /// A bitmap, lowest bit first, of at least this many rows.
    Bool(&'a [u8]),
    /// Text or bytes: row r is `data[offsets[r]..offsets[r + 1]]`.
    Bytes(&'a [i32], &'a [u8]),
    /// Row r is made of the elements `offsets[r]..offsets[r + 1]`.
    List(&'a [i32], Box<Cells<'a>>),
    Message(Vec<Field<'a>>),
}

/// A field of a message.
pub struct Field<'a> {
    /// Field number, from 1.
    pub number: u32,
    /// Bitmap of the rows that have a value; all have without.
    pub valid: Option<&'a [u8]>,
    pub cells: Cells<'a>,
}

/// The columns do not fit together, or a field cannot be numbered like this.
#[derive(Debug, PartialEq, Eq)]
pub struct Mismatch(&'static str);

impl fmt::Display for Mismatch {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.0)
    }
}

const LARGEST_NUMBER: u32 = (1 << 29) - 1;
const VARINT: u32 = 0;
const FIXED_64: u32 = 1;
const LENGTH: u32 = 2;
const FIXED_32: u32 = 5;

/// The messages of rows 0 to `rows`, one behind the other, and where each ends.
///
/// # Errors
/// Columns that are too short, or offsets that go backwards or too far.
pub fn encode(fields: &[Field<'_>], rows: usize) -> Result<(Vec<u8>, Vec<u64>), Mismatch> {
    check(fields, rows)?;
    let (mut out, mut ends) = (Vec::with_capacity(rows * 32), Vec::with_capacity(rows));
    for row in 0..rows {
        message(&mut out, fields, row);
        ends.push(out.len() as u64);
    }
    Ok((out, ends))
}

fn check(fields: &[Field<'_>], rows: usize) -> Result<(), Mismatch> {
    for field in fields {
        if field.number == 0 || field.number > LARGEST_NUMBER {
            return Err(Mismatch("no such field number"));
        }
        if field.valid.is_some_and(|bits| bits.len() < rows.div_ceil(8)) {
            return Err(Mismatch("a bitmap is too short"));
        }
        check_cells(&field.cells, rows)?;
    }
    Ok(())
}

fn check_cells(cells: &Cells<'_>, rows: usize) -> Result<(), Mismatch> {
    let there = match cells {
        Cells::U8(v) => v.len(),
        Cells::U16(v) => v.len(),
        Cells::U32(v) => v.len(),
        Cells::U64(v) => v.len(),
        Cells::I8(v) => v.len(),
        Cells::I16(v) => v.len(),
        Cells::I32(v) => v.len(),
        Cells::I64(v) => v.len(),
        Cells::F32(v) => v.len(),
        Cells::F64(v) => v.len(),
        Cells::Bool(bits) => bits.len() * 8,
        Cells::Bytes(offsets, data) => {
            if last(offsets, rows)? > data.len() {
                return Err(Mismatch("offsets go too far"));
            }
            rows
        }
        Cells::List(offsets, elements) => {
            if matches!(**elements, Cells::List(..)) {
                return Err(Mismatch("a list cannot hold lists"));
            }
            check_cells(elements, last(offsets, rows)?)?;
            rows
        }
        Cells::Message(fields) => {
            check(fields, rows)?;
            rows
        }
    };
    if there < rows {
        return Err(Mismatch("a column is too short"));
    }
    Ok(())
}

/// The end of the last of `rows` rows; none of them goes backwards.
fn last(offsets: &[i32], rows: usize) -> Result<usize, Mismatch> {
    let offsets = offsets.get(..=rows).ok_or(Mismatch("offsets are missing"))?;
    if offsets[0] < 0 || offsets.windows(2).any(|pair| pair[0] > pair[1]) {
        return Err(Mismatch("offsets go backwards"));
    }
    Ok(offsets[rows] as usize)
}

fn message(out: &mut Vec<u8>, fields: &[Field<'_>], row: usize) {
    for field in fields {
        if field.valid.is_none_or(|bits| bit(bits, row)) {
            cell(out, field.number, &field.cells, row);
        }
    }
}

fn cell(out: &mut Vec<u8>, number: u32, cells: &Cells<'_>, row: usize) {
    match cells {
        Cells::Bytes(offsets, data) => {
            tag(out, number, LENGTH);
            let bytes = &data[range(offsets, row)];
            varint(out, bytes.len() as u64);
            out.extend_from_slice(bytes);
        }
        Cells::Message(fields) => {
            tag(out, number, LENGTH);
            sized(out, |out| message(out, fields, row));
        }
        Cells::List(offsets, elements) => list(out, number, elements, range(offsets, row)),
        Cells::F32(_) => {
            tag(out, number, FIXED_32);
            bare(out, cells, row);
        }
        Cells::F64(_) => {
            tag(out, number, FIXED_64);
            bare(out, cells, row);
        }
        _ => {
            tag(out, number, VARINT);
            bare(out, cells, row);
        }
    }
}

fn list(out: &mut Vec<u8>, number: u32, elements: &Cells<'_>, rows: std::ops::Range<usize>) {
    match elements {
        Cells::Bytes(..) | Cells::Message(_) | Cells::List(..) => {
            for row in rows {
                cell(out, number, elements, row);
            }
        }
        _ if rows.is_empty() => {}
        _ => {
            tag(out, number, LENGTH);
            sized(out, |out| {
                for row in rows {
                    bare(out, elements, row);
                }
            });
        }
    }
}

/// A number without its tag; the other kinds have none.
fn bare(out: &mut Vec<u8>, cells: &Cells<'_>, row: usize) {
    match cells {
        Cells::U8(v) => varint(out, u64::from(v[row])),
        Cells::U16(v) => varint(out, u64::from(v[row])),
        Cells::U32(v) => varint(out, u64::from(v[row])),
        Cells::U64(v) => varint(out, v[row]),
        Cells::I8(v) => varint(out, zigzag(i64::from(v[row]))),
        Cells::I16(v) => varint(out, zigzag(i64::from(v[row]))),
        Cells::I32(v) => varint(out, zigzag(i64::from(v[row]))),
        Cells::I64(v) => varint(out, zigzag(v[row])),
        Cells::F32(v) => out.extend_from_slice(&v[row].to_le_bytes()),
        Cells::F64(v) => out.extend_from_slice(&v[row].to_le_bytes()),
        Cells::Bool(bits) => out.push(u8::from(bit(bits, row))),
        Cells::Bytes(..) | Cells::List(..) | Cells::Message(_) => {}
    }
}

/// What `body` writes, with its length in front.
fn sized(out: &mut Vec<u8>, body: impl FnOnce(&mut Vec<u8>)) {
    let start = out.len();
    out.push(0);
    body(out);
    let length = out.len() - start - 1;
    if length < 0x80 {
        out[start] = length as u8;
        return;
    }
    let mut prefix = Vec::with_capacity(10);
    varint(&mut prefix, length as u64);
    out.splice(start..=start, prefix);
}

fn range(offsets: &[i32], row: usize) -> std::ops::Range<usize> {
    offsets[row] as usize..offsets[row + 1] as usize
}

fn bit(bits: &[u8], row: usize) -> bool {
    bits[row / 8] >> (row % 8) & 1 != 0
}

fn tag(out: &mut Vec<u8>, number: u32, wire: u32) {
    varint(out, u64::from(number << 3 | wire));
}

fn zigzag(value: i64) -> u64 {
    (value << 1 ^ value >> 63) as u64
}

fn varint(out: &mut Vec<u8>, mut value: u64) {
    while value >= 0x80 {
        out.push(value as u8 | 0x80);
        value >>= 7;
    }
    out.push(value as u8);
}
