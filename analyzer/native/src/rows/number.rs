//! Numbers as Python writes them, digit for digit: `repr`, and its formats `d x X e f g`.

#![forbid(unsafe_code)]

use std::fmt::{self, Write};

/// Takes what Rust formats; nothing ever fails.
pub(super) struct Text<'a>(pub &'a mut Vec<u8>);

impl Write for Text<'_> {
    fn write_str(&mut self, text: &str) -> fmt::Result {
        self.0.extend_from_slice(text.as_bytes());
        Ok(())
    }
}

/// A value of a cell.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Value {
    Flag(bool),
    Whole(i128),
    Real(f64),
}

impl Value {
    /// The nearest number with a point.
    #[allow(clippy::cast_precision_loss)] // as Python's `float` rounds
    pub fn real(self) -> f64 {
        match self {
            Value::Flag(flag) => f64::from(u8::from(flag)),
            Value::Whole(whole) => whole as f64,
            Value::Real(real) => real,
        }
    }
}

const PAIRS: &[u8; 200] = b"0001020304050607080910111213141516171819\
2021222324252627282930313233343536373839\
4041424344454647484950515253545556575859\
6061626364656667686970717273747576777879\
8081828384858687888990919293949596979899";

/// Writes a whole number.
pub fn whole(out: &mut Vec<u8>, value: i128) {
    let Ok(mut rest) = u64::try_from(value.unsigned_abs()) else {
        let _ = write!(Text(out), "{value}");
        return;
    };
    if value < 0 {
        out.push(b'-');
    }
    let mut digits = [0; 20];
    let mut at = digits.len();
    while rest >= 100 {
        let pair = (rest % 100) as usize * 2;
        rest /= 100;
        at -= 2;
        digits[at..at + 2].copy_from_slice(&PAIRS[pair..pair + 2]);
    }
    if rest >= 10 {
        let pair = rest as usize * 2;
        at -= 2;
        digits[at..at + 2].copy_from_slice(&PAIRS[pair..pair + 2]);
    } else {
        at -= 1;
        digits[at] = b'0' + rest as u8;
    }
    out.extend_from_slice(&digits[at..]);
}

/// Writes what is not finite by its name in JSON; false for a number.
pub fn unbounded(out: &mut Vec<u8>, value: f64) -> bool {
    let name: &[u8] = match value {
        _ if value.is_finite() => return false,
        _ if value.is_nan() => b"NaN",
        _ if value > 0.0 => b"Infinity",
        _ => b"-Infinity",
    };
    out.extend_from_slice(name);
    true
}

/// The digits of a number in scientific notation: its sign is written, its digits and its exponent are returned.
fn scientific(out: &mut Vec<u8>, text: &str) -> (Vec<u8>, i32) {
    let (sign, text) = text.strip_prefix('-').map_or((false, text), |rest| (true, rest));
    if sign {
        out.push(b'-');
    }
    let (digits, exponent) = text.split_once('e').unwrap_or((text, "0"));
    let digits = digits.bytes().filter(|&digit| digit != b'.').collect();
    (digits, exponent.parse().unwrap_or(0))
}

fn exponent(out: &mut Vec<u8>, digits: &[u8], exponent: i32) {
    out.push(digits[0]);
    if digits.len() > 1 {
        out.push(b'.');
        out.extend_from_slice(&digits[1..]);
    }
    let _ = write!(
        Text(out),
        "e{}{:02}",
        if exponent < 0 { '-' } else { '+' },
        exponent.abs()
    );
}

/// Writes digits with a point behind the first `before` of them.
fn fixed(out: &mut Vec<u8>, digits: &[u8], before: i32) {
    match usize::try_from(before) {
        Err(_) | Ok(0) => {
            out.extend_from_slice(b"0.");
            out.extend(std::iter::repeat_n(b'0', before.unsigned_abs() as usize));
            out.extend_from_slice(digits);
        }
        Ok(before) => {
            out.extend(digits.iter().chain(std::iter::repeat(&b'0')).take(before));
            if digits.len() > before {
                out.push(b'.');
                out.extend_from_slice(&digits[before..]);
            }
        }
    }
}

const TENTHS: f64 = 1e4;
/// Two decimals of so many digits are never the same number, unless it is subnormal.
const UNIQUE: usize = 15;

/// The shortest digits that read back as the same number; of several as short as that the nearest, an even one of two.
fn shortest(value: f64) -> String {
    let text = format!("{value:e}");
    let digits = text
        .bytes()
        .take_while(|&c| c != b'e')
        .filter(u8::is_ascii_digit)
        .count();
    if digits > UNIQUE || value.abs() < f64::MIN_POSITIVE {
        let near = format!("{value:.*e}", digits - 1);
        if near.parse() == Ok(value) {
            return near;
        }
    }
    text
}

/// Writes the shortest digits that read back as the same number, as Python's `repr` does; finite numbers only.
pub fn repr(out: &mut Vec<u8>, value: f64) {
    // A decimal of at most 15 digits that is this number is the shortest there is.
    let moved = value * TENTHS;
    if moved.abs() < 1e15 && moved != 0.0 {
        let near = moved.round_ties_even();
        #[allow(clippy::float_cmp)] // the same number, and no other
        if near / TENTHS == value {
            decimal(out, near as i64);
            return;
        }
    }
    let (digits, at) = scientific(out, &shortest(value));
    if !(-4..16).contains(&at) {
        exponent(out, &digits, at);
        return;
    }
    fixed(out, &digits, at + 1);
    if digits.len() as i32 <= at + 1 {
        out.extend_from_slice(b".0");
    }
}

/// Writes ten-thousandths without the zeros at their end.
fn decimal(out: &mut Vec<u8>, value: i64) {
    if value < 0 {
        out.push(b'-');
    }
    let (before, mut behind) = (value.unsigned_abs() / 10_000, value.unsigned_abs() % 10_000);
    whole(out, i128::from(before));
    out.push(b'.');
    let mut places = 4;
    while places > 1 && behind.is_multiple_of(10) {
        behind /= 10;
        places -= 1;
    }
    for place in (0..places).rev() {
        out.push(b'0' + (behind / 10_u64.pow(place) % 10) as u8);
    }
}

/// Writes a finite number with so many significant digits, without the zeros at its end, as `%.*g` does.
pub fn general(out: &mut Vec<u8>, value: f64, precision: usize) {
    let precision = precision.max(1);
    let text = format!("{value:.*e}", precision - 1);
    let (mut digits, at) = scientific(out, &text);
    while digits.len() > 1 && digits.last() == Some(&b'0') {
        digits.pop();
    }
    if at < -4 || at >= precision as i32 {
        exponent(out, &digits, at);
    } else {
        fixed(out, &digits, at + 1);
    }
}

/// Writes a number without a format, for people: whole ones without a point, others with up to 7 digits.
pub fn plain(out: &mut Vec<u8>, value: f64) {
    if unbounded(out, value) {
        return;
    }
    if value != 0.0 && value.fract() == 0.0 && value.abs() < 1e15 {
        whole(out, value as i128); // not zero: its sign is worth seeing
    } else {
        general(out, value, 7);
    }
}

/// Writes nanoseconds as seconds, cut to 9 decimals or to 6.
pub fn seconds(out: &mut Vec<u8>, ns: i64, signed: bool, nine: bool) {
    if ns < 0 || signed {
        out.push(if ns < 0 { b'-' } else { b'+' });
    }
    let ns = ns.unsigned_abs();
    whole(out, i128::from(ns / 1_000_000_000));
    out.push(b'.');
    decimals(out, ns % 1_000_000_000, nine);
}

/// Writes the nanoseconds of a second, as 9 digits or the first 6 of them.
pub fn decimals(out: &mut Vec<u8>, ns: u64, nine: bool) {
    let (mut rest, places) = if nine { (ns, 9) } else { (ns / 1000, 6) };
    let start = out.len();
    out.resize(start + places, b'0');
    for place in out[start..].iter_mut().rev() {
        *place = b'0' + (rest % 10) as u8;
        rest /= 10;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn text(write: impl FnOnce(&mut Vec<u8>)) -> String {
        let mut out = vec![];
        write(&mut out);
        String::from_utf8(out).expect("digits")
    }

    #[test]
    fn shortest_digits_as_python_writes_them() {
        for (value, shown) in [
            (0.0, "0.0"),
            (-0.0, "-0.0"),
            (1.0, "1.0"),
            (-23.5, "-23.5"),
            (22.2, "22.2"),
            (0.1 + 0.2, "0.30000000000000004"),
            (f64::from(22.2_f32), "22.200000762939453"),
            (1e15, "1000000000000000.0"),
            (1e16, "1e+16"),
            (1.5e16, "1.5e+16"),
            (1e-4, "0.0001"),
            (1.25e-5, "1.25e-05"),
            (5e-324, "5e-324"),
            (f64::MAX, "1.7976931348623157e+308"),
            (123_456_789_012.345_67, "123456789012.34567"),
            (9_007_199_254_740_993.0, "9007199254740992.0"),
            (562_949_953_421_312.2, "562949953421312.2"),
            (562_949_953_421_312.8, "562949953421312.8"),
        ] {
            assert_eq!(text(|out| repr(out, value)), shown);
        }
    }

    #[test]
    fn seven_digits_for_people() {
        for (value, shown) in [
            (0.0, "0"),
            (-0.0, "-0"),
            (40.0, "40"),
            (1e15, "1e+15"),
            (0.1, "0.1"),
            (123_456.78, "123456.8"),
            (1.25e-5, "1.25e-05"),
            (9_999_999.6, "1e+07"),
            (f64::NAN, "NaN"),
            (f64::NEG_INFINITY, "-Infinity"),
        ] {
            assert_eq!(text(|out| plain(out, value)), shown);
        }
    }

    #[test]
    fn times_are_cut() {
        assert_eq!(text(|out| seconds(out, 1_999_999_999, false, false)), "1.999999");
        assert_eq!(text(|out| seconds(out, -1, true, true)), "-0.000000001");
        assert_eq!(text(|out| seconds(out, 0, true, false)), "+0.000000");
    }

    #[test]
    fn whole_numbers_of_any_size() {
        for value in [0, 7, 10, 99, 100, -1, -12345, i128::from(u64::MAX), i128::MIN] {
            assert_eq!(text(|out| whole(out, value)), value.to_string());
        }
    }
}
