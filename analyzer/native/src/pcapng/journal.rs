//! Comments as entries of a systemd journal, one field a line: there is no block for remarks that stand between packets.
#![forbid(unsafe_code)]

use crate::candump::REMARK;
use crate::frames::NO_TIME;
use crate::line::escape;

const MICROSECOND: i64 = 1_000;
/// Whose entries are comments of a capture.
const OURS: &[u8] = b"SYSLOG_IDENTIFIER=tailbyte";
const TEXT: &str = "MESSAGE=";
/// In microseconds, for those who list the entry, and as it is.
const TIME: &str = "__REALTIME_TIMESTAMP=";
const NANOSECONDS: &str = "TAILBYTE_NANOSECONDS=";

/// Appends the body of a block, in whole words. A time before 1970 is left out.
pub(crate) fn write(t: i64, text: &str, out: &mut Vec<u8>) {
    let mut entry = vec![];
    if t >= 0 {
        entry.extend(format!("{TIME}{}\n{NANOSECONDS}{t}\n", t / MICROSECOND).into_bytes());
    }
    entry.extend(OURS);
    entry.extend(format!("\n{TEXT}{}\n", escape(text.as_bytes(), usize::MAX)).into_bytes());
    entry.resize(entry.len().next_multiple_of(4), 0);
    out.append(&mut entry);
}

/// Time and text of a comment; `None` if it is an entry of somebody else.
pub(super) fn read(body: &[u8]) -> Option<(i64, String)> {
    let lines = || body.split(|&b| b == b'\n');
    let field = |name: &str| lines().find_map(|line| line.strip_prefix(name.as_bytes()));
    if !lines().any(|line| line == OURS) {
        return None;
    }
    let t = field(NANOSECONDS).and_then(|digits| std::str::from_utf8(digits).ok()?.parse().ok());
    let t = t.filter(|t| *t >= 0).unwrap_or(NO_TIME);
    Some((t, escape(field(TEXT)?, REMARK)))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn through(t: i64, text: &str) -> Option<(i64, String)> {
        let mut out = vec![];
        write(t, text, &mut out);
        assert_eq!(out.len() % 4, 0);
        read(&out)
    }

    #[test]
    fn what_is_written_is_read() {
        for t in [0, 1, 1_700_000_000_123_456_789, i64::MAX, NO_TIME] {
            assert_eq!(through(t, "# mark 3"), Some((t, "# mark 3".to_owned())));
        }
        assert_eq!(through(-1, ""), Some((NO_TIME, String::new())));
        assert_eq!(
            through(1, "a\nMESSAGE=b\0"),
            Some((1, "a\\x0aMESSAGE=b\\x00".to_owned()))
        );
        let cut = through(1, &"x".repeat(REMARK + 1)).map(|(_, text)| text);
        assert_eq!(cut, Some("x".repeat(REMARK - 3) + "..."));
    }

    #[test]
    fn entries_of_others_are_none() {
        assert_eq!(read(b"MESSAGE=hello\n"), None);
        assert_eq!(read(b"SYSLOG_IDENTIFIER=tailbyte2\nMESSAGE=hello\n"), None);
        assert_eq!(read(b"SYSLOG_IDENTIFIER=tailbyte\n"), None);
        assert_eq!(
            read(b"TAILBYTE_NANOSECONDS=x\nSYSLOG_IDENTIFIER=tailbyte\nMESSAGE=a"),
            Some((NO_TIME, "a".to_owned()))
        );
    }
}
