//! The laws of the MCAP walk on any input: nothing panics, every record is one thing, and rows do not depend on how the
//! records were cut. The input is a script: it chooses a layout, makes valid messages of it, and damages them.
//!
//! `cargo +nightly fuzz run mcap corpus/mcap`
#![no_main]

mod input;
#[path = "../../tests/common/mcap.rs"]
mod mcap;

use _native::frames::MAX_DATA;
use _native::mcap::{Stop, Walk};
use libfuzzer_sys::fuzz_target;

use input::Input;
use mcap::messages::record;
use mcap::{rows, shapes, Row, Sent, Shape};

const CHANNEL: u16 = 3;
const LOG_TIME: u64 = 1_700_000_000_000_000_000;
const MAX_MESSAGES: u8 = 12;
const NAMES: [&str; 6] = [
    "",
    "c",
    "v1",
    "can",
    "can0",
    "an interface with a name longer than 64 bytes, so that its end is cut",
];

fuzz_target!(|data: &[u8]| {
    let mut input = Input(data);
    let shapes = shapes();
    let shape = shapes[usize::from(input.byte()) % shapes.len()];
    let cuts = input.take(6);
    let mut data = vec![];
    let mut expected = vec![];
    let count = input.byte() % (MAX_MESSAGES + 1);
    for _ in 0..count {
        let sent = shape.carried(&sent(&mut input));
        data.extend(record(CHANNEL, LOG_TIME, &shape.message(&sent)));
        expected.push((data.len(), Ok(row(sent))));
    }
    let (whole, stop) = walk(shape, &data);
    assert_eq!(stop, (data.len(), Stop::End));
    assert!(whole.iter().map(|(_, row)| row).eq(expected.iter().map(|(_, row)| row)));
    let first = damage(&mut input, &mut data);
    // Without a script any bytes are a message.
    let extra = record(CHANNEL + u16::from(count == 5), LOG_TIME, input.0);
    data.extend(extra);
    check(shape, &data, &expected, first, cuts);
});

/// What is in front of the first damage is not affected; each way to cut gives the same rows.
fn check(shape: Shape, data: &[u8], expected: &[(usize, Result<Sent, String>)], first: usize, cuts: &[u8]) {
    let (whole, (end, stop)) = walk(shape, data);
    let sound = expected.iter().take_while(|(end, _)| *end <= first);
    for ((_, row), (_, expected)) in whole.iter().zip(sound.clone()) {
        assert_eq!(row, expected);
    }
    assert!(whole.len() >= sound.count());
    let mut started = start(shape);
    let mut cuts = cuts.iter().chain(&[77]).cycle();
    let (mut parts, mut from, mut to) = (vec![], 0, 0);
    loop {
        let cut = usize::from(*cuts.next().unwrap_or(&0));
        to = data.len().min(to + 1 + cut);
        let (used, stop) = started.walk(&data[from..to], 0, 1 + cut % 5);
        from += used;
        if cut % 2 == 1 || stop == Stop::Full {
            parts.extend(rows(&mut started).0);
        }
        let over = matches!(stop, Stop::Opcode | Stop::Broken);
        if over || (to == data.len() && stop != Stop::Full) {
            break;
        }
    }
    parts.extend(rows(&mut started).0);
    assert_eq!((from, parts), (end, whole));
    // Whatever stands behind the first record that is none must not hurt either.
    if stop != Stop::End {
        let mut at = end;
        while at < data.len() {
            at = started.walk(data, at + 1, usize::MAX).0.max(at + 1);
        }
        rows(&mut started);
    }
}

fn start(shape: Shape) -> Walk {
    let mut walk = Walk::default();
    walk.channel(CHANNEL, "announced", shape.layout());
    walk.mark(CHANNEL, shape.marks());
    walk
}

fn walk(shape: Shape, data: &[u8]) -> (Vec<Row>, (usize, Stop)) {
    let mut walk = start(shape);
    let stop = walk.walk(data, 0, usize::MAX);
    (rows(&mut walk).0, stop)
}

fn sent(input: &mut Input<'_>) -> Sent {
    let how = input.byte();
    let seconds = u32::from(input.word()) << (how & 15);
    let length = usize::from(input.byte()) % (MAX_DATA + 1);
    let mut data = input.take(length).to_vec();
    data.resize(length, how);
    Sent {
        t: if how & 16 == 0 {
            0
        } else {
            i64::from(seconds) * 1_000_000_007
        },
        name: NAMES[usize::from(how >> 5) % NAMES.len()].to_owned(),
        id: u32::from(input.word()) << (how & 15) | u32::from(input.byte()),
        flags: input.word() & 0xFF,
        data,
    }
}

/// The row of a frame.
fn row(mut sent: Sent) -> Sent {
    if sent.t == 0 {
        sent.t = LOG_TIME as i64;
    }
    if sent.name.is_empty() || sent.name == "can" {
        "announced".clone_into(&mut sent.name);
    }
    sent.name.truncate(64);
    sent
}

/// Changes some bytes and returns where the first one is.
fn damage(input: &mut Input<'_>, data: &mut Vec<u8>) -> usize {
    let mut first = data.len();
    for _ in 0..input.byte() % 5 {
        if data.is_empty() {
            break;
        }
        let (kind, value) = (input.byte(), input.byte());
        let at = usize::from(input.word()) % data.len();
        first = first.min(at);
        match kind % 6 {
            0 => data[at] = value,
            1 => data[at] ^= 1 << (value % 8),
            2 => drop(data.remove(at)),
            3 => data.insert(at, value),
            4 => drop(data.drain(at..data.len().min(at + usize::from(value)))),
            _ => data[at] = b"{}[],:\"\\0-.eE\x05\x0B\x0C\x80\xFF"[usize::from(value) % 18],
        }
    }
    first
}
