//! The data bytes of a frame, and the ways in which text carries them.
#![forbid(unsafe_code)]

use super::can::within;
use super::decimal::Decimal;
use crate::frames::MAX_DATA;
use crate::line::{hex_byte, nibble, Reason};

/// A data field.
#[derive(Clone, Copy, Debug)]
pub(super) struct Bytes {
    bytes: [u8; MAX_DATA],
    len: usize,
}

impl Bytes {
    pub const EMPTY: Bytes = Bytes {
        bytes: [0; MAX_DATA],
        len: 0,
    };

    pub fn push(&mut self, byte: u8) -> Result<(), Reason> {
        within(self.len + 1, MAX_DATA)?;
        self.bytes[self.len] = byte;
        self.len += 1;
        Ok(())
    }

    pub fn push_number(&mut self, number: Decimal) -> Result<(), Reason> {
        let byte = number.integer().and_then(|byte| u8::try_from(byte).ok());
        self.push(byte.ok_or("data byte out of range")?)
    }

    pub fn as_slice(&self) -> &[u8] {
        &self.bytes[..self.len]
    }
}

/// Pairs of hex digits; blanks, colons, dots and dashes may stand between pairs.
pub(super) fn hex(mut text: &[u8], to: &mut Bytes) -> Result<(), Reason> {
    loop {
        text = match text {
            [] => return Ok(()),
            [b' ' | b':' | b'.' | b'-', rest @ ..] => rest,
            [high, low, rest @ ..] => {
                to.push(hex_byte(*high, *low).ok_or("not a hex digit in the data")?)?;
                rest
            }
            [_] => return Err("odd number of hex digits".into()),
        };
    }
}

/// Base64 of either alphabet, with or without padding.
pub(super) fn base64(text: &[u8], to: &mut Bytes) -> Result<(), Reason> {
    const WRONG: Reason = Reason::Borrowed("data is not base64");
    let end = text.iter().rposition(|&b| b != b'=').map_or(0, |last| last + 1);
    if text.len() - end > 2 || (end < text.len() && !text.len().is_multiple_of(4)) {
        return Err(WRONG);
    }
    for group in text[..end].chunks(4) {
        let mut word = 0;
        for &letter in group {
            word = word << 6 | sextet(letter).ok_or(WRONG)?;
        }
        let bits = 6 * group.len();
        // A single letter is less than a byte, and bits behind the last byte are zero.
        if group.len() == 1 || word & ((1 << (bits % 8)) - 1) != 0 {
            return Err(WRONG);
        }
        (1..=bits / 8).try_for_each(|byte| to.push((word >> (bits - 8 * byte)) as u8))?;
    }
    Ok(())
}

/// Up to 16 hex digits.
pub(super) fn hex_number(digits: &[u8]) -> Option<u64> {
    let fits = (1..=16).contains(&digits.len());
    let mut digits = digits.iter().filter(|_| fits).peekable();
    digits.peek()?;
    digits.try_fold(0, |number, &digit| Some(number << 4 | u64::from(nibble(digit)?)))
}

fn sextet(letter: u8) -> Option<u32> {
    let value = match letter {
        b'A'..=b'Z' => letter - b'A',
        b'a'..=b'z' => letter - b'a' + 26,
        b'0'..=b'9' => letter - b'0' + 52,
        b'+' | b'-' => 62,
        b'/' | b'_' => 63,
        _ => return None,
    };
    Some(value.into())
}
