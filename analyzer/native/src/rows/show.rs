//! Numbers of cells: which one is taken, and how it is written.

#![forbid(unsafe_code)]

use super::column::Column;
use super::number::{self, Value};
use super::spec::Spec;

/// Which number is taken from a cell: the value of the table; undone, what was multiplied by a scale; of that some bits;
/// these times another scale.
#[derive(Debug, Default)]
pub struct Take {
    /// Numerator and denominator of the scale of the table, and whether a whole number was scaled.
    pub unscaled: Option<(f64, f64, bool)>,
    /// The lowest of how many bits.
    pub bits: Option<(u32, u32)>,
    pub scaled: Option<(f64, f64)>,
    /// Whether it is a flag.
    pub flag: bool,
}

impl Take {
    pub fn value(&self, column: &Column, row: usize) -> Value {
        let mut value = column.value(row);
        if let (Some((numerator, denominator, whole)), Value::Real(real)) = (self.unscaled, value) {
            let raw = real * denominator / numerator;
            value = match raw.is_finite() {
                false => Value::Real(real),
                true if whole => Value::Whole(raw.round_ties_even() as i128),
                true => Value::Real(raw),
            };
        }
        if let (Some((low, width)), Value::Whole(word)) = (self.bits, value) {
            value = Value::Whole(word >> low & ((1 << width) - 1));
        }
        if let (Some((numerator, denominator)), Value::Whole(_)) = (self.scaled, value) {
            value = Value::Real(value.real() * numerator / denominator);
        }
        if let (true, Value::Whole(raw)) = (self.flag, value) {
            value = Value::Flag(raw != 0);
        }
        value
    }
}

/// How a number is written.
#[derive(Debug)]
pub enum Show {
    /// As JSON does, but for the names of flags; what is not finite is a name, `quoted` as JSON needs it.
    Json {
        no: Vec<u8>,
        yes: Vec<u8>,
        quoted: bool,
    },
    /// For people.
    Plain,
    Format(Spec),
    /// Nanoseconds as seconds, with a sign if `signed`, with 9 decimals or 6.
    Seconds {
        signed: bool,
        nine: bool,
    },
    /// The nanoseconds of a second, as 9 digits or 6.
    Decimals {
        nine: bool,
    },
    /// Counted from one, not from zero.
    FromOne,
}

impl Show {
    pub fn write(&self, out: &mut Vec<u8>, value: Value) {
        match (self, value) {
            (Show::Format(spec), _) => spec.write(out, value),
            (Show::Json { no, yes, .. }, Value::Flag(flag)) => out.extend_from_slice(if flag { yes } else { no }),
            (Show::Json { quoted, .. }, Value::Real(real)) if !real.is_finite() => {
                out.extend_from_slice(if *quoted { b"\"" } else { b"" });
                number::unbounded(out, real);
                out.extend_from_slice(if *quoted { b"\"" } else { b"" });
            }
            (Show::Json { .. }, Value::Real(real)) => number::repr(out, real),
            (Show::FromOne, Value::Whole(whole)) => number::whole(out, whole + 1),
            (Show::Seconds { signed, nine }, Value::Whole(ns)) => number::seconds(out, ns as i64, *signed, *nine),
            (Show::Decimals { nine }, Value::Whole(ns)) => number::decimals(out, ns as u64, *nine),
            (_, Value::Flag(flag)) => out.extend_from_slice(if flag { b"yes" } else { b"no" }),
            (_, Value::Real(real)) => number::plain(out, real),
            (_, Value::Whole(whole)) => number::whole(out, whole),
        }
    }
}
