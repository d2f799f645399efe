//! ArduPilot's dataflash log: descriptions, frames by the names of their columns, gaps and padding.

use _native::frames::{DLC_SHIFT, EXTENDED, FD, REMOTE};
use _native::stamp::Stamps;

use crate::{ending, read, rows, texts};

const CANF: u8 = 200;
const CAFD: u8 = 201;
const MODE: u8 = 7;

pub fn description(kind: u8, length: u8, name: &str, format: &str, columns: &str) -> Vec<u8> {
    let mut body = vec![0; 86];
    (body[0], body[1]) = (kind, length);
    for (at, text) in [(2, name), (6, format), (22, columns)] {
        body[at..at + text.len()].copy_from_slice(text.as_bytes());
    }
    [&[0xA3, 0x95, 128][..], &body].concat()
}

/// The descriptions that ArduPilot writes, that of itself first.
pub fn open() -> Vec<u8> {
    let bytes = "TimeUS,Bus,Id,DLC,B0,B1,B2,B3,B4,B5,B6,B7";
    [
        description(128, 89, "FMT", "BBnNZ", "Type,Length,Name,Format,Columns"),
        description(MODE, 14, "MODE", "QMBB", "TimeUS,Mode,ModeNum,Rsn"),
        description(CANF, 25, "CANF", "QBIBBBBBBBBB", bytes),
        description(
            CAFD,
            81,
            "CAFD",
            "QBIBQQQQQQQQ",
            &bytes.replace(",B", ",D").replace("Dus", "Bus"),
        ),
    ]
    .concat()
}

pub fn frame(us: u64, bus: u8, word: u32, code: u8, data: &[u8]) -> Vec<u8> {
    let (kind, room) = if data.len() > 8 { (CAFD, 64) } else { (CANF, 8) };
    let head = [
        &[0xA3, 0x95, kind][..],
        &us.to_le_bytes(),
        &[bus],
        &word.to_le_bytes(),
        &[code],
    ]
    .concat();
    [&head, data, &vec![0; room - data.len()]].concat()
}

pub fn other() -> Vec<u8> {
    [&[0xA3, 0x95, MODE][..], &[3; 11]].concat()
}

fn log(records: &[Vec<u8>]) -> Vec<u8> {
    [open(), records.concat()].concat()
}

#[test]
fn frames_are_told_from_all_other_records() {
    let long: Vec<u8> = (0..64).collect();
    let all = read(
        "dataflash",
        &log(&[
            other(),
            frame(1_000_001, 0, 0x8500_0001, 3, &[1, 2, 3]),
            other(),
            frame(1_000_002, 2, 0x8500_0002, 15, &long),
            frame(1_000_003, 0, 0x123, 9, &long[..12]),
            frame(1_000_004, 0, 0x4000_0123, 5, &[]),
            frame(1_000_005, 0, 0x124, 14, &[7; 8]),
            frame(1_000_006, 1, 0x2000_0040, 8, &[0; 8]),
        ]),
    );
    let row = |t: i64, bus: &str, id, flags, data: &[u8]| (t * 1000, bus.to_owned(), id, flags, data.to_vec());
    let wanted = [
        row(1_000_001, "can0", 0x0500_0001, EXTENDED, &[1, 2, 3]),
        row(1_000_002, "can2", 0x0500_0002, EXTENDED | FD, &long),
        row(1_000_003, "can0", 0x123, FD, &long[..12]),
        row(1_000_004, "can0", 0x123, REMOTE | 5 << DLC_SHIFT, &[]),
        row(1_000_005, "can0", 0x124, 14 << DLC_SHIFT, &[7; 8]),
    ];
    assert_eq!(rows(&all), wanted);
    assert_eq!((all.0.counts.other, all.0.counts.error_frames, all.1), (6, 1, None));
    assert_eq!((all.0.events.t[0], all.0.events.class[0]), (1_000_006_000, 0x40));
    assert!(all.0.stamps.contains(Stamps::ZERO) && all.0.stamps.contains(Stamps::MICROSECONDS));
    assert_eq!(all.0.frames.line, [6, 8, 9, 10, 11]);
}

#[test]
fn columns_are_found_by_name() {
    let moved = description(90, 26, "CANF", "BBIMhQQ", "DLC,Bus,Id,X,Y,B0,TimeUS");
    let words = [
        &[0xA3, 0x95, 90, 4, 1][..],
        &7_u32.to_le_bytes(),
        &[0; 3],
        &[1, 2, 3, 4, 5, 6, 7, 8],
    ]
    .concat();
    let mut record = [words, 55_u64.to_le_bytes().to_vec()].concat();
    record.truncate(28);
    let mut bytes = [moved, record].concat();
    bytes[4] = 28;
    assert_eq!(
        rows(&read("dataflash", &bytes)),
        [(55_000, "can1".into(), 7, 0, vec![1, 2, 3, 4])]
    );
}

#[test]
fn descriptions_that_cannot_be_understood_are_said() {
    for (format, columns, length) in [
        ("QBIB", "TimeUS,Bus,Id,DLC", 17),
        ("QBIBB", "TimeUS,Bus,Id,DLC,B0", 19),
        ("QBIB?", "TimeUS,Bus,Id,DLC,B0", 18),
        ("QBHBB", "TimeUS,Bus,Id,DLC,B0", 16),
        ("QBIBB", "TimeUS,Bus,Id,DLC,X", 18),
        ("QBIBBB", "TimeUS,Bus,Id,DLC,B0", 18),
        ("QBIBZQ", "TimeUS,Bus,Id,DLC,B0,B1", 89),
        ("", "", 3),
    ] {
        let record = [&[0xA3, 0x95, 90][..], &vec![0; length - 3]].concat();
        let bytes = [description(90, length as u8, "CANF", format, columns), record].concat();
        let all = read("dataflash", &bytes);
        assert_eq!(texts(&all), ["columns of a CAN record not understood"; 2], "{columns}");
        assert_eq!(all.1, None);
    }
    let all = read(
        "dataflash",
        &[description(5, 2, "ABCD", "", ""), other(), open()].concat(),
    );
    assert_eq!(
        texts(&all),
        [
            "record type 5 of 2 bytes",
            "record of unknown type 7; 14 bytes passed over"
        ]
    );
}

#[test]
fn frames_that_cannot_be_read_say_why() {
    for (record, reason) in [
        (frame(u64::MAX, 0, 1, 1, &[1]), "time stamp out of range"),
        (frame(1 << 60, 0, 1, 1, &[1]), "time stamp out of range"),
        (frame(1, 0, 0x800, 1, &[1]), "standard identifier above 7FF"),
        (frame(1, 0, 1, 16, &[1]), "length code 16"),
        (frame(1, 0, 1, 16, &[1; 9]), "length code 16"),
        (
            frame(1, 0, 0x4000_0001, 9, &[1; 9]),
            "CAN FD frame marked as remote or error frame",
        ),
    ] {
        let all = read("dataflash", &log(&[record, frame(1, 0, 1, 1, &[1])]));
        assert_eq!(
            (texts(&all), rows(&all).len(), all.1),
            (vec![reason.to_owned()], 1, None)
        );
    }
    let all = read(
        "dataflash",
        &[
            description(90, 18, "CAFD", "QBIBB", "TimeUS,Bus,Id,DLC,D0"),
            vec![0xA3, 0x95, 90],
            vec![0; 14],
            vec![9],
        ]
        .concat(),
    );
    assert_eq!((texts(&all).len(), rows(&all).len()), (0, 1));
    let short = [vec![0xA3, 0x95, 90], vec![0; 13], vec![9, 9]].concat();
    let all = read(
        "dataflash",
        &[description(90, 18, "CAFD", "QBIBB", "TimeUS,Bus,Id,DLC,D0"), short].concat(),
    );
    assert_eq!(texts(&all), ["less than its 12 bytes of data"]);
}

#[test]
fn garbage_between_records_is_one_event() {
    let one = frame(1, 0, 1, 1, &[1]);
    for (garbage, reason) in [
        (&[0; 70][..], "no record"),
        (b"\xA3", "no record"),
        (b"\xA3\x95\x99....", "record of unknown type 153"),
        (b"....\xA3\xA3\x95.", "no record"),
    ] {
        let all = read("dataflash", &[&open(), &one, garbage, &one].concat());
        assert_eq!(texts(&all), [format!("{reason}; {} bytes passed over", garbage.len())]);
        assert_eq!(
            (rows(&all).len(), all.0.frames.line.clone(), all.1),
            (2, vec![5, 7], None)
        );
    }
}

#[test]
fn padding_at_the_end_is_no_damage() {
    let sound = log(&[frame(1, 0, 1, 1, &[1])]);
    for filler in [0x00, 0xFF] {
        for length in [1, 2, 3, 4000] {
            let all = read("dataflash", &[&sound[..], &vec![filler; length]].concat());
            assert_eq!((all.0.counts.lines, all.0.counts.unreadable, all.1), (5, 0, None));
        }
    }
    let at = sound.len() as u64;
    for rest in [&[0x55; 9][..], &[0, 0, 0xFF], &[0xFF, 0xFF, 1]] {
        let all = read("dataflash", &[&sound[..], rest].concat());
        assert_eq!(texts(&all), [format!("no record; {} bytes passed over", rest.len())]);
        assert_eq!(
            ending(&all),
            Some((at, "no dataflash log that can be read from here on"))
        );
    }
    let all = read("dataflash", &sound[..sound.len() - 1]);
    assert_eq!(
        (ending(&all), all.0.counts.lines),
        (Some((at - 25, "dataflash log ends early")), 4)
    );
}

#[test]
fn every_bus_number_is_a_bus_up_to_the_limit() {
    let records: Vec<Vec<u8>> = (0..=255).map(|bus| frame(1, bus, 1, 0, &[])).collect();
    let all = read("dataflash", &log(&records));
    assert_eq!(
        (rows(&all).len(), texts(&all)),
        (255, vec!["more than 255 interfaces".to_owned()])
    );
}
