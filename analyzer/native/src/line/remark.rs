//! Times of comments and drop counts, which candump does not write: `# (1700000000.123456789) text`, and
//! `DROPCOUNT: … (total drops 12) (1700000000.123456789)`.
#![forbid(unsafe_code)]

use crate::stamp::{Kind, Stamp};

/// Fewer digits of seconds are no clock.
const SECOND_DIGITS: usize = 10;

/// The time behind the mark of a comment, and the comment without it; the text as it is if there is none.
pub fn time_in_front(text: &[u8]) -> (Option<i64>, Vec<u8>) {
    let found = text.split_first().and_then(|(mark, rest)| {
        let stamp = rest.strip_prefix(b" (")?;
        let end = stamp.iter().position(|&b| b == b')')?;
        Some((time(&stamp[..end])?, [&[*mark], &stamp[end + 1..]].concat()))
    });
    found.map_or((None, text.to_vec()), |(t, rest)| (Some(t), rest))
}

/// The time at the end of a drop count.
pub(super) fn time_behind(text: &[u8]) -> Option<i64> {
    let text = text.trim_ascii_end().strip_suffix(b")")?;
    let start = text.windows(2).rposition(|two| two == b" (")?;
    time(&text[start + 2..])
}

/// Only what our writer writes: others put numbers in brackets, too.
fn time(text: &[u8]) -> Option<i64> {
    let dot = text.iter().position(|&b| b == b'.')?;
    let stamp = Stamp::read(text).ok()?;
    let ours = dot >= SECOND_DIGITS && stamp.kind == Kind::Seconds && matches!(stamp.digits, 6 | 9);
    ours.then_some(stamp.ns)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_comment_may_have_a_time() {
        let read = |text: &str| {
            let (t, rest) = time_in_front(text.as_bytes());
            (t, String::from_utf8(rest).unwrap())
        };
        let whole = |text: &str| (None, text.to_owned());
        let ns = Some(1_700_000_000_123_456_789);
        assert_eq!(read("# (1700000000.123456789) mark 3"), (ns, "# mark 3".to_owned()));
        assert_eq!(read("; (1700000000.123456789)"), (ns, ";".to_owned()));
        assert_eq!(read("# (0000000000.000001)x"), (Some(1000), "#x".to_owned()));
        for text in [
            "#",
            "# mark",
            "# (1.5) volts",
            "#(1700000000.123456789) no blank",
            "# (1700000000.1234) four digits",
            "# (1700000000.123456789",
            "# (2020-12-19 12:04:45.485261) a date",
            "# (99999999999.000000) too far",
        ] {
            assert_eq!(read(text), whole(text));
        }
    }

    #[test]
    fn a_drop_count_may_have_one() {
        assert_eq!(
            time_behind(b"(total drops 12) (1700000000.000001)\r"),
            Some(1_700_000_000_000_001_000)
        );
        assert_eq!(time_behind(b"(total drops 12)"), None);
        assert_eq!(time_behind(b"(total drops 12) 1700000000.000001"), None);
        assert_eq!(time_behind(b""), None);
    }
}
