//! Cells of a column as numbers, and numbers as cells: a column at a time.
#![forbid(unsafe_code)]

use crate::plan::{Form, Kind, Node};
use crate::unpack::column::{Bitmap, Column, Data};

/// A raw value times `times`, divided by `by`, plus `plus`: in this order, so that hundredths come out as the nearest
/// float.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Linear {
    pub times: f64,
    pub by: f64,
    pub plus: f64,
}

impl Linear {
    #[inline]
    pub fn of(&self, raw: f64) -> f64 {
        let value = raw * self.times / self.by;
        // Nothing is added rather than 0: a negative zero stays one.
        if self.plus == 0.0 {
            value
        } else {
            value + self.plus
        }
    }
}

/// One cell.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Number {
    Whole(i128),
    Real(f64),
}

impl Number {
    #[allow(clippy::cast_precision_loss)] // the nearest float is what is asked for
    pub fn float(self) -> f64 {
        match self {
            Number::Whole(value) => value as f64,
            Number::Real(value) => value,
        }
    }
}

#[inline]
fn each<const W: usize, const O: usize>(values: &[u8], cell: impl Fn([u8; W]) -> [u8; O]) -> Vec<u8> {
    let cells = values.as_chunks::<W>().0;
    cells
        .iter()
        .map(|from| cell(*from))
        .collect::<Vec<_>>()
        .into_flattened()
}

/// Whole cells, with zeros above.
#[inline]
pub fn word<const W: usize>(cell: [u8; W]) -> u64 {
    let mut bytes = [0; 8];
    bytes[..W].copy_from_slice(&cell);
    u64::from_le_bytes(bytes)
}

/// f64 cells of what `of` makes of the numbers of a column; none for a column without numbers.
pub fn floats(node: &Node, data: &Data, of: impl Fn(f64) -> f64) -> Option<Vec<u8>> {
    cells(node, data, |raw| of(raw).to_le_bytes())
}

/// Cells of what `of` makes of the numbers of a column; none for a column without numbers.
#[allow(clippy::cast_precision_loss)] // the nearest float is what is asked for
pub fn cells<const O: usize>(node: &Node, data: &Data, of: impl Fn(f64) -> [u8; O]) -> Option<Vec<u8>> {
    Some(match (&node.kind, data) {
        (Kind::Bool, Data::Bool(bits)) => {
            let cell = |at| of(f64::from(u8::from(bits.get(at))));
            (0..bits.len()).flat_map(cell).collect()
        }
        (Kind::Scalar { form, .. }, Data::Scalar { width, values }) => match (form, width) {
            (Form::Uint, 1) => each(values, |c: [u8; 1]| of(c[0].into())),
            (Form::Uint, 2) => each(values, |c| of(u16::from_le_bytes(c).into())),
            (Form::Uint, 4) => each(values, |c| of(u32::from_le_bytes(c).into())),
            (Form::Uint, _) => each(values, |c| of(u64::from_le_bytes(c) as f64)),
            (Form::Int, 1) => each(values, |c| of(i8::from_le_bytes(c).into())),
            (Form::Int, 2) => each(values, |c| of(i16::from_le_bytes(c).into())),
            (Form::Int, 4) => each(values, |c| of(i32::from_le_bytes(c).into())),
            (Form::Int, _) => each(values, |c| of(i64::from_le_bytes(c) as f64)),
            (Form::Float, 4) => each(values, |c| of(f32::from_le_bytes(c).into())),
            (Form::Float, _) => each(values, |c| of(f64::from_le_bytes(c))),
        },
        _ => return None,
    })
}

/// The number of one row, whether it is valid or not.
pub fn number(node: &Node, data: &Data, row: usize) -> Option<Number> {
    match (&node.kind, data) {
        (Kind::Bool, Data::Bool(bits)) => Some(Number::Whole(bits.get(row).into())),
        (Kind::Scalar { form, .. }, Data::Scalar { width, values }) => {
            let mut bytes = [0; 8];
            let cell = values.get(row * width..(row + 1) * width)?;
            bytes[..*width].copy_from_slice(cell);
            let raw = u64::from_le_bytes(bytes);
            let above = 64 - 8 * *width as u32;
            Some(match (form, width) {
                (Form::Uint, _) => Number::Whole(raw.into()),
                (Form::Int, _) => Number::Whole(((raw << above) as i64 >> above).into()),
                (Form::Float, 4) => Number::Real(f32::from_bits(raw as u32).into()),
                (Form::Float, _) => Number::Real(f64::from_bits(raw)),
            })
        }
        _ => None,
    }
}

/// Bits `low` to `low + width - 1` of unsigned words, in the smallest cells that hold them: the size of these, and them.
pub fn slices(data: &Data, low: u32, width: u32) -> (usize, Vec<u8>) {
    fn of<const W: usize>(values: &[u8], low: u32, width: u32) -> (usize, Vec<u8>) {
        let mask = u64::MAX >> (64 - width.clamp(1, 64));
        let cut = |cell: [u8; W]| word(cell) >> low & mask;
        match Node::unsigned(width).width() {
            1 => (1, each(values, |cell| [cut(cell) as u8])),
            2 => (2, each(values, |cell| (cut(cell) as u16).to_le_bytes())),
            4 => (4, each(values, |cell| (cut(cell) as u32).to_le_bytes())),
            _ => (8, each(values, |cell| cut(cell).to_le_bytes())),
        }
    }
    match data {
        Data::Scalar { width: 1, values } => of::<1>(values, low, width),
        Data::Scalar { width: 2, values } => of::<2>(values, low, width),
        Data::Scalar { width: 4, values } => of::<4>(values, low, width),
        Data::Scalar { values, .. } => of::<8>(values, low, width),
        _ => (1, vec![]),
    }
}

/// Bit `at` of words.
pub fn flags(data: &Data, at: u32) -> Bitmap {
    fn of<const W: usize>(values: &[u8], at: u32) -> Bitmap {
        Bitmap::map(values.as_chunks::<W>().0, |cell| word(*cell) >> at & 1 != 0)
    }
    match data {
        Data::Scalar { width: 1, values } => of::<1>(values, at),
        Data::Scalar { width: 2, values } => of::<2>(values, at),
        Data::Scalar { width: 4, values } => of::<4>(values, at),
        Data::Scalar { values, .. } => of::<8>(values, at),
        _ => Bitmap::default(),
    }
}

/// The cells that hold one of some raw values (two's complement); none if no cell does.
pub fn holds(data: &Data, raw: &[u64]) -> Option<Bitmap> {
    fn of<const W: usize>(values: &[u8], raw: &[u64]) -> Option<Bitmap> {
        let mask = u64::MAX >> (64 - 8 * W);
        let raw: Vec<u64> = raw.iter().map(|value| value & mask).collect();
        let cells = values.as_chunks::<W>().0;
        let any = |found: bool, cell: &[u8; W]| found | raw.iter().fold(false, |any, &one| any | (one == word(*cell)));
        let found = cells.chunks(256).any(|some| some.iter().fold(false, any));
        found.then(|| Bitmap::map(cells, |cell| raw.contains(&word(*cell))))
    }
    match data {
        _ if raw.is_empty() => None,
        Data::Scalar { width: 1, values } => of::<1>(values, raw),
        Data::Scalar { width: 2, values } => of::<2>(values, raw),
        Data::Scalar { width: 4, values } => of::<4>(values, raw),
        Data::Scalar { values, .. } => of::<8>(values, raw),
        _ => None,
    }
}

/// The cells below `low` or above `high`; none if no cell is.
pub fn outside(node: &Node, data: &Data, low: f64, high: f64) -> Option<Bitmap> {
    // Not `contains`: what is no number is not outside.
    let found = cells(node, data, |raw| [u8::from(raw < low) | u8::from(raw > high)])?;
    found.contains(&1).then(|| Bitmap::map(&found, |&cell| cell != 0))
}

/// A column of f64 cells.
pub fn reals(values: Vec<u8>, validity: Option<Bitmap>) -> Column {
    Column::filled(values.len() / 8, validity, Data::Scalar { width: 8, values })
}

/// The bits of cells that are valid, and not among those `without`.
pub fn valid_without(column: &Column, without: &[Option<Bitmap>]) -> Option<Bitmap> {
    if without.iter().all(Option::is_none) {
        return column.validity().cloned();
    }
    let gone = |row| without.iter().flatten().any(|gone| gone.get(row));
    Some(Bitmap::of(column.len(), |row| column.is_valid(row) && !gone(row)))
}
