//! Decimal numbers without floats: identifiers stay exact, and so do time stamps with 9 digits of fraction.
#![forbid(unsafe_code)]

/// Digits that are kept; those of a fraction beyond are cut.
const MAX_DIGITS: u32 = 30;
/// A larger exponent is out of every range.
const MAX_EXPONENT: i32 = 9_999;

/// `mantissa * 10^exponent`
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Decimal {
    mantissa: i128,
    exponent: i32,
}

impl From<i128> for Decimal {
    fn from(mantissa: i128) -> Self {
        Decimal { mantissa, exponent: 0 }
    }
}

impl Decimal {
    /// The number in front of `text`, by the grammar of JSON, and how many bytes it takes.
    pub fn read(text: &[u8]) -> Option<(Decimal, usize)> {
        let negative = text.first() == Some(&b'-');
        let mut at = usize::from(negative);
        let (mut digits, mut value) = (0_u32, Decimal::from(0));
        let start = at;
        while let Some(digit) = digit(text, at) {
            digits += u32::from(digits > 0 || digit > 0);
            if digits > MAX_DIGITS {
                value.exponent = (value.exponent + 1).min(MAX_EXPONENT);
            } else {
                value.mantissa = value.mantissa * 10 + i128::from(digit);
            }
            at += 1;
        }
        if at == start || (at > start + 1 && text[start] == b'0') {
            return None;
        }
        if text.get(at) == Some(&b'.') {
            at += 1;
            let start = at;
            while let Some(digit) = digit(text, at) {
                if digits < MAX_DIGITS {
                    digits += u32::from(digits > 0 || digit > 0);
                    value.mantissa = value.mantissa * 10 + i128::from(digit);
                    value.exponent = (value.exponent - 1).max(-MAX_EXPONENT);
                }
                at += 1;
            }
            if at == start {
                return None;
            }
        }
        if let Some(b'e' | b'E') = text.get(at) {
            at += 1;
            let down = text.get(at) == Some(&b'-');
            at += usize::from(matches!(text.get(at), Some(b'-' | b'+')));
            let (start, mut exponent) = (at, 0_i32);
            while let Some(digit) = digit(text, at) {
                exponent = (exponent * 10 + i32::from(digit)).min(MAX_EXPONENT);
                at += 1;
            }
            if at == start {
                return None;
            }
            value.exponent += if down { -exponent } else { exponent };
        }
        if negative {
            value.mantissa = -value.mantissa;
        }
        Some((value, at))
    }

    /// The value if it is an integer of 64 bits.
    pub fn integer(self) -> Option<i64> {
        if self.exponent == 0 {
            return i64::try_from(self.mantissa).ok();
        }
        let value = self.scaled(0)?;
        let exact =
            self.exponent > 0 || Decimal::from(i128::from(value)).times_ten(-self.exponent) == Some(self.mantissa);
        exact.then_some(value)
    }

    /// The value times ten to the `digits`, cut to an integer of 64 bits.
    pub fn scaled(self, digits: i32) -> Option<i64> {
        let exponent = self.exponent + digits;
        let value = if exponent >= 0 {
            self.times_ten(exponent)?
        } else {
            let by = 10_i128.checked_pow(exponent.unsigned_abs());
            by.map_or(0, |by| self.mantissa / by)
        };
        i64::try_from(value).ok()
    }

    fn times_ten(self, exponent: i32) -> Option<i128> {
        if self.mantissa == 0 {
            return Some(0);
        }
        self.mantissa.checked_mul(10_i128.checked_pow(exponent.unsigned_abs())?)
    }
}

fn digit(text: &[u8], at: usize) -> Option<u8> {
    text.get(at).filter(|b| b.is_ascii_digit()).map(|b| b - b'0')
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(text: &str) -> Option<Decimal> {
        let (value, used) = Decimal::read(text.as_bytes())?;
        assert_eq!(used, text.len(), "{text}");
        Some(value)
    }

    #[test]
    fn integers_are_exact_or_nothing() {
        for (text, value) in [
            ("0", Some(0)),
            ("-0", Some(0)),
            ("84149761", Some(84_149_761)),
            ("-12", Some(-12)),
            ("9223372036854775807", Some(i64::MAX)),
            ("9223372036854775808", None),
            ("1.5e1", Some(15)),
            ("1.50", None),
            ("12.000", Some(12)),
            ("3e2", Some(300)),
            ("300e-2", Some(3)),
            ("301e-2", None),
            ("1e400", None),
            ("0e400", Some(0)),
            ("1e-400", None),
            ("0.0000000000000000000000000000000000000001", None),
            ("100000000000000000000000000000000000000000", None),
            ("10000000000000000000000000000000000000000e-40", Some(1)),
        ] {
            assert_eq!(read(text).unwrap().integer(), value, "{text}");
        }
    }

    #[test]
    fn seconds_become_nanoseconds_without_a_float() {
        for (text, ns) in [
            ("1700000000.123456789", Some(1_700_000_000_123_456_789)),
            (
                "1700000000.1234567899999999999999999999999999",
                Some(1_700_000_000_123_456_789),
            ),
            ("1.7e9", Some(1_700_000_000_000_000_000)),
            ("1E-9", Some(1)),
            ("1E-10", Some(0)),
            ("9223372036.854775807", Some(i64::MAX)),
            ("9223372036.854775808", None),
        ] {
            assert_eq!(read(text).unwrap().scaled(9), ns, "{text}");
        }
    }

    #[test]
    fn the_grammar_is_that_of_json() {
        for wrong in ["", "-", "+1", "01", ".5", "1.", "1e", "1e+", "x", "-x"] {
            assert_eq!(Decimal::read(wrong.as_bytes()), None, "{wrong}");
        }
        assert_eq!(Decimal::read(b"12,").map(|(_, used)| used), Some(2));
    }
}
