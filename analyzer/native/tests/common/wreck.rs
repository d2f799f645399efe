//! Damage to valid traffic. Each kind is chosen by a number, so that a generator and a fuzzer share them.

use _native::frames::{EXTENDED, FD, NO_TIME, REMOTE};

use crate::log::CanFrame;

pub const FRAME_DAMAGES: u8 = 17;
pub const TEXT_DAMAGES: u8 = 8;

/// Damages the frame at `at`; `value` says how.
pub fn damage_frame(frames: &mut Vec<CanFrame>, kind: u8, at: usize, value: u32) {
    if frames.is_empty() {
        return;
    }
    let at = at % frames.len();
    let there = (at + value as usize % 16) % frames.len();
    let data = &mut frames[at].data;
    match kind % FRAME_DAMAGES {
        0 => drop(frames.remove(at)),
        1 => frames.insert(at, frames[at].clone()),
        2 => frames.insert(there, frames[at].clone()),
        3 => {
            let frame = frames.remove(at);
            frames.insert(there.min(frames.len()), frame);
        }
        4 => {
            if let Some(tail) = data.last_mut() {
                *tail ^= 1 << (value % 8);
            }
        }
        5 => {
            let bytes = data.len().max(1);
            if let Some(byte) = data.get_mut((value >> 8) as usize % bytes) {
                *byte ^= (value as u8).max(1);
            }
        }
        6 => {
            if let Some(tail) = data.pop() {
                data.truncate(value as usize % 8);
                data.push(tail);
            }
        }
        7 => data.truncate(value as usize % 8),
        8 => frames[at].id ^= 1 << (value % 29),
        9 => frames[at].flags ^= [EXTENDED, FD, REMOTE][value as usize % 3],
        10 => frames[at].t = NO_TIME,
        11 => shift(&mut frames[at..], 2_500_000_000),
        12 => shift(&mut frames[at..], i64::from(value % 3_000) * 1_000_000),
        13 => shift(&mut frames[at..], -i64::from(value % 3_000) * 1_000_000),
        14 => frames[at].bus ^= 1,
        15 => {
            let id = frames[at].id;
            let same = frames[at..].iter_mut().filter(|frame| frame.id == id);
            for frame in same.take(3) {
                frame.data.drain(..frame.data.len().saturating_sub(1));
            }
        }
        _ => {
            let end = frames.len().min(at + value as usize % 8);
            frames.drain(at..end);
        }
    }
}

fn shift(frames: &mut [CanFrame], by: i64) {
    for frame in frames.iter_mut().filter(|frame| frame.t != NO_TIME) {
        frame.t = (frame.t + by).max(0);
    }
}

/// Damages the text at byte `at`; `value` says how.
pub fn damage_text(text: &mut Vec<u8>, kind: u8, at: usize, value: u8) {
    if text.is_empty() {
        return;
    }
    let at = at % text.len();
    let line = text[..at].iter().rposition(|&b| b == b'\n').map_or(0, |end| end + 1);
    let mut insert = |line_of_text: &[u8]| drop(text.splice(line..line, line_of_text.iter().copied()));
    match kind % TEXT_DAMAGES {
        0 => text[at] ^= value.max(1),
        1 => text[at] = b"0aF#_. \r\n)(RT\0\xFF"[usize::from(value % 15)],
        2 => drop(text.remove(at)),
        3 => drop(text.drain(at..text.len().min(at + usize::from(value)))),
        4 => insert(b"# remark\n"),
        5 => insert(
            b"DROPCOUNT: dropped 5 CAN frames on 'can0' socket (total drops 12)
",
        ),
        6 => insert(b"(1700000000.000001) can0 20000088#0000040000000000\n"),
        _ => insert(&[value, b'?', 0x1B, b'\n']),
    }
}
