//! What time stamps count from.

use _native::frames::NO_TIME;
use _native::stamp::Stamps;

use crate::{parse, parse_line, texts};

#[test]
fn small_stamps_count_from_the_first_line_or_from_the_one_before() {
    let log = |stamps: &[&str]| -> String {
        stamps
            .iter()
            .map(|stamp| format!(" ({stamp})  can0  123   [0]\n"))
            .collect()
    };
    let (candump, frames, _) = parse(log(&["000.000000", "000.500000", "000.500000", "002.000000"]).as_bytes());
    assert_eq!(frames.t, [0, 500_000_000, 500_000_000, 2_000_000_000]);
    assert!(candump.stamps().contains(Stamps::ZERO) && !candump.stamps().contains(Stamps::DELTA));

    let mut deltas = log(&["000.000000", "000.500000"]);
    deltas += "# a comment between\n (000.250000)  can0  20000040   [0]\n (000.000001)  can0  123   [0]\n";
    let (candump, frames, events) = parse(deltas.as_bytes());
    assert_eq!(
        (frames.t, events.t),
        (vec![0, 500_000_000, 750_001_000], vec![NO_TIME, 750_000_000])
    );
    assert_eq!((frames.line, events.line), (vec![1, 2, 5], vec![3, 4]));
    assert!(candump.stamps().contains(Stamps::DELTA) && !candump.stamps().contains(Stamps::ZERO));

    // Two sockets may be read out of order, and a second recording begins at zero: neither makes them differences.
    let two =
        log(&["000.100000"]) + " (000.099000)  can1  123   [0]\n" + &log(&["000.200000", "000.000000", "000.100000"]);
    assert_eq!(
        parse(two.as_bytes()).1.t,
        [100_000_000, 99_000_000, 200_000_000, 0, 100_000_000]
    );

    // After 32 stamps the matter is settled.
    let many: Vec<String> = (0..32)
        .map(|second| format!("{second:03}.000000"))
        .chain(["005.000000".to_owned()])
        .collect();
    let (_, frames, _) = parse(log(&many.iter().map(String::as_str).collect::<Vec<_>>()).as_bytes());
    assert_eq!(frames.t[30..], [30_000_000_000, 31_000_000_000, 5_000_000_000]);
}

#[test]
fn rows_that_waited_keep_what_they_hold() {
    let text = b"can0 123#1122\n# first\n (000.500000)  can0  123   [1]  33\n# second\ncan0 123#4455\n (000.250000)  can0  123   [2]  66 77\n";
    let (_, frames, events) = parse(text);
    let data: Vec<&[u8]> = (0..frames.len()).map(|row| frames.data_of(row)).collect();
    assert_eq!(data, [&[0x11, 0x22][..], &[0x33], &[0x44, 0x55], &[0x66, 0x77]]);
    assert_eq!(frames.t, [NO_TIME, 500_000_000, NO_TIME, 750_000_000]);
    assert_eq!(texts(&events), ["# first", "# second"]);
}

#[test]
fn the_kinds_of_time_stamps_are_remembered() {
    let bits = |text: &[u8]| parse_line(text).0.stamps();
    let set = |parts: &[Stamps]| parts.iter().fold(0, |bits, part| bits | part.bits());
    assert_eq!(bits(b"").bits(), 0);
    assert_eq!(
        bits(b"(1.123456) can0 123#").bits(),
        set(&[Stamps::ABSOLUTE, Stamps::MICROSECONDS])
    );
    assert_eq!(
        bits(b"(1.123456789) can0 123#").bits(),
        set(&[Stamps::ABSOLUTE, Stamps::NANOSECONDS])
    );
    assert_eq!(
        bits(b"(2020-12-19 12:04:45.485261) can0 123 [0]").bits(),
        set(&[Stamps::DATE, Stamps::MICROSECONDS])
    );
    assert_eq!(bits(b"can0 123 [0]").bits(), set(&[Stamps::NONE]));
    assert_eq!(
        bits(b"(1.5) can0 123 [0]").bits(),
        set(&[Stamps::ZERO, Stamps::MICROSECONDS])
    );
}
