//! The log of pydronecan's file driver.

use _native::frames::{EXTENDED, FD};
use _native::stamp::Stamps;
use _native::wire::crc;

use crate::{ending, read, rows, texts};

pub fn record(us: u64, flags: u16, word: u32, data: &[u8]) -> Vec<u8> {
    let length = data.len() as u16;
    let words = [
        &[0x34, 0x29][..],
        &us.to_le_bytes(),
        &crc(0xFFFF, data).to_le_bytes(),
        &length.to_le_bytes(),
    ];
    [
        words.concat(),
        flags.to_le_bytes().to_vec(),
        word.to_le_bytes().to_vec(),
        data.to_vec(),
    ]
    .concat()
}

#[test]
fn frames_keep_their_bytes() {
    let long: Vec<u8> = (0..64).collect();
    let bytes = [
        record(1, 0, 0x8500_0001, &[1, 2, 3]),
        record(2, 1, 0x8500_0002, &long),
        record(1 << 40, 0, 0x7FF, &[]),
    ];
    let all = read("dronecan", &bytes.concat());
    let row = |us: i64, id, flags, data: &[u8]| (us * 1000, "can0".to_owned(), id, flags, data.to_vec());
    let wanted = [
        row(1, 0x0500_0001, EXTENDED, &[1, 2, 3]),
        row(2, 0x0500_0002, EXTENDED | FD, &long),
        row(1 << 40, 0x7FF, 0, &[]),
    ];
    assert_eq!((rows(&all), all.1.clone()), (wanted.to_vec(), None));
    assert!(all.0.stamps.contains(Stamps::ZERO) && all.0.stamps.contains(Stamps::MICROSECONDS));
}

#[test]
fn a_record_that_cannot_be_read_costs_no_other() {
    let one = record(5, 0, 1, &[9]);
    let mut wrong = record(5, 0, 1, &[1, 2, 3]);
    wrong[21] ^= 1;
    let mut longer = record(5, 0, 1, &[1, 2, 3]);
    longer[12] = 4;
    let mut long = record(5, 0, 1, &[1, 2, 3]);
    long[12] = 65;
    for (damaged, reason) in [
        (wrong, "wrong CRC"),
        (record(u64::MAX, 0, 1, &[1]), "time stamp out of range"),
        (record(1, 2, 1, &[1]), "unknown flags 2"),
        (record(1, 0, 0x4000_0001, &[1]), "unknown bits above the identifier"),
        (record(1, 0, 0x2000_0001, &[1]), "unknown bits above the identifier"),
        (record(1, 0, 0x800, &[1]), "standard identifier above 7FF"),
        (longer, "wrong CRC; 23 bytes passed over"),
        (long, "65 bytes of data; 23 bytes passed over"),
        (b"4.\x34\x29\x34".to_vec(), "no mark of a record; 5 bytes passed over"),
        (one[1..].to_vec(), "no mark of a record; 20 bytes passed over"),
    ] {
        let all = read("dronecan", &[&one[..], &damaged, &damaged, &one].concat());
        let twice = if reason.contains("; ") { 1 } else { 2 };
        assert_eq!(
            (rows(&all).len(), texts(&all).len(), all.1.clone()),
            (2, twice, None),
            "{reason}"
        );
        let all = read("dronecan", &[&one[..], &damaged, &one].concat());
        assert_eq!(
            (texts(&all), all.0.frames.line.clone()),
            (vec![reason.to_owned()], vec![1, 3])
        );
    }
}

#[test]
fn an_end_is_not_a_damaged_record() {
    let one = record(5, 0, 1, &[9; 8]);
    for length in 1..one.len() {
        let all = read("dronecan", &[&one, &one[..length]].concat());
        assert_eq!(
            (ending(&all), all.0.counts.lines),
            (Some((28, "pydronecan log ends early")), 1)
        );
    }
    let mut wrong = one.clone();
    wrong[27] ^= 1;
    let all = read("dronecan", &[&one[..], &wrong].concat());
    assert_eq!((texts(&all), all.1), (vec!["wrong CRC".to_owned()], None));
    let all = read("dronecan", &[&one[..], &[7; 50]].concat());
    assert_eq!(texts(&all), ["no mark of a record; 50 bytes passed over"]);
    assert_eq!(
        ending(&all),
        Some((28, "no pydronecan log that can be read from here on"))
    );
}
