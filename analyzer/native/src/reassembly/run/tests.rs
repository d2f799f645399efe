//! The short way against the long one: they must give the same of any frames.
#![forbid(unsafe_code)]

#[allow(dead_code)]
#[path = "../../../tests/pipeline/random.rs"]
mod random;

use random::Random;

use crate::frames::{Frames, EXTENDED, FD, NO_TIME, REMOTE};
use crate::reassembly::Reassembler;
use crate::wire::{crc, crc_start};

const MS: i64 = 1_000_000;
const SIGNATURE: u64 = 0xA9AF_28AE_A2FB_B254;
/// Two nodes with a type that has one definition, one with two, one with none; a service of a node for itself; an
/// anonymous sender.
const IDS: [u32; 6] = [
    0x1004_0A0A,
    0x1004_0A0B,
    0x1004_090A,
    0x1041_000A,
    0x1801_8A8A,
    0x1E21_4100,
];

fn resolve(_: bool, type_id: u16) -> Vec<u64> {
    match type_id {
        1033 => vec![!SIGNATURE, SIGNATURE],
        0x4100 => vec![],
        _ => vec![SIGNATURE],
    }
}

/// The data fields of one transfer, now and then one that is not as it should be.
fn parts(random: &mut Random, id: u32, transfer_id: u8) -> Vec<Vec<u8>> {
    let lengths = [
        random.below(10),
        random.below(45),
        7 * random.below(5) + 5,
        random.below(4000),
    ];
    let kind = if random.one_in(200) { 3 } else { random.below(3) };
    // Only single frames may be anonymous.
    let length = if id as u8 == 0 { lengths[0] & 7 } else { lengths[kind] };
    let mut bytes: Vec<u8> = (0..length).map(|_| random.below(2) as u8).collect();
    if length > 7 || random.one_in(50) {
        let known = crc(crc_start(SIGNATURE), &bytes).wrapping_add(u16::from(random.one_in(30)));
        bytes.splice(0..0, known.to_le_bytes());
    }
    let full = if random.one_in(40) { 1 + random.below(7) } else { 7 };
    let mut parts: Vec<Vec<u8>> = bytes.chunks(full).map(<[u8]>::to_vec).collect();
    if parts.is_empty() || random.one_in(10) {
        parts.push(vec![]);
    }
    let last = parts.len() - 1;
    for (at, part) in parts.iter_mut().enumerate() {
        let marks = u8::from(at == 0) << 7 | u8::from(at == last) << 6 | (at as u8 & 1) << 5;
        part.push(marks | (transfer_id & 31));
    }
    parts
}

struct Sender {
    id: u32,
    transfer_id: u8,
    sent: Vec<Vec<u8>>,
    waiting: Vec<Vec<u8>>,
}

/// Frames of a few senders at once, one in `rate` of them damaged, lost, repeated, late or of another kind.
fn traffic(random: &mut Random, rate: usize) -> Frames {
    let mut t = [NO_TIME + 1, -MS, 1_700_000_000_000 * MS][random.below(3)];
    let sender = |random: &mut Random| Sender {
        id: IDS[random.below(6)],
        transfer_id: random.below(32) as u8,
        sent: vec![],
        waiting: vec![],
    };
    let mut senders: Vec<Sender> = (0..=random.below(6)).map(|_| sender(random)).collect();
    let (mut frames, mut at) = (Frames::default(), 0);
    for line in 0..2000 {
        t += random.below(3) as i64 * MS;
        // Nearly always the next frame of the same transfer, as arbitration has it.
        if random.one_in(8) || senders[at].waiting.is_empty() {
            at = random.below(senders.len());
        }
        let sender = &mut senders[at];
        if sender.waiting.is_empty() {
            sender.transfer_id = sender.transfer_id.wrapping_add(1);
            sender.waiting = parts(random, sender.id, sender.transfer_id);
            sender.sent.clone_from(&sender.waiting);
        }
        let (mut id, mut flags, mut stamp, mut data) = (sender.id, EXTENDED, t, sender.waiting.remove(0));
        match if random.one_in(rate) { random.below(15) } else { 15 } {
            0 => continue,
            1 => frames.push(t, 0, id, flags, line, &data),
            2 => *data.last_mut().unwrap_or(&mut 0) ^= 1 << random.below(8),
            3 => data[0] ^= 1 << random.below(8),
            4 => data.truncate(random.below(8)),
            5 => drop(data.splice(0..0, [7; 9])),
            6 => id ^= 1 << random.below(29),
            7 => flags ^= [FD, REMOTE, EXTENDED][random.below(3)],
            8 => stamp = NO_TIME,
            9 => stamp = [NO_TIME + MS, i64::MAX, t.saturating_sub(MS)][random.below(3)],
            10 => t += [70, 90, 120, 600, 990, 1100, 2100][random.below(7)] * MS,
            11 => t = t.saturating_sub([1, 300, 1100][random.below(3)] * MS),
            12 => sender.transfer_id = random.below(32) as u8,
            13 => sender.waiting.clear(),
            14 => sender.waiting.clone_from(&sender.sent),
            _ => {}
        }
        frames.push(stamp, u8::from(id == IDS[1]), id, flags, line, &data);
    }
    frames
}

/// Everything that comes of the frames, with the results taken behind the rows of `cuts`.
fn read(frames: &Frames, cuts: &[usize], short: bool) -> Vec<String> {
    let mut reassembler = Reassembler::new(Box::new(resolve));
    let (mut part, mut out) = (Frames::default(), vec![]);
    for row in 0..frames.len() {
        let (t, bus, id, flags) = (frames.t[row], frames.bus[row], frames.id[row], frames.flags[row]);
        part.push(t, bus, id, flags, frames.line[row].into(), frames.data_of(row));
        if row + 1 < frames.len() && !cuts.contains(&row) {
            continue;
        }
        if short {
            reassembler.feed(&part, 0);
        } else {
            reassembler.feed_by(|_, _, row| row, &part, 0);
        }
        out.push(format!("{:?}", reassembler.take()));
        part = Frames::default();
    }
    reassembler.finish();
    out.push(format!("{:?} {:?}", reassembler.take(), reassembler.counts()));
    out
}

#[test]
fn the_short_way_gives_what_the_long_one_gives() {
    let mut random = Random(7);
    for case in 0..200 {
        let frames = traffic(&mut random, [8, 25, 70][case % 3]);
        let cuts: Vec<usize> = (0..random.below(5)).map(|_| random.below(2000)).collect();
        assert!(read(&frames, &cuts, true) == read(&frames, &cuts, false), "case {case}");
    }
}

/// Everything that comes of the frames one by one; if `roused`, with nothing kept of a session but what was made of its
/// first frames.
fn read_each(frames: &Frames, roused: bool) -> String {
    let mut reassembler = Reassembler::new(Box::new(resolve));
    let mut part = Frames::default();
    for row in 0..frames.len() {
        let (t, bus, id, flags) = (frames.t[row], frames.bus[row], frames.id[row], frames.flags[row]);
        part.push(t, bus, id, flags, frames.line[row].into(), frames.data_of(row));
        reassembler.feed(&part, row);
        if roused {
            (0..reassembler.sessions.len()).for_each(|at| drop(reassembler.rouse(at)));
        }
    }
    reassembler.finish();
    format!("{:?} {:?}", reassembler.take(), reassembler.counts())
}

#[test]
fn first_frames_say_of_a_session_what_was_made_of_them() {
    let mut random = Random(11);
    for case in 0..200 {
        let frames = traffic(&mut random, [2, 4, 20][case % 3]);
        assert!(read_each(&frames, false) == read_each(&frames, true), "case {case}");
    }
}

/// Three-frame transfers of one node, a frame each millisecond; another node begins one and falls silent.
fn in_order() -> Frames {
    let payload = *b"a long payload";
    let bytes = [&crc(crc_start(SIGNATURE), &payload).to_le_bytes()[..], &payload].concat();
    let mut frames = Frames::default();
    for line in 0..3000 {
        let (at, transfer_id) = (line % 3, (line / 3) as u8 & 31);
        let part = bytes.chunks(7).nth(at).unwrap_or_default();
        let tail = [0x80, 0x20, 0x40][at] | transfer_id;
        let t = line as i64 * MS;
        frames.push(t, 0, IDS[0], EXTENDED, line as u64, &[part, &[tail]].concat());
        if [9, 10, 11, 15].contains(&line) {
            let tail = if line == 15 { 0x81 } else { [0x80, 0x20, 0x40][line - 9] };
            let part = bytes.chunks(7).nth(line % 3).unwrap_or_default();
            frames.push(t, 0, IDS[1], EXTENDED, line as u64, &[part, &[tail]].concat());
        }
    }
    frames
}

#[test]
fn what_has_timed_out_is_closed_within_a_transfer_of_another() {
    let frames = in_order();
    assert!(read(&frames, &[], true) == read(&frames, &[], false));
}

#[test]
fn frames_in_order_go_the_short_way() {
    let frames = in_order();
    let mut reassembler = Reassembler::new(Box::new(resolve));
    let long = std::cell::Cell::new(0);
    let run = |reassembler: &mut Reassembler, frames: &Frames, row: usize| {
        let next = reassembler.run(frames, row);
        long.set(long.get() + usize::from(next < frames.len()));
        next
    };
    reassembler.feed_by(run, &frames, 0);
    assert_eq!(reassembler.take().transfers.len(), 1002);
    // At first, at each sweep, and where no eight bytes follow.
    assert!(long.get() < 25, "{} frames", long.get());
}
