//! Strings of JSON without their escapes.
#![forbid(unsafe_code)]

use crate::line::{nibble, Reason};

const WRONG: Reason = Reason::Borrowed("JSON escape not understood");

/// Appends the bytes that `text` stands for.
///
/// # Errors
/// That an escape is none of JSON.
pub(super) fn unescape(mut text: &[u8], to: &mut Vec<u8>) -> Result<(), Reason> {
    loop {
        let plain = text.iter().position(|&b| b == b'\\').unwrap_or(text.len());
        to.extend_from_slice(&text[..plain]);
        text = match &text[plain..] {
            [] => return Ok(()),
            [_, b'u', rest @ ..] => {
                let (letter, rest) = letter(rest).ok_or(WRONG)?;
                to.extend_from_slice(letter.encode_utf8(&mut [0; 4]).as_bytes());
                rest
            }
            [_, letter, rest @ ..] => {
                to.push(match letter {
                    b'"' | b'\\' | b'/' => *letter,
                    b'b' => 8,
                    b'f' => 12,
                    b'n' => b'\n',
                    b'r' => b'\r',
                    b't' => b'\t',
                    _ => return Err(WRONG),
                });
                rest
            }
            [_] => return Err(WRONG),
        };
    }
}

/// The letter of one `\u` escape or of a pair of them, from behind the first `\u`; half a pair is no letter.
fn letter(text: &[u8]) -> Option<(char, &[u8])> {
    let (unit, rest) = unit(text)?;
    if !(0xD800..0xDC00).contains(&unit) {
        return Some((char::from_u32(unit)?, rest));
    }
    let (low, rest) = self::unit(rest.strip_prefix(b"\\u")?)?;
    let low = low.checked_sub(0xDC00).filter(|&low| low < 0x400)?;
    Some((char::from_u32(0x1_0000 + ((unit - 0xD800) << 10 | low))?, rest))
}

fn unit(text: &[u8]) -> Option<(u32, &[u8])> {
    let (digits, rest) = text.split_first_chunk::<4>()?;
    let unit = digits
        .iter()
        .try_fold(0, |unit, &digit| Some(unit << 4 | u32::from(nibble(digit)?)));
    Some((unit?, rest))
}

#[cfg(test)]
mod tests {
    use super::unescape;

    fn read(text: &str) -> Option<String> {
        let mut bytes = vec![];
        unescape(text.as_bytes(), &mut bytes).ok()?;
        Some(String::from_utf8(bytes).unwrap())
    }

    #[test]
    fn escapes_of_json() {
        for (text, is) in [
            ("can0", "can0"),
            (r"c\u0061n\u0030", "can0"),
            (r#"\"\\\/\b\f\n\r\t"#, "\"\\/\u{8}\u{c}\n\r\t"),
            (r"\u00e9\uD83D\uDE00", "é😀"),
        ] {
            assert_eq!(read(text).as_deref(), Some(is), "{text}");
        }
        for wrong in [
            r"\",
            r"\x",
            r"\u12",
            r"\u12G4",
            r"\uD83D",
            r"\uD83Dx",
            r"\uD83D\u0041",
            r"\uDE00",
        ] {
            assert_eq!(read(wrong), None, "{wrong}");
        }
    }
}
