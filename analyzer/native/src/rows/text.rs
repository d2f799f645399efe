//! Texts as views show them: escapes of JSON, cells of CSV, hexadecimal, blanks up to a width.

#![forbid(unsafe_code)]

use super::column::{Column, Kind};

const DIGITS: &[u8; 16] = b"0123456789ABCDEF";

/// Writes bytes in hexadecimal.
pub fn hex(out: &mut Vec<u8>, bytes: &[u8], between: &[u8]) {
    for (k, byte) in bytes.iter().enumerate() {
        if k > 0 {
            out.extend_from_slice(between);
        }
        out.extend_from_slice(&[DIGITS[usize::from(byte >> 4)], DIGITS[usize::from(byte & 15)]]);
    }
}

/// Writes a text in quotes with everything escaped that is not printable ASCII.
pub fn json(out: &mut Vec<u8>, text: &[u8]) {
    out.push(b'"');
    if text
        .iter()
        .all(|byte| matches!(byte, b' '..=b'~') && !matches!(byte, b'"' | b'\\'))
    {
        out.extend_from_slice(text);
        out.push(b'"');
        return;
    }
    for letter in String::from_utf8_lossy(text).chars() {
        match letter {
            '"' | '\\' => out.extend_from_slice(&[b'\\', letter as u8]),
            '\n' => out.extend_from_slice(b"\\n"),
            '\r' => out.extend_from_slice(b"\\r"),
            '\t' => out.extend_from_slice(b"\\t"),
            '\u{8}' => out.extend_from_slice(b"\\b"),
            '\u{c}' => out.extend_from_slice(b"\\f"),
            ' '..='~' => out.push(letter as u8),
            _ => {
                for unit in letter.encode_utf16(&mut [0; 2]) {
                    out.extend_from_slice(format!("\\u{unit:04x}").as_bytes());
                }
            }
        }
    }
    out.push(b'"');
}

/// Turns what was written from `start` on into a cell of CSV: in quotes where it has to be, and no formula.
pub fn csv(out: &mut Vec<u8>, start: usize) {
    if matches!(out.get(start), Some(b'=' | b'+' | b'-' | b'@' | b'\t' | b'\r' | b'\n')) {
        out.insert(start, b'\'');
    }
    let (mut quotes, mut special) = (0, false);
    for byte in &out[start..] {
        quotes += usize::from(*byte == b'"');
        special |= matches!(byte, b',' | b'\r' | b'\n');
    }
    if quotes == 0 && !special {
        return;
    }
    let mut from = out.len();
    out.resize(from + quotes + 2, b'"');
    let mut to = out.len() - 1;
    while from > start {
        from -= 1;
        to -= 1;
        let byte = out[from];
        out[to] = byte;
        if byte == b'"' {
            to -= 1;
            out[to] = byte;
        }
    }
    out[start] = b'"';
}

/// Counts characters.
pub fn width(text: &[u8]) -> usize {
    text.iter().filter(|&&byte| byte & 0xC0 != 0x80).count()
}

/// Fills what was written from `start` on with blanks up to a width, behind a text at the left.
pub fn pad(out: &mut Vec<u8>, start: usize, to: usize, left: bool) {
    let missing = to.saturating_sub(width(&out[start..]));
    let end = out.len();
    out.resize(end + missing, b' ');
    if !left && missing > 0 {
        out.copy_within(start..end, start + missing);
        out[start..start + missing].fill(b' ');
    }
}

/// Writes a list of printable characters as a text in quotes, at most so many; false if it is none.
pub fn characters(out: &mut Vec<u8>, list: &Column, row: usize, most: usize) -> bool {
    let (Some(column), span) = (list.children.first(), list.span(row)) else {
        return false;
    };
    let whole = matches!(column.kind, Kind::Flag | Kind::Unsigned(_) | Kind::Signed(_));
    let printable = |row| column.has(row) && (0x20..0x7F).contains(&column.whole(row));
    if !whole || span.is_empty() || !span.clone().all(printable) {
        return false;
    }
    out.push(b'"');
    out.extend(span.take(most).map(|row| column.whole(row) as u8));
    out.push(b'"');
    true
}

#[cfg(test)]
mod tests {
    use super::*;

    fn written(write: impl FnOnce(&mut Vec<u8>, usize)) -> String {
        let mut out = b"before".to_vec();
        write(&mut out, 6);
        String::from_utf8(out[6..].to_vec()).expect("text")
    }

    #[test]
    fn json_is_ascii() {
        let text = "a\"\\\n\u{1b}\u{7f}\u{e9}\u{202e}\u{1f600}";
        let shown = written(|out, _| json(out, text.as_bytes()));
        assert_eq!(shown, r#""a\"\\\n\u001b\u007f\u00e9\u202e\ud83d\ude00""#);
    }

    #[test]
    fn cells_of_csv() {
        for (cell, shown) in [
            ("plain text", "plain text"),
            ("", ""),
            ("=1+1", "'=1+1"),
            ("a,b", "\"a,b\""),
            ("\"", "\"\"\"\""),
            ("{\"a\":\"b\"}", "\"{\"\"a\"\":\"\"b\"\"}\""),
            ("\n", "\"'\n\""),
        ] {
            let found = written(|out, start| {
                out.extend_from_slice(cell.as_bytes());
                csv(out, start);
            });
            assert_eq!(found, shown);
        }
    }

    #[test]
    fn blanks_count_characters() {
        let padded = |left| {
            written(|out, start| {
                out.extend_from_slice("\u{b5}s".as_bytes());
                pad(out, start, 4, left);
            })
        };
        assert_eq!([padded(true), padded(false)], ["\u{b5}s  ", "  \u{b5}s"]);
    }
}
