//! Text of a capture is not to be trusted: colours are taken out for reading, control bytes shown for quoting.
#![forbid(unsafe_code)]

use std::borrow::Cow;
use std::fmt::Write;

const ESCAPE: u8 = 0x1B;

/// The line without the colour escapes of `candump -c` (ESC `[`, digits and semicolons, `m`).
pub fn plain(line: &[u8]) -> Cow<'_, [u8]> {
    if !line.contains(&ESCAPE) {
        return Cow::Borrowed(line);
    }
    let mut kept = Vec::with_capacity(line.len());
    let mut rest = line;
    while let [first, tail @ ..] = rest {
        rest = after_colour(rest).unwrap_or_else(|| {
            kept.push(*first);
            tail
        });
    }
    Cow::Owned(kept)
}

fn after_colour(text: &[u8]) -> Option<&[u8]> {
    let parameters = text.strip_prefix(&[ESCAPE, b'['])?;
    let end = parameters.iter().position(|b| !b.is_ascii_digit() && *b != b';')?;
    (parameters[end] == b'm').then(|| &parameters[end + 1..])
}

/// Printable ASCII of at most `limit` characters; every other byte reads `\x1b`, and a cut text ends with `...`.
pub fn escape(bytes: &[u8], limit: usize) -> String {
    let mut text = String::new();
    let mut fits = 0;
    for &byte in bytes {
        if byte == b' ' || byte.is_ascii_graphic() {
            text.push(char::from(byte));
        } else {
            let _ = write!(text, "\\x{byte:02x}");
        }
        if text.len() > limit {
            text.truncate(fits);
            text.push_str("...");
            break;
        }
        if text.len() + 3 <= limit {
            fits = text.len();
        }
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn colours_go_and_other_escapes_stay() {
        assert_eq!(*plain(b"\x1b[1m\x1b[34m  can0\x1b[0m"), *b"  can0");
        assert_eq!(*plain(b"\x1b[2Kcan0\x1b[3"), *b"\x1b[2Kcan0\x1b[3");
        assert!(matches!(plain(b"can0"), Cow::Borrowed(_)));
    }

    #[test]
    fn quoted_text_is_printable_and_bounded() {
        assert_eq!(escape(b"a\x1b[0m\xff\0z", 80), "a\\x1b[0m\\xff\\x00z");
        assert_eq!(escape(b"12345678", 8), "12345678");
        assert_eq!(escape(b"123456789", 8), "12345...");
        assert_eq!(escape(b"1234\x001234", 8), "1234...");
        assert_eq!(escape(b"12345\0", 8), "12345...");
    }
}
