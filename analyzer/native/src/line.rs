//! One line of candump text to its meaning. Knows no table, no time base and no line number.
#![forbid(unsafe_code)]

mod console;
mod errors;
pub mod remark;
mod text;

use std::borrow::Cow;

use crate::frames::{
    BRS, DLC_SHIFT, ERROR, ESI, EXTENDED, FD, ID_MASK, MAX_CLASSIC, MAX_DATA, MAX_STANDARD, REMOTE, RX, TX, WORD_ERROR,
    WORD_REMOTE,
};
use crate::stamp::Stamp;

pub use errors::describe as describe_error;
pub use text::{escape, plain};

/// Why a line cannot be read.
pub type Reason = Cow<'static, str>;

/// More than Linux allows (15), so that names of other systems pass.
pub const MAX_NAME: usize = 64;

#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Line<'a> {
    Blank,
    Comment,
    Drop(DropCount<'a>),
    Frame(Frame<'a>),
}

/// `DROPCOUNT: dropped 5 CAN frames on 'can0' socket (total drops 12)`
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct DropCount<'a> {
    pub frames: u32,
    /// Unknown when the line is cut or the socket listened on every interface.
    pub name: Option<&'a [u8]>,
    /// Only our own writer states it.
    pub t: Option<i64>,
}

#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Frame<'a> {
    pub stamp: Option<Stamp>,
    /// The stamp counts from the first line or from the line before (console form only).
    pub relative: bool,
    pub name: &'a [u8],
    /// The identifier; of an error frame its class bits.
    pub id: u32,
    /// Bits of [`crate::frames`]; `ERROR` marks an error frame.
    pub flags: u16,
    len: usize,
    bytes: [u8; MAX_DATA],
}

impl Frame<'_> {
    pub fn data(&self) -> &[u8] {
        &self.bytes[..self.len]
    }

    fn push(&mut self, byte: u8, limit: usize) -> Result<(), Reason> {
        if self.len == limit {
            return Err(format!("data longer than {limit} bytes").into());
        }
        self.bytes[self.len] = byte;
        self.len += 1;
        Ok(())
    }

    fn set_dlc(&mut self, code: u8) {
        self.flags |= u16::from(code) << DLC_SHIFT;
    }
}

/// Reads one line without its line end; colour escapes are gone already ([`plain`]).
///
/// # Errors
/// The reason why the line is none of the forms that candump writes.
pub fn read(line: &[u8]) -> Result<Line<'_>, Reason> {
    let line = line.trim_ascii();
    match line {
        [] => return Ok(Line::Blank),
        [b'#' | b';', ..] => return Ok(Line::Comment),
        [b'D', b'R', b'O', b'P', ..] => {
            if let Some(text) = line.strip_prefix(b"DROPCOUNT:") {
                return drop_count(text)
                    .map(Line::Drop)
                    .ok_or("drop count not understood".into());
            }
        }
        _ => {}
    }
    let (stamp, rest) = leading_stamp(line)?;
    let mut words = Words(rest);
    let name = words.next().unwrap_or_default();
    if name.is_empty() || name.contains(&b'#') {
        return Err("no interface name".into());
    }
    if name.len() > MAX_NAME {
        return Err(format!("interface name longer than {MAX_NAME} bytes").into());
    }
    let mut frame = Frame {
        stamp,
        relative: false,
        name,
        id: 0,
        flags: 0,
        len: 0,
        bytes: [0; MAX_DATA],
    };
    let word = words.next().ok_or("no identifier")?;
    if let Some(at) = word.iter().position(|&b| b == b'#') {
        log_form(&mut frame, &word[..at], &word[at + 1..], &mut words)?;
    } else {
        frame.relative = stamp.is_some_and(|stamp| stamp.is_relative());
        console::read(&mut frame, word, &mut words)?;
    }
    Ok(Line::Frame(frame))
}

/// The stamp in brackets, if any, and what follows it. Data sets put a label word before it.
fn leading_stamp(line: &[u8]) -> Result<(Option<Stamp>, &[u8]), Reason> {
    let mut words = Words(line);
    let bracketed = if line.starts_with(b"(") {
        line
    } else {
        words.next();
        words.rest()
    };
    let Some(text) = bracketed.strip_prefix(b"(") else {
        return Ok((None, line));
    };
    let end = text
        .iter()
        .position(|&b| b == b')')
        .ok_or("time stamp without a closing bracket")?;
    Ok((Some(Stamp::read(&text[..end])?), &text[end + 1..]))
}

/// `044#2A366C2BBA`, `1F040A05##5112233`, `123#R8_9`, `123#1122334455667788_B`, each with or without ` R` or ` T`.
///
/// The digit behind `##` is the flags of the kernel's `struct canfd_frame`. Bit 0 is the bit rate switch, bit 1 the error
/// state. Bit 2 (`CANFD_FDF`, of newer kernels) says what `##` says already; bit 3 is reserved and without a meaning.
/// Neither is kept: such a line is written again with the first two bits alone.
fn log_form(frame: &mut Frame, id: &[u8], body: &[u8], words: &mut Words) -> Result<(), Reason> {
    (frame.id, frame.flags) = identifier(id)?;
    match body {
        [b'R' | b'r', dlc @ ..] => remote(frame, dlc)?,
        [b'#', flags, hex @ ..] => {
            let flags = nibble(*flags).ok_or("no CAN FD flags")?;
            frame.flags |= FD | if flags & 1 != 0 { BRS } else { 0 } | if flags & 2 != 0 { ESI } else { 0 };
            hex_bytes(frame, hex, MAX_DATA)?;
        }
        [b'#'] => return Err("no CAN FD flags".into()),
        _ => classic(frame, body)?,
    }
    frame.flags |= match words.next() {
        None => 0,
        Some(b"R") => RX,
        Some(b"T") => TX,
        Some(_) => return Err("unknown text after the frame".into()),
    };
    if words.next().is_some() {
        return Err("unknown text after the frame".into());
    }
    Ok(())
}

fn remote(frame: &mut Frame, dlc: &[u8]) -> Result<(), Reason> {
    let code = match dlc {
        [] => Some(0),
        [digit] => nibble(*digit).filter(|&code| code <= 8),
        [b'8', b'_', digit] => nibble(*digit).filter(|&code| code > 8),
        _ => None,
    };
    frame.flags |= REMOTE;
    frame.set_dlc(code.ok_or("length of the remote request not understood")?);
    Ok(())
}

fn classic(frame: &mut Frame, body: &[u8]) -> Result<(), Reason> {
    let Some(at) = body.iter().position(|&b| b == b'_') else {
        // More than 8 bytes are not possible, but legible: the reassembly marks such a frame.
        return hex_bytes(frame, body, MAX_DATA);
    };
    hex_bytes(frame, &body[..at], MAX_CLASSIC)?;
    let code = match body[at + 1..] {
        [digit] if frame.len == MAX_CLASSIC => nibble(digit).filter(|&code| code > 8),
        _ => None,
    };
    frame.set_dlc(code.ok_or("a raw length code needs 8 bytes and one digit from 9 to F")?);
    Ok(())
}

/// Pairs of hex digits; a dot may stand before any of them, as cansend has it.
fn hex_bytes(frame: &mut Frame, mut text: &[u8], limit: usize) -> Result<(), Reason> {
    while !text.is_empty() {
        match text.strip_prefix(b".").unwrap_or(text) {
            [high, low, rest @ ..] => {
                let byte = hex_byte(*high, *low).ok_or("not a hex digit in the data")?;
                frame.push(byte, limit)?;
                text = rest;
            }
            [_] => return Err("odd number of hex digits".into()),
            [] => return Err("no byte after a dot".into()),
        }
    }
    Ok(())
}

/// Up to 3 digits are a standard identifier, 4 to 8 an extended one. Of the kernel's flag bits the error bit marks an
/// error frame, the extended bit says what is known already, and the remote bit is not an identifier that can be read.
fn identifier(text: &[u8]) -> Result<(u32, u16), Reason> {
    if text.len() > 8 {
        return Err("identifier longer than 8 digits".into());
    }
    let word = text
        .iter()
        .try_fold(0, |word, &b| Some(word << 4 | u32::from(nibble(b)?)));
    let word = word.filter(|_| !text.is_empty()).ok_or("no identifier")?;
    if text.len() <= 3 {
        return if word <= MAX_STANDARD {
            Ok((word, 0))
        } else {
            Err("standard identifier above 7FF".into())
        };
    }
    if word & WORD_REMOTE != 0 {
        return Err("identifier above 1FFFFFFF".into());
    }
    Ok((
        word & ID_MASK,
        EXTENDED | if word & WORD_ERROR != 0 { ERROR } else { 0 },
    ))
}

fn drop_count(text: &[u8]) -> Option<DropCount<'_>> {
    let text = text.trim_ascii_start().strip_prefix(b"dropped ")?;
    let end = text.iter().position(|b| !b.is_ascii_digit())?;
    let frames = std::str::from_utf8(&text[..end]).ok()?.parse().ok()?;
    let text = text[end..].strip_prefix(b" CAN frame")?;
    // The socket is quoted as on the command line, perhaps with filters after a comma.
    let mut quoted = text.split(|&b| b == b'\'');
    let name = quoted.nth(1).filter(|_| quoted.next().is_some()).unwrap_or_default();
    let name = name.split(|&b| b == b',').next().unwrap_or_default();
    let known = !name.is_empty() && name.len() <= MAX_NAME && name != b"any";
    Some(DropCount {
        frames,
        name: known.then_some(name),
        t: remark::time_behind(text),
    })
}

const NOT_HEX: u8 = 0xFF;

/// The value of each hex digit. Data is random, so that branches on its digits would cost more than the look-up.
const NIBBLES: [u8; 256] = {
    let mut values = [NOT_HEX; 256];
    let mut value = 0;
    while value < 16 {
        values[b"0123456789ABCDEF"[value] as usize] = value as u8;
        values[b"0123456789abcdef"[value] as usize] = value as u8;
        value += 1;
    }
    values
};

pub(crate) fn nibble(digit: u8) -> Option<u8> {
    let value = NIBBLES[usize::from(digit)];
    (value != NOT_HEX).then_some(value)
}

pub(crate) fn hex_byte(high: u8, low: u8) -> Option<u8> {
    let (high, low) = (NIBBLES[usize::from(high)], NIBBLES[usize::from(low)]);
    (high | low != NOT_HEX).then_some(high << 4 | low)
}

/// The blank-separated words of a line, one at a time.
struct Words<'a>(&'a [u8]);

impl<'a> Words<'a> {
    fn next(&mut self) -> Option<&'a [u8]> {
        let text = self.rest();
        let end = text.iter().position(u8::is_ascii_whitespace).unwrap_or(text.len());
        self.0 = &text[end..];
        (end > 0).then(|| &text[..end])
    }

    fn rest(&self) -> &'a [u8] {
        self.0.trim_ascii_start()
    }
}
