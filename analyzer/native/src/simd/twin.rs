//! The fast path without vector instructions: for other processors, and to compare with.
#![forbid(unsafe_code)]

use super::block::{Block, Row};
use super::template::{Template, HEAD, MAX_WIDTH, MIN_WIDTH};
use super::ROOM;
use crate::frames::{EXTENDED, RX, TX};

/// Takes plain log lines with `digits` digits of fraction; the bytes used.
pub(super) fn lines(text: &[u8], digits: usize, template: &mut Template, block: &mut Block) -> usize {
    let mut start = 0;
    while let Some(line) = text[start..].first_chunk() {
        if block.is_full() || (line[..HEAD] != template.head[..HEAD] && !template.next_second(line)) {
            break;
        }
        let Some((row, length)) = decode(line, digits, template) else {
            break;
        };
        block.push(&row);
        start += length;
    }
    start
}

/// One line and its length with the line end.
fn decode(line: &[u8; ROOM], digits: usize, template: &Template) -> Option<(Row, usize)> {
    let close = HEAD + digits;
    let fraction = number(&line[HEAD..close], 10)? as i64 * if digits == 6 { 1000 } else { 1 };
    let hash = line.iter().position(|&b| b == b'#')?;
    let width = hash
        .checked_sub(close + 8)
        .filter(|width| (MIN_WIDTH..=MAX_WIDTH).contains(width))?;
    let shape = template.find(&line[close..], width)?;
    let id = number(&line[hash - 8..hash], 16).filter(|id| id >> 29 == 0)?;
    let text = &line[hash + 1..];
    let hex = text[..17].iter().take_while(|b| b.is_ascii_hexdigit()).count();
    if hex % 2 != 0 || hex > 16 {
        return None;
    }
    let (direction, end) = match &text[hex..] {
        [b'\n', ..] => (0, 1),
        [b'\r', b'\n', ..] => (0, 2),
        [b' ', b'R', b'\n', ..] => (RX, 3),
        [b' ', b'T', b'\n', ..] => (TX, 3),
        _ => return None,
    };
    let mut data = 0;
    for pair in text[..hex].chunks_exact(2).rev() {
        data = data << 8 | number(pair, 16)?;
    }
    let (ns, flags) = (template.second_ns + fraction, EXTENDED | direction);
    let row = Row {
        ns,
        bus: shape.bus,
        id: id as u32,
        flags,
        data,
        len: hex / 2,
    };
    Some((row, hash + 1 + hex + end))
}

fn number(text: &[u8], base: u32) -> Option<u64> {
    text.iter().try_fold(0, |value, &b| {
        let digit = char::from(b).to_digit(base)?;
        Some(value * u64::from(base) + u64::from(digit))
    })
}
