//! Texts out of bytes, and days out of numbers.
#![forbid(unsafe_code)]

use super::number::Number;

/// 2000-01-01 in Unix seconds, and the first moment behind the year 9999.
const FIRST_SECOND: i64 = 946_684_800;
const SECONDS_END: i64 = 253_402_300_800;
const DAY: i64 = 86_400;

/// Appends UTF-8 up to the first NUL, without padding blanks; a byte that is none of it as `\xNN`.
pub fn append_text(out: &mut String, raw: &[u8]) {
    let end = raw.iter().position(|&byte| byte == 0).unwrap_or(raw.len());
    let blank = |byte: &u8| matches!(byte, b'\t'..=b'\r' | b' ');
    let kept = raw[..end]
        .iter()
        .rposition(|byte| !blank(byte))
        .map_or(0, |last| last + 1);
    let digit = |half: u8| char::from(b"0123456789abcdef"[usize::from(half)]);
    for chunk in raw[..kept].utf8_chunks() {
        out.push_str(chunk.valid());
        for byte in chunk.invalid() {
            out.extend(['\\', 'x', digit(byte >> 4), digit(byte & 15)]);
        }
    }
}

/// The day a number may name: YYYYMMDD (zeros in front of month and day may be missing), else Unix seconds from 2000
/// on, else none.
pub fn date(raw: Number) -> Option<String> {
    let named = match raw {
        Number::Whole(value) => digits(value),
        Number::Real(_) => None,
    };
    let seconds = match raw {
        Number::Whole(value) => i64::try_from(value).ok(),
        Number::Real(value) => Some(value.floor() as i64),
    };
    let known = |seconds: &i64| (FIRST_SECOND..SECONDS_END).contains(seconds);
    let (year, month, day) = named.or_else(|| seconds.filter(known).map(|seconds| civil(seconds / DAY)))?;
    Some(format!("{year:04}-{month:02}-{day:02}"))
}

/// Year, month and day by the digits of a number, the longer month and day first; none if that is no day.
fn digits(value: i128) -> Option<(i64, i64, i64)> {
    let text = value.to_string();
    let (year, rest) = (text.get(..4)?.parse().ok()?, text.get(4..)?);
    if value < 0 {
        return None;
    }
    let (month, rest) = [2, 1].into_iter().find_map(|size| {
        let (month, rest) = taken(rest, size, 12)?;
        [2, 1]
            .into_iter()
            .find_map(|size| taken(rest, size, 31))
            .map(|day| (month, day))
    })?;
    let (day, rest) = rest;
    let exists = rest.is_empty() && day <= last_day(year, month);
    exists.then_some((year, month, day))
}

/// A number from 1 to `most` in the first `size` digits, and what follows.
fn taken(text: &str, size: usize, most: i64) -> Option<(i64, &str)> {
    let number = text.get(..size)?.parse().ok()?;
    (1..=most).contains(&number).then(|| (number, &text[size..]))
}

fn last_day(year: i64, month: i64) -> i64 {
    match month {
        2 => 28 + i64::from(year % 4 == 0 && (year % 100 != 0 || year % 400 == 0)),
        4 | 6 | 9 | 11 => 30,
        _ => 31,
    }
}

/// Year, month and day of a day since 1970.
fn civil(days: i64) -> (i64, i64, i64) {
    // Counted in 400 years of March to February, so that a leap day is the last of its year.
    let days = days + 719_468;
    let (era, day) = (days.div_euclid(146_097), days.rem_euclid(146_097));
    let year = (day - day / 1460 + day / 36_524 - day / 146_096) / 365;
    let of_year = day - (365 * year + year / 4 - year / 100);
    let month = (5 * of_year + 2) / 153;
    let of_month = of_year - (153 * month + 2) / 5 + 1;
    let calendar = if month < 10 { month + 3 } else { month - 9 };
    (year + era * 400 + i64::from(calendar <= 2), calendar, of_month)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bytes_are_text() {
        for (raw, text) in [
            (&b"V1.2\0\xFF"[..], "V1.2"),
            (b"ab \t\0", "ab"),
            (b" \n\0", ""),
            (b"", ""),
            (b"a\tb", "a\tb"),
            (b"\x01\0", "\x01"),
            (b"caf\xC3\xA9 \0", "caf\u{e9}"),
            (b"caf\xE9 d\xC3", "caf\\xe9 d\\xc3"),
            (b"\xED\xA0\x80\xFF", "\\xed\\xa0\\x80\\xff"),
        ] {
            let mut out = String::new();
            append_text(&mut out, raw);
            assert_eq!(out, text);
        }
    }

    #[test]
    fn days_as_digits_or_seconds() {
        for (raw, day) in [
            (20_240_703, Some("2024-07-03")),
            (20_240_229, Some("2024-02-29")),
            (20_230_229, None),
            (2_024_123, Some("2024-12-03")),
            (2_024_110, Some("2024-01-10")),
            (202_411, Some("2024-01-01")),
            (20_241_311, None),
            (946_684_799, None),
            (946_684_800, Some("2000-01-01")),
            (1_709_164_800, Some("2024-02-29")),
            (253_402_300_799, Some("9999-12-31")),
            (253_402_300_800, None),
            (-20_240_703, None),
            (0, None),
        ] {
            assert_eq!(date(Number::Whole(raw)).as_deref(), day, "{raw}");
        }
        assert_eq!(date(Number::Real(1_709_164_800.5)).as_deref(), Some("2024-02-29"));
        assert_eq!(date(Number::Real(f64::NAN)), None);
    }
}
