//! Classic pcap: its four kinds of file, its link types, and records that cannot be read.

use _native::frames::{BRS, DLC_SHIFT, ESI, EXTENDED, FD, REMOTE, TX};
use _native::stamp::Stamps;

use crate::{can, can_fd, ending, read, rows, texts, Ends};

const MICROS: u32 = 0xA1B2_C3D4;
const NANOS: u32 = 0xA1B2_3C4D;

pub fn file(ends: Ends, magic: u32, link: u32) -> Vec<u8> {
    let mut file = ends.words(&[magic]);
    file.extend(ends.halves(&[2, 4]));
    file.extend(ends.words(&[0, 0, 65_535, link]));
    file
}

pub fn record(ends: Ends, seconds: u32, fraction: u32, packet: &[u8]) -> Vec<u8> {
    let length = packet.len() as u32;
    [ends.words(&[seconds, fraction, length, length]), packet.to_vec()].concat()
}

/// A capture of microseconds, little-endian, with these packets a second apart.
fn capture(packets: &[Vec<u8>]) -> Vec<u8> {
    let records = (1..).zip(packets).map(|(t, packet)| record(Ends::Little, t, 5, packet));
    [file(Ends::Little, MICROS, 227)]
        .into_iter()
        .chain(records)
        .flatten()
        .collect()
}

#[test]
fn all_byte_orders_and_resolutions_read_alike() {
    for ends in [Ends::Little, Ends::Big] {
        for (magic, fraction, ns, stamps) in [
            (MICROS, 249_713, 249_713_000, Stamps::MICROSECONDS),
            (NANOS, 249_713_001, 249_713_001, Stamps::NANOSECONDS),
        ] {
            let packet = can(0x8504_0601, &[1, 2, 3]);
            let bytes = [file(ends, magic, 227), record(ends, 4_000_000_000, fraction, &packet)].concat();
            let all = read("pcap", &bytes);
            let t = 4_000_000_000_000_000_000 + ns;
            assert_eq!(rows(&all), [(t, "can0".into(), 0x0504_0601, EXTENDED, vec![1, 2, 3])]);
            let mut wanted = Stamps::ABSOLUTE;
            wanted.insert(stamps);
            assert_eq!((all.0.stamps, all.1), (wanted, None));
        }
    }
}

#[test]
fn classic_frames_keep_their_length_codes() {
    let mut raw = can(0x123, &[9; 8]);
    raw[7] = 12;
    let mut junk = can(0x124, &[9; 8]);
    junk[5..8].copy_from_slice(&[0x0F, 0xFF, 0x0C]);
    let mut remote = can(0x4000_0125, &[0; 4]);
    remote.truncate(8);
    let all = read("pcap", &capture(&[raw, junk, remote, can(0x126, &[])]));
    let found: Vec<_> = rows(&all)
        .into_iter()
        .map(|(_, _, id, flags, data)| (id, flags, data.len()))
        .collect();
    let remote = REMOTE | 4 << DLC_SHIFT;
    assert_eq!(
        found,
        [
            (0x123, 12 << DLC_SHIFT, 8),
            (0x124, 0, 8),
            (0x125, remote, 0),
            (0x126, 0, 0)
        ]
    );
}

#[test]
fn can_fd_is_known_by_flag_size_or_data() {
    let stated = [&can_fd(1, 0x07, &[1; 8])[..16], &[]].concat();
    let padded = can_fd(2, 0, &[1; 3]);
    let long = [&can_fd(3, 0x01, &[1; 12])[..20], &[]].concat();
    let mut junk = can(4, &[1; 8]);
    junk[5] = 0x0C;
    let all = read("pcap", &capture(&[stated, padded, long, junk]));
    let found: Vec<_> = rows(&all)
        .into_iter()
        .map(|(_, _, id, flags, data)| (id, flags, data.len()))
        .collect();
    assert_eq!(
        found,
        [(1, FD | BRS | ESI, 8), (2, FD, 3), (3, FD | BRS, 12), (4, 0, 8)]
    );
}

#[test]
fn an_error_frame_is_an_event() {
    let all = read("pcap", &capture(&[can(0x2000_0204, &[0, 0x0C, 0, 0, 0, 0, 96, 135])]));
    let events = &all.0.events;
    assert_eq!(
        (events.class[0], events.tx_errors[0], events.rx_errors[0], events.t[0]),
        (0x204, 96, 135, 1_000_005_000)
    );
    assert_eq!((all.0.counts.error_frames, all.0.events.flags[0]), (1, 0));
    let head = Ends::Big.halves(&[4, 280, 0, 0, 0, 0, 0, 0x0C]);
    let error = [&Ends::Little.words(&[0x2000_0004]), &can(0, &[0; 8])[4..]].concat();
    let cooked = record(Ends::Little, 1, 0, &[head, error].concat());
    let all = read("pcap", &[file(Ends::Little, MICROS, 113), cooked].concat());
    assert_eq!((all.0.events.class[0], all.0.events.flags[0]), (4, TX));
}

#[test]
fn cooked_packets_have_the_order_of_the_file() {
    for ends in [Ends::Little, Ends::Big] {
        let frame = |fd: bool| {
            let rest = if fd { can_fd(0, 0, &[7; 3]) } else { can(0, &[7; 3]) };
            [&ends.words(&[0x8000_0005]), &rest[4..]].concat()
        };
        let cooked =
            |kind, protocol, frame: &[u8]| [&Ends::Big.halves(&[kind, 280, 0, 0, 0, 0, 0, protocol]), frame].concat();
        let bytes = [
            file(ends, MICROS, 113),
            record(ends, 1, 0, &cooked(1, 0x0C, &frame(false))),
            record(ends, 1, 0, &cooked(4, 0x0D, &frame(true)[..11])),
            record(ends, 1, 0, &cooked(0, 0x0800, &[0x45; 90])),
        ];
        let all = read("pcap", &bytes.concat());
        let row = |flags| (1_000_000_000, "can0".to_owned(), 5, flags, vec![7; 3]);
        assert_eq!(rows(&all), [row(EXTENDED), row(EXTENDED | FD | TX)]);
        assert_eq!((all.0.counts.other, all.1), (1, None));

        let cooked2 = |number, kind: u8, protocol| {
            let head = [Ends::Big.halves(&[protocol, 0]), Ends::Big.words(&[number])].concat();
            [&head[..], &[1, 24, kind, 0, 0, 0, 0, 0, 0, 0, 0, 0], &frame(false)].concat()
        };
        let packets = [(3, 4, 0x0C), (7, 1, 0x0C), (3, 1, 0x0C), (2, 0, 0x0806)];
        let records = packets.map(|(number, kind, protocol)| record(ends, 2, 0, &cooked2(number, kind, protocol)));
        let all = read("pcap", &[file(ends, MICROS, 276), records.concat()].concat());
        let found: Vec<_> = rows(&all)
            .into_iter()
            .map(|(_, bus, _, flags, _)| (bus, flags))
            .collect();
        let wanted = [("if3", EXTENDED | TX), ("if7", EXTENDED), ("if3", EXTENDED)];
        assert_eq!(found, wanted.map(|(bus, flags)| (bus.to_owned(), flags)));
        assert_eq!((all.0.counts.other, all.1), (1, None));
    }
}

#[test]
fn packets_that_cannot_be_read_say_why_and_cost_nothing_else() {
    let good = can(1, &[1]);
    let mut snapped = record(Ends::Little, 9, 0, &can(2, &[1; 8])[..10]);
    snapped[12] = 16;
    let mut long = can(0, &[0; 8]);
    long[4] = 77;
    let xl = [&[0, 0, 0, 5, 0x81, 0, 0x10, 0][..], &[0; 300]].concat();
    for (packet, reason) in [
        (snapped[16..].to_vec(), "10 of 16 bytes captured"),
        (can(0x800, &[]), "standard identifier above 7FF"),
        (vec![0; 7], "packet of 7 bytes, shorter than the header of a CAN frame"),
        (long, "less than its 77 bytes of data"),
        (can(2, &[1; 8])[..15].to_vec(), "less than its 8 bytes of data"),
        (
            can_fd(0x4000_0000, 4, &[1; 9]),
            "CAN FD frame marked as remote or error frame",
        ),
        (can_fd(0, 4, &[1; 64])[..71].to_vec(), "less than its 64 bytes of data"),
        (xl, "CAN XL frame"),
        (vec![0; 100], "packet of 100 bytes, longer than a CAN frame"),
    ] {
        let mut middle = record(Ends::Little, 9, 0, &packet);
        if reason.contains("captured") {
            middle = snapped.clone();
        }
        let around = record(Ends::Little, 1, 0, &good);
        let all = read(
            "pcap",
            &[file(Ends::Little, MICROS, 227), around.clone(), middle, around].concat(),
        );
        assert_eq!(rows(&all).len(), 2, "{reason}");
        assert_eq!(texts(&all)[0].split(';').next(), Some(reason));
        assert_eq!(
            (all.0.counts.unreadable, all.0.frames.line, all.1),
            (1, vec![1, 3], None),
            "{reason}"
        );
    }
}

#[test]
fn behind_a_wrong_length_the_next_record_is_found() {
    let packets: Vec<_> = (0..20).map(|id| can(id, &[id as u8; 8])).collect();
    let sound = capture(&packets);
    for (byte, text) in [
        (1, "packet of 272 bytes, longer than a CAN frame; 32 bytes passed over"),
        (2, "record longer than the rest of the capture; 32 bytes passed over"),
        (3, "packet of 16777232 bytes; 32 bytes passed over"),
    ] {
        let mut bytes = sound.clone();
        bytes[24 + 32 + 8 + byte] = 1;
        let all = read("pcap", &bytes);
        assert_eq!((rows(&all).len(), texts(&all)), (19, vec![text.to_owned()]));
        assert_eq!(all.1, None);
    }
    let mut bytes = sound.clone();
    bytes.drain(24 + 40..24 + 45);
    let all = read("pcap", &bytes);
    assert!(rows(&all).iter().map(|row| row.2).eq((0..20).filter(|id| *id != 1)));
    let mut bytes = sound;
    bytes[24 + 19 * 32 + 10] = 0x70;
    let all = read("pcap", &bytes);
    assert_eq!(texts(&all), ["packet of 7340048 bytes; 32 bytes passed over"]);
    assert_eq!(ending(&all), Some((632, "no pcap data that can be read from here on")));
}

#[test]
fn what_only_looks_like_a_record_is_not_taken() {
    let inner = record(Ends::Little, 1, 5, &can(7, &[7; 8]));
    for (at, value, found) in [(0, 1, true), (7, 0x10, false), (12, 17, false), (20, 9, false)] {
        let mut like = inner.clone();
        like[at] = value;
        let mut damaged = record(Ends::Little, 1, 5, &[like, inner.clone()].concat());
        damaged[11] = 0xFF;
        let around = record(Ends::Little, 1, 5, &can(1, &[]));
        let bytes = [file(Ends::Little, MICROS, 227), around.clone(), damaged, around].concat();
        let all = read("pcap", &bytes);
        // The second one inside is sound: there the search ends in any case.
        assert_eq!(rows(&all).len(), if found { 4 } else { 3 }, "byte {at}");
        assert_eq!(all.0.counts.unreadable, 1);
    }
}

#[test]
fn what_is_no_capture_of_can_ends_at_once() {
    let all = read(
        "pcap",
        &[file(Ends::Big, NANOS, 1), record(Ends::Big, 1, 1, &[0; 60])].concat(),
    );
    assert_eq!(ending(&all), Some((0, "link type 1 carries no CAN frames")));
    assert_eq!(ending(&read("pcap", &[1; 24])), Some((0, "not pcap data")));
    assert_eq!(
        ending(&read("pcap", &file(Ends::Big, NANOS, 227)[..23])),
        Some((0, "pcap data ends early"))
    );
    assert_eq!(ending(&read("pcap", &file(Ends::Big, NANOS, 0x0400_00E3))), None);
}

#[test]
fn every_interface_number_is_a_bus_up_to_the_limit() {
    let cooked = |number: u32| {
        let head = [
            &[0, 0x0C, 0, 0],
            &number.to_be_bytes()[..],
            &[1, 24, 1, 0, 0, 0, 0, 0, 0, 0, 0, 0],
        ]
        .concat();
        record(Ends::Big, 1, 0, &[head, can(1, &[])].concat())
    };
    let records: Vec<u8> = (0..300).flat_map(cooked).collect();
    let all = read("pcap", &[file(Ends::Big, MICROS, 276), records].concat());
    assert_eq!((rows(&all).len(), all.0.counts.unreadable), (255, 45));
    assert_eq!(texts(&all)[0], "more than 255 interfaces");
}
