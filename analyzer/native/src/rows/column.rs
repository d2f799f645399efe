//! Columns of Arrow tables as they come: buffers, and how to read cells out of them.

#![forbid(unsafe_code)]

use super::number::Value;

/// What a column holds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    Flag,
    Unsigned(u8),
    Signed(u8),
    Real(u8),
    Bytes,
    List,
    Struct,
    Null,
}

/// One column: `first` is the place of row 0 in its buffers, which another column may share.
///
/// `data` are values, of bytes and texts their characters; `ends` the i32 offsets of bytes and lists. A structure has a
/// child for each member, of which row 0 is row 0; a list has one, of which offsets count rows.
#[derive(Debug)]
pub struct Column {
    pub kind: Kind,
    pub len: usize,
    pub first: usize,
    pub valid: Option<Vec<u8>>,
    pub data: Vec<u8>,
    pub ends: Vec<u8>,
    pub children: Vec<Column>,
}

fn word<const N: usize>(data: &[u8], at: usize) -> [u8; N] {
    data.get(at * N..)
        .and_then(|rest| rest.first_chunk())
        .copied()
        .unwrap_or([0; N])
}

fn bit(data: &[u8], at: usize) -> bool {
    data.get(at / 8).is_some_and(|byte| byte >> (at % 8) & 1 != 0)
}

impl Column {
    /// A column of structures, one a row of a table.
    pub fn table(len: usize, children: Vec<Column>) -> Column {
        Column {
            kind: Kind::Struct,
            len,
            first: 0,
            valid: None,
            data: vec![],
            ends: vec![],
            children,
        }
    }

    /// Whether the cell has a value.
    #[inline]
    pub fn has(&self, row: usize) -> bool {
        self.kind != Kind::Null && self.valid.as_ref().is_none_or(|valid| bit(valid, self.first + row))
    }

    /// The number or flag of a cell, whatever it means if the cell has none.
    #[inline]
    pub fn value(&self, row: usize) -> Value {
        let at = self.first + row;
        match self.kind {
            Kind::Flag => Value::Flag(bit(&self.data, at)),
            Kind::Real(4) => Value::Real(f64::from(f32::from_ne_bytes(word(&self.data, at)))),
            Kind::Real(_) => Value::Real(f64::from_ne_bytes(word(&self.data, at))),
            _ => Value::Whole(self.whole(row)),
        }
    }

    /// The whole number of a cell; a flag is 1 or 0.
    #[inline]
    pub fn whole(&self, row: usize) -> i128 {
        let (data, at) = (&self.data[..], self.first + row);
        match self.kind {
            Kind::Flag => i128::from(bit(data, at)),
            Kind::Unsigned(1) => i128::from(data.get(at).copied().unwrap_or(0)),
            Kind::Unsigned(2) => i128::from(u16::from_ne_bytes(word(data, at))),
            Kind::Unsigned(4) => i128::from(u32::from_ne_bytes(word(data, at))),
            Kind::Unsigned(_) => i128::from(u64::from_ne_bytes(word(data, at))),
            Kind::Signed(1) => i128::from(i8::from_ne_bytes(word(data, at))),
            Kind::Signed(2) => i128::from(i16::from_ne_bytes(word(data, at))),
            Kind::Signed(4) => i128::from(i32::from_ne_bytes(word(data, at))),
            Kind::Signed(_) => i128::from(i64::from_ne_bytes(word(data, at))),
            Kind::Real(_) | Kind::Bytes | Kind::List | Kind::Struct | Kind::Null => 0,
        }
    }

    fn end(&self, at: usize) -> usize {
        usize::try_from(i32::from_ne_bytes(word(&self.ends, at))).unwrap_or(0)
    }

    /// Where the elements of a list, or the bytes of a text, are.
    #[inline]
    pub fn span(&self, row: usize) -> std::ops::Range<usize> {
        let start = self.end(self.first + row);
        start..self.end(self.first + row + 1).max(start)
    }

    /// The bytes of a cell.
    #[inline]
    pub fn bytes(&self, row: usize) -> &[u8] {
        self.data.get(self.span(row)).unwrap_or_default()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cells_of_a_slice() {
        let numbers = Column {
            kind: Kind::Signed(2),
            len: 2,
            first: 1,
            valid: Some(vec![0b101]),
            data: [1_i16, -2, 3].iter().flat_map(|n| n.to_ne_bytes()).collect(),
            ends: vec![],
            children: vec![],
        };
        assert_eq!([numbers.has(0), numbers.has(1)], [false, true]);
        assert_eq!([numbers.whole(0), numbers.whole(1), numbers.whole(9)], [-2, 3, 0]);
        let texts = Column {
            kind: Kind::Bytes,
            len: 1,
            first: 1,
            valid: None,
            data: b"abcd".to_vec(),
            ends: [0_i32, 1, 3].iter().flat_map(|n| n.to_ne_bytes()).collect(),
            children: vec![],
        };
        assert_eq!(texts.bytes(0), b"bc");
        assert!(texts.bytes(7).is_empty());
    }
}
