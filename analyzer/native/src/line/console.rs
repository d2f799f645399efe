//! The console form: `  can0  TX B -  1F040A05   [8]  11 22 ..   '.."..'`, written for people by candump without -l or -L.
#![forbid(unsafe_code)]

use super::{hex_byte, identifier, nibble, Frame, Reason, Words, MAX_CLASSIC};
use crate::frames::{BRS, ERROR, ESI, FD, MAX_DATA, REMOTE, RX, TX};

/// Reads on from the word after the interface name.
pub(super) fn read<'a>(frame: &mut Frame, word: &'a [u8], words: &mut Words<'a>) -> Result<(), Reason> {
    let (word, marks) = marks(word, words)?;
    let (id, flags) = identifier(word)?;
    frame.id = id;
    frame.flags = flags | marks;
    let length = length(frame, words.next().ok_or("no length in brackets")?)?;
    if words.rest().starts_with(b"remote request") {
        return remote(frame, length);
    }
    data(frame, length, words)?;
    match words.rest() {
        // The text column holds anything, quotes and blanks too.
        [] | [b'\'' | b'`', ..] => Ok(()),
        b"ERRORFRAME" => {
            frame.flags |= ERROR;
            Ok(())
        }
        _ => Err("unknown text after the data".into()),
    }
}

/// The columns of -x (direction, bit rate switch, error state) and the word that follows them.
fn marks<'a>(word: &'a [u8], words: &mut Words<'a>) -> Result<(&'a [u8], u16), Reason> {
    let mut marks = match word {
        b"RX" => RX,
        b"TX" => TX,
        _ => return Ok((word, 0)),
    };
    for (letter, flag) in [(b"B", BRS), (b"E", ESI)] {
        match words.next() {
            Some(b"-") => {}
            Some(mark) if mark == letter => marks |= flag,
            _ => return Err("columns of -x not understood".into()),
        }
    }
    Ok((words.next().ok_or("no identifier")?, marks))
}

/// `[8]` is a classic length, two or three digits a CAN FD one, `{B}` the raw length code of candump -8.
fn length(frame: &mut Frame, word: &[u8]) -> Result<usize, Reason> {
    let digits = match word {
        [b'{', code, b'}'] => {
            let code = nibble(*code).ok_or("no length in brackets")?;
            if usize::from(code) > MAX_CLASSIC {
                frame.set_dlc(code);
            }
            return Ok(MAX_CLASSIC.min(code.into()));
        }
        [b'[', _, _, _, _, b']'] => return Err("CAN XL frame".into()),
        [b'[', digit, b']'] => std::slice::from_ref(digit),
        [b'[', digits @ .., b']'] if matches!(digits.len(), 2 | 3) => {
            frame.flags |= FD;
            digits
        }
        _ => return Err("no length in brackets".into()),
    };
    if !digits.iter().all(u8::is_ascii_digit) {
        return Err("no length in brackets".into());
    }
    let length = digits.iter().fold(0, |length, b| length * 10 + usize::from(b - b'0'));
    if length > MAX_DATA {
        return Err(format!("data longer than {MAX_DATA} bytes").into());
    }
    Ok(length)
}

fn remote(frame: &mut Frame, length: usize) -> Result<(), Reason> {
    if frame.flags & FD != 0 {
        return Err("remote request on a CAN FD frame".into());
    }
    // A raw code of -8 is there already; its low bits keep a length of 8.
    frame.set_dlc(length as u8);
    frame.flags |= REMOTE;
    Ok(())
}

/// Exactly `length` bytes: `11 22`, with -i `00010001 00100010`, with -S the last byte first and backticks between.
fn data(frame: &mut Frame, length: usize, words: &mut Words) -> Result<(), Reason> {
    let mut swapped = false;
    let mut found = 0;
    loop {
        let rest = words.rest();
        if found >= length && !rest.first().is_some_and(u8::is_ascii_hexdigit) {
            break;
        }
        let Some(word) = words.next().filter(|word| bytes(word).all(|byte| byte.is_some())) else {
            words.0 = rest;
            break;
        };
        swapped |= word.contains(&b'`');
        for byte in bytes(word).flatten() {
            found += 1;
            if found <= length {
                frame.push(byte, MAX_DATA)?;
            }
        }
    }
    if found != length {
        return Err(format!("says {length} bytes, has {found}").into());
    }
    if swapped {
        frame.bytes[..length].reverse();
    }
    Ok(())
}

fn bytes(word: &[u8]) -> impl Iterator<Item = Option<u8>> + '_ {
    word.split(|&b| b == b'`').map(|piece| match piece {
        [high, low] => hex_byte(*high, *low),
        [_, _, _, _, _, _, _, _] => piece.iter().try_fold(0, |byte, &bit| match bit {
            b'0' | b'1' => Some(byte << 1 | (bit & 1)),
            _ => None,
        }),
        _ => None,
    })
}
