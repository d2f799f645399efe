//! Time stamps: the text between the brackets becomes integer nanoseconds, never by way of a float.
#![forbid(unsafe_code)]

const SECOND: i64 = 1_000_000_000;
/// Console stamps below this are counted from a start or from the line before: no clock was set to 1973.
const RELATIVE_BELOW: i64 = 100_000_000 * SECOND;
const OUT_OF_RANGE: &str = "time stamp out of range";

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// `1436509052.249713`
    Seconds,
    /// `2020-12-19 12:04:45.485261`: wall clock of a zone that the capture does not name, kept as if UTC.
    Date,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Stamp {
    pub ns: i64,
    pub kind: Kind,
    /// Digits of the fraction, 1 to 9.
    pub digits: usize,
}

impl Stamp {
    /// Reads the text between the brackets.
    ///
    /// # Errors
    /// What is wrong with it, or that its nanoseconds do not fit 64 bits.
    pub fn read(text: &[u8]) -> Result<Stamp, &'static str> {
        let dot = text
            .iter()
            .position(|&b| b == b'.')
            .ok_or("time stamp without a fraction")?;
        let (whole, fraction) = (&text[..dot], &text[dot + 1..]);
        if fraction.len() > 9 {
            return Err("time stamp with more than 9 digits of fraction");
        }
        let (seconds, kind) = match whole {
            [_, _, _, _, b'-', ..] => (date_seconds(whole)?, Kind::Date),
            _ => (number(whole)?, Kind::Seconds),
        };
        let scale = 10_i64.pow(9 - fraction.len() as u32);
        let ns = seconds
            .checked_mul(SECOND)
            .and_then(|ns| ns.checked_add(number(fraction).ok()? * scale));
        number(fraction)?;
        Ok(Stamp {
            ns: ns.ok_or(OUT_OF_RANGE)?,
            kind,
            digits: fraction.len(),
        })
    }

    /// Too small for a clock: seconds since the first line, or since the line before.
    pub fn is_relative(&self) -> bool {
        self.kind == Kind::Seconds && self.ns < RELATIVE_BELOW
    }
}

/// Which kinds of time stamps a capture holds: a set of the constants below.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Stamps(u8);

impl Stamps {
    pub const ABSOLUTE: Stamps = Stamps(1);
    /// Absolute, written as a date in an unnamed time zone.
    pub const DATE: Stamps = Stamps(2);
    /// Counted from the first frame.
    pub const ZERO: Stamps = Stamps(4);
    /// Differences to the line before; the `t` column holds their running sum.
    pub const DELTA: Stamps = Stamps(8);
    /// At least one frame or error frame without a time.
    pub const NONE: Stamps = Stamps(16);
    /// Fractions of 6 digits or fewer.
    pub const MICROSECONDS: Stamps = Stamps(32);
    /// Fractions of 7 to 9 digits.
    pub const NANOSECONDS: Stamps = Stamps(64);

    pub fn contains(self, other: Stamps) -> bool {
        self.0 & other.0 == other.0
    }

    pub fn insert(&mut self, other: Stamps) {
        self.0 |= other.0;
    }

    pub fn bits(self) -> u8 {
        self.0
    }

    pub fn from_bits(bits: u8) -> Stamps {
        Stamps(bits)
    }

    /// The set that says how finely `digits` digits of a fraction resolve time.
    pub fn resolution(digits: usize) -> Stamps {
        if digits > 6 {
            Stamps::NANOSECONDS
        } else {
            Stamps::MICROSECONDS
        }
    }
}

fn number(text: &[u8]) -> Result<i64, &'static str> {
    if text.is_empty() || !text.iter().all(u8::is_ascii_digit) {
        return Err("time stamp is not a number");
    }
    text.iter()
        .try_fold(0_i64, |value, b| {
            value.checked_mul(10)?.checked_add(i64::from(b - b'0'))
        })
        .ok_or(OUT_OF_RANGE)
}

/// `YYYY-MM-DD HH:MM:SS` to seconds since 1970 in the proleptic Gregorian calendar.
fn date_seconds(text: &[u8]) -> Result<i64, &'static str> {
    let [_, _, _, _, b'-', _, _, b'-', _, _, b' ', _, _, b':', _, _, b':', _, _] = text else {
        return Err("date is not YYYY-MM-DD HH:MM:SS");
    };
    let part = |from: usize, to: usize| number(&text[from..to]);
    let (year, month, day) = (part(0, 4)?, part(5, 7)?, part(8, 10)?);
    let (hour, minute, second) = (part(11, 13)?, part(14, 16)?, part(17, 19)?);
    let leap = year % 4 == 0 && (year % 100 != 0 || year % 400 == 0);
    let last_day = match month {
        2 => 28 + i64::from(leap),
        4 | 6 | 9 | 11 => 30,
        _ => 31,
    };
    if !(1..=12).contains(&month) || !(1..=last_day).contains(&day) || hour > 23 || minute > 59 || second > 59 {
        return Err("no such date");
    }
    // Counting the year from March puts the leap day at its end.
    let years = if month > 2 { year } else { year - 1 };
    let day_of_year = (153 * ((month + 9) % 12) + 2) / 5 + day - 1;
    let days =
        365 * years + years.div_euclid(4) - years.div_euclid(100) + years.div_euclid(400) + day_of_year - 719_468;
    Ok(days * 86_400 + hour * 3_600 + minute * 60 + second)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ns(text: &str) -> Result<i64, &'static str> {
        Stamp::read(text.as_bytes()).map(|stamp| stamp.ns)
    }

    #[test]
    fn a_fraction_is_scaled_by_its_digits() {
        assert_eq!(ns("1436509052.249713"), Ok(1_436_509_052_249_713_000));
        assert_eq!(ns("1436509052.249713001"), Ok(1_436_509_052_249_713_001));
        assert_eq!(ns("0.5"), Ok(500_000_000));
        assert_eq!(ns("007.000000001"), Ok(7_000_000_001));
    }

    #[test]
    fn dates_follow_the_calendar() {
        assert_eq!(ns("1970-01-01 00:00:00.000000"), Ok(0));
        assert_eq!(ns("2020-12-19 12:04:45.485261"), Ok(1_608_379_485_485_261_000));
        assert_eq!(ns("2000-02-29 23:59:59.9"), Ok(951_868_799_900_000_000));
        assert_eq!(ns("1969-12-31 23:59:59.5"), Ok(-500_000_000));
        for wrong in [
            "2021-02-29 00:00:00.0",
            "1900-02-29 00:00:00.0",
            "2020-13-01 00:00:00.0",
            "2020-01-01 24:00:00.0",
        ] {
            assert_eq!(ns(wrong), Err("no such date"), "{wrong}");
        }
        assert_eq!(ns("2020-1-01 00:00:00.0"), Err("date is not YYYY-MM-DD HH:MM:SS"));
    }

    #[test]
    fn what_does_not_fit_is_said() {
        assert_eq!(ns("9223372036.854775807"), Ok(i64::MAX));
        for far in [
            "9223372036.854775808",
            "9223372037.0",
            "99999999999999999999.0",
            "9999-01-01 00:00:00.0",
        ] {
            assert_eq!(ns(far), Err(OUT_OF_RANGE), "{far}");
        }
        assert_eq!(
            ns("1.1234567890"),
            Err("time stamp with more than 9 digits of fraction")
        );
        assert_eq!(ns("123"), Err("time stamp without a fraction"));
        for wrong in ["", ".", "1.", ".5", "-1.5", "1.2.3", "1.x", " 1.5"] {
            assert!(ns(wrong).is_err(), "{wrong}");
        }
    }

    #[test]
    fn relative_ends_where_clocks_begin() {
        let relative = |text: &[u8]| Stamp::read(text).unwrap().is_relative();
        assert!(relative(b"99999999.999999"));
        assert!(!relative(b"100000000.000000"));
        assert!(!relative(b"1970-01-01 00:00:01.0"));
    }
}
