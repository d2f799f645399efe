//! Python's format specifications for numbers, as far as templates use them.

#![forbid(unsafe_code)]

use std::fmt::Write;

use super::number::{general, unbounded, whole, Text, Value};

/// How a number is written: sign, zeros, width, alignment, decimals and kind, as in `{value:+08.1f}`.
#[derive(Clone, Debug)]
pub struct Spec {
    pub align: u8, // < > ^
    pub sign: u8,  // - + or a blank
    pub zeros: bool,
    pub width: usize,
    pub precision: Option<usize>,
    pub kind: u8, // d x X e f g
}

impl Spec {
    /// Writes a number; what is not finite is written by its name, and without the format.
    pub fn write(&self, out: &mut Vec<u8>, value: Value) {
        let start = out.len();
        match (self.kind, value) {
            (_, Value::Flag(flag)) => out.extend_from_slice(if flag { b"yes" } else { b"no" }),
            (_, Value::Real(value)) if !value.is_finite() => {
                unbounded(out, value);
            }
            (b'd' | b'x' | b'X', Value::Real(value)) => self.whole(out, value as i128),
            (b'd' | b'x' | b'X', Value::Whole(value)) => self.whole(out, value),
            (_, Value::Whole(_)) => self.real(out, value.real()),
            (_, Value::Real(value)) => self.real(out, value),
        }
        if matches!(value, Value::Whole(_)) || matches!(value, Value::Real(value) if value.is_finite()) {
            self.pad(out, start);
        }
    }

    fn whole(&self, out: &mut Vec<u8>, value: i128) {
        self.sign(out, value < 0);
        let value = value.unsigned_abs();
        let _ = match self.kind {
            b'x' => write!(Text(out), "{value:x}"),
            b'X' => write!(Text(out), "{value:X}"),
            _ => return whole(out, value as i128),
        };
    }

    fn real(&self, out: &mut Vec<u8>, value: f64) {
        self.sign(out, value.is_sign_negative());
        let (value, precision) = (value.abs(), self.precision.unwrap_or(6));
        match self.kind {
            b'f' => {
                let _ = write!(Text(out), "{value:.precision$}");
            }
            b'e' => {
                let text = format!("{value:.precision$e}");
                let (digits, power) = text.split_once('e').unwrap_or((&text, "0"));
                let power: i32 = power.parse().unwrap_or(0);
                let _ = write!(
                    Text(out),
                    "{digits}e{}{:02}",
                    if power < 0 { '-' } else { '+' },
                    power.abs()
                );
            }
            _ => general(out, value, precision),
        }
    }

    fn sign(&self, out: &mut Vec<u8>, negative: bool) {
        if negative {
            out.push(b'-');
        } else if self.sign != b'-' {
            out.push(self.sign);
        }
    }

    fn pad(&self, out: &mut Vec<u8>, start: usize) {
        let missing = self.width.saturating_sub(out.len() - start);
        if missing == 0 {
            return;
        }
        let (fill, left) = match self.align {
            0 if self.zeros => {
                let signed = usize::from(!out[start].is_ascii_hexdigit());
                let digits = out.split_off(start + signed);
                out.extend(std::iter::repeat_n(b'0', missing));
                out.extend(digits);
                return;
            }
            b'<' => (self.fill(), 0),
            b'^' => (self.fill(), missing / 2),
            _ => (self.fill(), missing),
        };
        out.splice(start..start, std::iter::repeat_n(fill, left));
        out.extend(std::iter::repeat_n(fill, missing - left));
    }

    fn fill(&self) -> u8 {
        if self.zeros {
            b'0'
        } else {
            b' '
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn shown(kind: u8, width: usize, precision: Option<usize>, zeros: bool, sign: u8, value: Value) -> String {
        let spec = Spec {
            align: 0,
            sign,
            zeros,
            width,
            precision,
            kind,
        };
        let mut out = b"|".to_vec();
        spec.write(&mut out, value);
        String::from_utf8(out[1..].to_vec()).expect("digits")
    }

    #[test]
    fn as_python_formats() {
        let real = Value::Real;
        assert_eq!(shown(b'X', 8, None, true, b'-', Value::Whole(0xBEEF)), "0000BEEF");
        assert_eq!(shown(b'x', 6, None, true, b'-', Value::Whole(-255)), "-000ff");
        assert_eq!(shown(b'd', 6, None, false, b'+', Value::Whole(42)), "   +42");
        assert_eq!(shown(b'd', 0, None, false, b'-', real(-3.9)), "-3");
        assert_eq!(shown(b'f', 0, Some(1), false, b'-', real(0.25)), "0.2");
        assert_eq!(shown(b'f', 0, Some(0), false, b'-', real(2.5)), "2");
        assert_eq!(shown(b'f', 0, Some(1), false, b'-', real(-0.04)), "-0.0");
        assert_eq!(shown(b'f', 0, None, false, b'-', Value::Whole(5)), "5.000000");
        assert_eq!(shown(b'e', 0, Some(2), false, b'-', real(12345.0)), "1.23e+04");
        assert_eq!(shown(b'g', 0, None, false, b'-', real(0.1)), "0.1");
        assert_eq!(shown(b'f', 9, Some(1), true, b'-', real(f64::INFINITY)), "Infinity");
    }
}
