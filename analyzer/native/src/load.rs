//! How long a frame occupies the bus, in bit times: its bits, the stuffing really needed and the three of the
//! intermission (ISO 11898-1).
//!
//! Classic frames are exact. Of a CAN FD frame that switches its bit rate the second rate is not in any capture: it is
//! taken as [`FD_SPEED`] times the first.
#![forbid(unsafe_code)]

mod stuffing;

use self::stuffing::{lengths, Stuffing};
use crate::frames::{BRS, DLC_SHIFT, EXTENDED, FD, MAX_CLASSIC, REMOTE};

/// Data bits are sent this many times faster than the others where a CAN FD frame switches.
pub const FD_SPEED: u32 = 5;
/// CRC delimiter, acknowledge slot and delimiter, end of frame and intermission.
const TRAILER: u32 = 1 + 1 + 1 + 7 + 3;
const CRC15: u16 = 0x4599;
/// Data lengths that CAN FD has a code for.
const FD_LENGTHS: [usize; 16] = [0, 1, 2, 3, 4, 5, 6, 7, 8, 12, 16, 20, 24, 32, 48, 64];
/// Bytes that the CRC covers at most: a head of 39 bits and 8 bytes of data.
const COVERED: usize = 13;

/// Whole bytes of a classic frame up to its CRC, and one more.
const MOST_BYTES: usize = (39 + 64 + 15) / 8 + 1;
/// Frames whose bits are counted at once.
const SIDE_BY_SIDE: usize = 4;

/// What a byte adds to the CRC, by how many bytes follow it: every place is looked up without waiting for another.
const CRC_TABLE: [[u16; 256]; COVERED] = crc_table();
const fn crc_table() -> [[u16; 256]; COVERED] {
    let mut table = [[0; 256]; COVERED];
    let mut byte = 0;
    while byte < 256 {
        let mut value = (byte as u16) << 7;
        let mut place = 0;
        while place < COVERED {
            let mut bit = 0;
            while bit < 8 {
                let shifted = value << 1;
                value = if value & 0x4000 == 0 { shifted } else { shifted ^ CRC15 } & 0x7FFF;
                bit += 1;
            }
            table[place][byte] = value;
            place += 1;
        }
        byte += 1;
    }
    table
}

/// The start of frame and the identifier as they are sent; SRR and IDE stand between the parts of one of 29 bits.
fn identifier(id: u32, extended: bool) -> u128 {
    let id = u128::from(id);
    if extended {
        id >> 18 << 20 | 0b11 << 18 | id & 0x3_FFFF
    } else {
        id
    }
}

fn crc15(bits: u128) -> u16 {
    let bytes = bits.to_le_bytes();
    CRC_TABLE
        .iter()
        .zip(bytes)
        .fold(0, |value, (place, byte)| value ^ place[usize::from(byte)])
}

/// What is stuffed of a classic frame, from its start to its CRC, and how many bits these are: 54 + 8 n with a 29-bit
/// identifier, 34 + 8 n with 11 bits.
fn classic(id: u32, flags: u16, data: &[u8]) -> (u128, u32) {
    let remote = flags & REMOTE != 0;
    let data = if remote {
        &[]
    } else {
        &data[..data.len().min(MAX_CLASSIC)]
    };
    let said = flags >> DLC_SHIFT & 0xF;
    let code = if said == 0 { data.len() as u16 } else { said };
    let extended = flags & EXTENDED != 0;
    let head = identifier(id, extended);
    // RTR and two more bits of control, then the length; 11 bits of identifier have one reserved bit as well.
    let (mut bits, mut count) = (head << 7 | u128::from(remote) << 6 | u128::from(code), 19);
    if extended {
        count = 39;
    }
    let mut field = [0; MAX_CLASSIC];
    field[MAX_CLASSIC - data.len()..].copy_from_slice(data);
    bits = bits << (8 * data.len()) | u128::from(u64::from_be_bytes(field));
    count += 8 * data.len() as u32;
    (bits << 15 | u128::from(crc15(bits)), count + 15)
}

/// Bit times of a CAN FD frame, at the nominal rate and at the rate of its data phase.
fn flexible(id: u32, flags: u16, data: &[u8]) -> (u32, u32) {
    let (extended, brs) = (flags & EXTENDED != 0, u128::from(flags & BRS != 0));
    let base = identifier(id, extended);
    // Identifier, then RRS, (IDE,) FDF, the reserved bit and BRS, which still has the nominal rate.
    let (head, count) = if extended {
        (base << 4 | 0b0100 | brs, 36)
    } else {
        (base << 5 | 0b0_0100 | brs, 17)
    };
    let code = FD_LENGTHS.iter().position(|&size| size >= data.len()).unwrap_or(15);
    let size = FD_LENGTHS[code];
    let mut stuffing = Stuffing::default();
    stuffing.bits(head, count);
    let nominal = count + stuffing.stuffed;
    // A stuff bit that the very last data bit would bring is the first of the fixed ones of the CRC instead.
    let fields = (0..size).map(|at| data.get(at).copied().unwrap_or(0));
    let mut body = 5;
    if size == 0 {
        stuffing.bits(code as u128 >> 1, 4);
    } else {
        stuffing.bits(code as u128, 5);
        for (at, byte) in fields.enumerate() {
            body += 8;
            if at + 1 == size {
                stuffing.bits(u128::from(byte >> 1), 7);
            } else {
                stuffing.byte(byte);
            }
        }
    }
    let check = 4 + if size <= 16 { 17 } else { 21 };
    let fast = body + stuffing.stuffed - (nominal - count) + check + u32::div_ceil(check, 4);
    (nominal + TRAILER, fast)
}

/// Bit times of one frame at the nominal rate, rounded down.
pub fn bits_of(id: u32, flags: u16, data: &[u8]) -> u16 {
    if flags & FD == 0 {
        let [bits] = lengths([classic(id, flags, data)]);
        return short(bits + TRAILER);
    }
    let (slow, fast) = flexible(id, flags, data);
    short(slow + if flags & BRS == 0 { fast } else { fast / FD_SPEED })
}

fn short(bits: u32) -> u16 {
    u16::try_from(bits).unwrap_or(u16::MAX)
}

/// Classic frames with the same number of whole bytes that wait for others.
#[derive(Clone, Copy, Default)]
struct Waiting {
    rows: [usize; SIDE_BY_SIDE],
    frames: [(u128, u32); SIDE_BY_SIDE],
    count: usize,
}

/// Bit times of every frame; a row without its data counts as empty.
pub fn frame_bits(id: &[u32], flags: &[u16], offsets: &[i32], data: &[u8]) -> Vec<u16> {
    let place = |at: usize| offsets.get(at).and_then(|&o| usize::try_from(o).ok());
    let mut found = vec![0; id.len().min(flags.len())];
    let mut waiting = [Waiting::default(); MOST_BYTES];
    for (row, (&id, &flags)) in id.iter().zip(flags).enumerate() {
        let span = place(row).zip(place(row + 1));
        let own = span.and_then(|(start, end)| data.get(start..end)).unwrap_or(&[]);
        if flags & FD != 0 {
            found[row] = bits_of(id, flags, own);
            continue;
        }
        let frame = classic(id, flags, own);
        let like = &mut waiting[frame.1 as usize / 8];
        like.rows[like.count] = row;
        like.frames[like.count] = frame;
        like.count += 1;
        if like.count == SIDE_BY_SIDE {
            like.count = 0;
            for (row, bits) in like.rows.into_iter().zip(lengths(like.frames)) {
                found[row] = short(bits + TRAILER);
            }
        }
    }
    for like in &waiting {
        for at in 0..like.count {
            let [bits] = lengths([like.frames[at]]);
            found[like.rows[at]] = short(bits + TRAILER);
        }
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sizes_lie_between_no_stuffing_and_the_most() {
        for (flags, fixed) in [(EXTENDED, 67), (0, 47)] {
            for size in 0..=MAX_CLASSIC {
                let data = [0x55; MAX_CLASSIC];
                let bits = usize::from(bits_of(0x155, flags, &data[..size]));
                let least = fixed + 8 * size;
                assert!(
                    (least..=least + (least - 13) / 4).contains(&bits),
                    "{size} bytes: {bits}"
                );
            }
        }
    }

    #[test]
    fn a_remote_frame_has_a_length_but_no_data() {
        let asked = bits_of(0x123, EXTENDED | REMOTE | 8 << DLC_SHIFT, &[]);
        assert!((67..67 + 14).contains(&asked), "{asked}");
    }

    #[test]
    fn a_faster_data_phase_takes_less_time() {
        let slow = bits_of(0x1F04_0A0B, EXTENDED | FD, &[0x5A; 64]);
        let fast = bits_of(0x1F04_0A0B, EXTENDED | FD | BRS, &[0x5A; 64]);
        assert!(slow > 600 && fast < slow / 3, "{slow} {fast}");
    }

    #[test]
    fn frames_side_by_side_are_as_long_as_alone() {
        let (mut id, mut flags, mut offsets, mut data) = (vec![], vec![], vec![0], vec![]);
        let mut random = 1_u32;
        for row in 0..500_u32 {
            random = random.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            id.push(random >> 3);
            flags.push([EXTENDED, EXTENDED, 0, EXTENDED | REMOTE, EXTENDED | FD][(random >> 16) as usize % 5]);
            for byte in 0..random >> 8 & 15 {
                data.push(if row % 3 == 0 { 0 } else { (random >> (byte % 25)) as u8 });
            }
            offsets.push(data.len() as i32);
        }
        let alone: Vec<u16> = (0..id.len())
            .map(|row| {
                bits_of(
                    id[row],
                    flags[row],
                    &data[offsets[row] as usize..offsets[row + 1] as usize],
                )
            })
            .collect();
        assert_eq!(frame_bits(&id, &flags, &offsets, &data), alone);
    }

    #[test]
    fn rows_without_data_are_empty_frames() {
        assert_eq!(
            frame_bits(&[1, 2], &[0, 0], &[0, -1, 9], &[]),
            [bits_of(1, 0, &[]), bits_of(2, 0, &[])]
        );
        assert!(frame_bits(&[], &[], &[], &[]).is_empty());
    }
}
