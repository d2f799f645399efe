//! A small machine: its instructions send valid transfers, let time pass, and damage what was sent.

use _native::frames::{EXTENDED, FD};

use crate::input::Input;
use crate::log::{self, CanFrame};
use crate::sender::{anonymous_id, cut, message_id, service_id};
use crate::wreck::{damage_frame, damage_text};

const MAX_FRAMES: usize = 2000;
const LENGTHS: [usize; 16] = [0, 1, 4, 6, 7, 8, 11, 12, 14, 21, 33, 60, 63, 64, 120, 255];
const MS: i64 = 1_000_000;

fn sessions() -> [(u32, bool); 16] {
    [
        (message_id(1034, 10), false),
        (message_id(1034, 11), false),
        (message_id(1034, 12), true),
        (message_id(1030, 10), false),
        (message_id(1033, 10), false),
        (message_id(1033, 11), true),
        (message_id(341, 10), false),
        (service_id(1, true, 10, 20), false),
        (service_id(1, false, 20, 10), false),
        (service_id(1, true, 10, 10), false),
        (service_id(77, true, 0, 10), false),
        (message_id(20_000, 10), false),
        (message_id(20_001, 12), true),
        (message_id(20_002, 13), false),
        (anonymous_id(1, 9), false),
        (anonymous_id(2, 10), false),
    ]
}

/// The text that a script makes.
pub fn text(input: &mut Input<'_>) -> Vec<u8> {
    let (mut frames, mut damages) = (vec![], vec![]);
    let (mut t, mut transfer_ids) = (1_700_000_000_000 * MS, [0_u8; 16]);
    while !input.0.is_empty() && frames.len() < MAX_FRAMES {
        let op = input.byte();
        match op {
            0..128 => {
                let session = usize::from(op % 16);
                let how = input.byte();
                transfer_ids[session] = match how >> 6 {
                    0 | 1 => transfer_ids[session] + 1,
                    2 => transfer_ids[session],
                    _ => input.byte(),
                } & 31;
                let ((id, fd), bus) = (sessions()[session], op >> 6);
                let payload = payload(input, LENGTHS[usize::from(how % 16)]);
                let before = frames.len();
                for data in cut(id, transfer_ids[session], &payload, fd) {
                    t += MS;
                    let flags = if fd { EXTENDED | FD } else { EXTENDED };
                    frames.push(CanFrame {
                        t,
                        bus,
                        id,
                        flags,
                        data,
                    });
                }
                if how & 0x20 != 0 {
                    mix(&mut frames, before);
                }
            }
            128..224 => {
                let from_end = usize::from(input.byte()) + 1;
                let at = frames.len().saturating_sub(from_end);
                damage_frame(&mut frames, op - 128, at, u32::from(input.word()));
            }
            224..240 => t += i64::from(input.byte()) * 20 * MS,
            _ => damages.push((op, input.word(), input.byte())),
        }
    }
    let mut text = log::text(&frames);
    for (kind, at, value) in damages {
        damage_text(&mut text, kind, usize::from(at), value);
    }
    text
}

/// A few bytes of the input, over and over.
fn payload(input: &mut Input<'_>, length: usize) -> Vec<u8> {
    let count = usize::from(input.byte() % 32);
    let pattern = [input.take(count), &[0]].concat();
    pattern.into_iter().cycle().take(length).collect()
}

/// Lets the frames from `start` on take turns with as many before them.
fn mix(frames: &mut [CanFrame], start: usize) {
    let Some(first) = (2 * start).checked_sub(frames.len()) else {
        return;
    };
    let (old, new) = (frames[first..start].to_vec(), frames[start..].to_vec());
    let turns: Vec<CanFrame> = old.into_iter().zip(new).flat_map(|(old, new)| [old, new]).collect();
    let times: Vec<i64> = frames[first..].iter().map(|frame| frame.t).collect();
    for ((frame, turn), t) in frames[first..].iter_mut().zip(turns).zip(times) {
        *frame = CanFrame { t, ..turn };
    }
}
