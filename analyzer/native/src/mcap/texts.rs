//! Bytes and identifiers in text where nobody says how they are coded: the messages of a channel show it, sooner or
//! later, and all of them are coded alike.
#![forbid(unsafe_code)]

use super::bytes::{self, Bytes};
use crate::frames::MAX_CLASSIC;
use crate::line::nibble;
use crate::socketcan::fd_length;

/// Messages that may be read either way before one way is assumed.
const MAX_EITHER: u8 = 64;
/// Base64 of this length or more does not consist of hex digits by chance if a decimal one is among them: those stand
/// for values that small numbers do not have.
const CHANCE: usize = 16;
/// More digits make no identifier.
const MAX_HEX_ID: usize = 8;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Coding {
    /// No message has shown it.
    Open,
    Hex,
    /// Base64 of data, decimal numbers of identifiers.
    Other,
}

/// What one text shows.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Sign {
    /// Nothing: it means the same either way, or nothing at all.
    Nothing,
    Either,
    Is(Coding),
}

/// The coding of one field, as far as it is known.
#[derive(Clone, Copy, Debug)]
pub(super) struct Text {
    pub coding: Coding,
    /// Messages so far that may be read either way.
    either: u8,
}

impl Text {
    /// Of a field that is there, or that is not.
    pub fn new(there: bool) -> Text {
        let coding = if there { Coding::Open } else { Coding::Other };
        Text { coding, either: 0 }
    }

    pub fn is_open(self) -> bool {
        self.coding == Coding::Open
    }

    /// Whether messages wait for one that decides.
    pub fn waits(self) -> bool {
        self.is_open() && self.either > 0
    }

    /// Takes the sign of one more message; whether there have been enough without a decision.
    pub fn see(&mut self, sign: Sign) -> bool {
        match sign {
            Sign::Is(coding) if self.is_open() => self.coding = coding,
            Sign::Either if self.is_open() => self.either += 1,
            _ => {}
        }
        self.is_open() && self.either == MAX_EITHER
    }
}

/// How the data field of a frame is coded; `stated` is its length or length code, `fd` whether it is CAN FD.
pub(super) fn data_sign(text: &[u8], stated: Option<u8>, fd: Option<bool>) -> Sign {
    if text.is_empty() {
        return Sign::Nothing;
    }
    let length = |read: fn(&[u8], &mut Bytes) -> Result<(), _>| {
        let mut data = Bytes::EMPTY;
        read(text, &mut data).ok().map(|()| data.as_slice().len())
    };
    let (hex, base64) = match (length(bytes::hex), length(bytes::base64)) {
        (None, None) => return Sign::Nothing,
        (Some(_), None) => return Sign::Is(Coding::Hex),
        (None, Some(_)) => return Sign::Is(Coding::Other),
        (Some(hex), Some(base64)) => (hex, base64),
    };
    let is_stated = |length: usize| {
        stated.is_some_and(|stated| usize::from(stated) == length || fd_length(stated).is_some_and(|of| of == length))
    };
    let possible = |length: usize| length <= MAX_CLASSIC || (fd != Some(false) && is_fd_length(length));
    for fits in [&is_stated as &dyn Fn(usize) -> bool, &possible] {
        match (fits(hex), fits(base64)) {
            (true, false) => return Sign::Is(Coding::Hex),
            (false, true) => return Sign::Is(Coding::Other),
            _ => {}
        }
    }
    let separated = text.contains(&b'-');
    if separated || (text.len() >= CHANCE && text.iter().any(u8::is_ascii_digit)) {
        return Sign::Is(Coding::Hex);
    }
    Sign::Either
}

fn is_fd_length(length: usize) -> bool {
    (0..16).any(|code| fd_length(code) == Some(length))
}

/// How an identifier is coded. Decimal numbers have no leading zeros; `0x` in front says everything.
pub(super) fn id_sign(text: &[u8]) -> Sign {
    if text.iter().all(u8::is_ascii_digit) {
        return match text {
            [] | [_] => Sign::Nothing,
            [b'0', ..] => Sign::Is(Coding::Hex),
            _ if text.len() > MAX_HEX_ID => Sign::Is(Coding::Other),
            _ => Sign::Either,
        };
    }
    if text.len() <= MAX_HEX_ID && text.iter().all(|&digit| nibble(digit).is_some()) {
        return Sign::Is(Coding::Hex);
    }
    Sign::Nothing
}

#[cfg(test)]
mod tests {
    use super::*;

    const HEX: Sign = Sign::Is(Coding::Hex);
    const OTHER: Sign = Sign::Is(Coding::Other);

    #[test]
    fn data() {
        for (text, stated, fd, is) in [
            ("", None, None, Sign::Nothing),
            ("x", None, None, Sign::Nothing),
            ("A6350", None, None, Sign::Nothing),
            ("A635", None, None, Sign::Either),
            ("A63500", None, None, HEX),
            ("A6 35", None, None, HEX),
            ("A6-35-00", None, None, HEX),
            ("AAAAAAAA", None, None, Sign::Either),
            ("AAAAAAAA", Some(6), None, OTHER),
            ("AAAAAAAA", Some(4), None, HEX),
            ("AAAAAAAA", Some(8), None, Sign::Either),
            ("AAAAAAAAAAAA", None, None, HEX),
            ("AAAAAAAAAAA=", None, None, OTHER),
            ("AAAAAAAAAAAAAAAA", None, None, Sign::Either),
            ("AAAAAAAAAAAAAAAA", None, Some(false), HEX),
            ("AAAAAAAAAAAAAAAA", Some(9), Some(true), OTHER),
            ("A635000000000000", None, Some(true), HEX),
            ("AQEB", None, None, OTHER),
        ] {
            assert_eq!(data_sign(text.as_bytes(), stated, fd), is, "{text}");
        }
    }

    #[test]
    fn identifiers() {
        for (text, is) in [
            ("", Sign::Nothing),
            ("5", Sign::Nothing),
            ("0x12", Sign::Nothing),
            ("-12", Sign::Nothing),
            ("12.0", Sign::Nothing),
            ("12345678A", Sign::Nothing),
            ("12", Sign::Either),
            ("12345678", Sign::Either),
            ("123456789", OTHER),
            ("05040601", HEX),
            ("07f", HEX),
            ("7FF", HEX),
        ] {
            assert_eq!(id_sign(text.as_bytes()), is, "{text}");
        }
    }
}
