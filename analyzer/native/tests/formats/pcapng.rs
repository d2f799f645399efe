//! pcapng: its blocks in both byte orders, time stamps of every resolution, and damage.

use _native::events::EventKind;
use _native::frames::{EXTENDED, FD, NO_TIME, RX, TX};
use _native::stamp::Stamps;

use crate::{can, can_fd, ending, read, rows, texts, Ends};

const L: Ends = Ends::Little;

pub fn block(ends: Ends, kind: u32, body: &[u8]) -> Vec<u8> {
    let fill = body.len().next_multiple_of(4) - body.len();
    let length = (12 + body.len() + fill) as u32;
    let (head, tail) = (ends.words(&[kind, length]), ends.words(&[length]));
    [&head, body, &vec![0; fill], &tail].concat()
}

pub fn option(ends: Ends, code: u16, value: &[u8]) -> Vec<u8> {
    let fill = value.len().next_multiple_of(4) - value.len();
    [&ends.halves(&[code, value.len() as u16]), value, &vec![0; fill]].concat()
}

pub fn section(ends: Ends) -> Vec<u8> {
    let body = [
        ends.words(&[0x1A2B_3C4D]),
        ends.halves(&[1, 0]),
        vec![0xFF; 8],
        option(ends, 1, b"a comment"),
    ];
    block(ends, 0x0A0D_0D0A, &body.concat())
}

pub fn interface(ends: Ends, link: u16, options: &[u8]) -> Vec<u8> {
    block(
        ends,
        1,
        &[&ends.halves(&[link, 0]), &ends.words(&[0]), options].concat(),
    )
}

pub fn packet(ends: Ends, interface: u32, stamp: u64, packet: &[u8], options: &[u8]) -> Vec<u8> {
    let length = packet.len() as u32;
    let head = ends.words(&[interface, (stamp >> 32) as u32, stamp as u32, length, length]);
    let fill = vec![0; packet.len().next_multiple_of(4) - packet.len()];
    block(ends, 6, &[&head, packet, &fill, options].concat())
}

fn statistics(ends: Ends, interface: u32, options: &[(u16, u64)]) -> Vec<u8> {
    let count = |(code, count): &(u16, u64)| {
        let words = [(count >> 32) as u32, *count as u32];
        option(
            ends,
            *code,
            &ends.words(&if ends == L { [words[1], words[0]] } else { words }),
        )
    };
    let options: Vec<u8> = options.iter().flat_map(count).collect();
    block(ends, 5, &[ends.words(&[interface, 0, 5]), options].concat())
}

/// One frame of an interface with these options: its time, and the kinds of stamps.
fn time(stamp: u64, options: &[u8]) -> (Option<i64>, Stamps) {
    let bytes = [
        section(L),
        interface(L, 227, options),
        packet(L, 0, stamp, &can(1, &[]), &[]),
    ]
    .concat();
    let all = read("pcapng", &bytes);
    if all.0.counts.unreadable == 1 {
        assert_eq!(texts(&all), ["time stamp out of range"]);
    }
    (all.0.frames.t.first().copied(), all.0.stamps)
}

#[test]
fn sections_of_both_byte_orders_share_buses_by_name() {
    let mut bytes = vec![];
    for ends in [Ends::Big, Ends::Little, Ends::Big] {
        bytes.extend(section(ends));
        bytes.extend(interface(ends, 227, &option(ends, 2, b"vcan7")));
        bytes.extend(interface(ends, 227, &[]));
        bytes.extend(interface(ends, 1, &option(ends, 2, b"eth0")));
        bytes.extend(packet(ends, 1, 1, &can(0x8000_0001, &[1]), &[]));
        bytes.extend(packet(ends, 2, 2, &[0x45; 61], &[]));
        let flags = |flags| {
            [
                option(ends, 1, b"comment"),
                option(ends, 2, &ends.words(&[flags])),
                vec![0; 4],
            ]
            .concat()
        };
        bytes.extend(packet(ends, 0, 3, &can_fd(2, 4, &[1; 5])[..13], &flags(0x8000_0002)));
        bytes.extend(packet(ends, 0, 4, &can(3, &[1]), &flags(1)));
    }
    bytes.extend([section(L), interface(L, 1, &[]), packet(L, 0, 2, &[0x45; 61], &[])].concat());
    let all = read("pcapng", &bytes);
    let section = [
        (1000, "can1".to_owned(), 1, EXTENDED, vec![1]),
        (3000, "vcan7".to_owned(), 2, FD | TX, vec![1; 5]),
        (4000, "vcan7".to_owned(), 3, RX, vec![1]),
    ];
    assert_eq!(rows(&all), [section.clone(), section.clone(), section].concat());
    assert_eq!((all.0.counts.other, all.0.counts.lines, all.1), (18, 27, None));
    assert_eq!(all.0.frames.line[..3], [5, 7, 8]);
    let events = &all.0.events;
    assert_eq!(events.kind, [EventKind::FrameComment as u8; 6]);
    assert_eq!(
        (events.line[0], events.text_of(0).as_str(), events.t[0]),
        (7, "comment", 3000)
    );
    assert_eq!(all.0.buses.names(), ["can1", "vcan7"]);
}

#[test]
fn other_blocks_with_packets_are_read_and_the_rest_counted() {
    for ends in [Ends::Little, Ends::Big] {
        let old = [
            ends.halves(&[0, 0xFFFF]),
            ends.words(&[0, 7, 16, 16]),
            can(5, &[1; 8]),
            option(ends, 2, &ends.words(&[2])),
        ];
        let body = [ends.halves(&[227, 0]), ends.words(&[20])].concat();
        let mut bytes = [section(ends), block(ends, 1, &body), block(ends, 2, &old.concat())].concat();
        bytes.extend(block(ends, 3, &[ends.words(&[16]), can(6, &[2])].concat()));
        bytes.extend(block(
            ends,
            3,
            &[ends.words(&[72]), can_fd(7, 4, &[2; 60])[..20].to_vec()].concat(),
        ));
        for kind in [4, 9, 0xA, 0xBAD, 0x4000_0BAD, 0x1234_5678] {
            bytes.extend(block(ends, kind, &[0; 40]));
        }
        let all = read("pcapng", &bytes);
        let wanted = [
            (7000, "can0".to_owned(), 5, TX, vec![1; 8]),
            (NO_TIME, "can0".to_owned(), 6, 0, vec![2]),
        ];
        assert_eq!(rows(&all), wanted);
        assert_eq!(texts(&all), ["20 of 72 bytes captured"]);
        assert!(all.0.stamps.contains(Stamps::NONE) && all.0.counts.other == 8);
    }
}

#[test]
fn time_stamps_are_exact_in_every_resolution() {
    let resolution = |value: u8| option(L, 9, &[value]);
    assert_eq!(time(1_700_000_000_249_713, &[]).0, Some(1_700_000_000_249_713_000));
    assert_eq!(time(7, &resolution(0)).0, Some(7_000_000_000));
    assert_eq!(time(7, &resolution(3)).0, Some(7_000_000));
    let (t, stamps) = time(1_700_000_000_249_713_001, &resolution(9));
    assert_eq!(t, Some(1_700_000_000_249_713_001));
    assert!(stamps.contains(Stamps::NANOSECONDS) && stamps.contains(Stamps::ABSOLUTE));
    assert_eq!(
        time(17_000_000_000_249_713_999, &resolution(12)).0,
        Some(17_000_000_000_249_713)
    );
    assert_eq!(time(u64::MAX, &resolution(29)).0, Some(0));
    assert_eq!(time(u64::MAX, &resolution(127)).0, Some(0));
    assert_eq!(
        time((1_700_000_000 << 20) + 1, &resolution(0x94)).0,
        Some(1_700_000_000_000_000_953)
    );
    assert_eq!(time(3, &resolution(0x80)).0, Some(3_000_000_000));
    assert_eq!(time(1 << 63, &resolution(0xBF)).0, Some(1_000_000_000));
    assert_eq!(time(u64::MAX, &resolution(0xFF)).0, Some(0));
    let both = |seconds: i64| [resolution(9), option(L, 14, &seconds.to_le_bytes())].concat();
    assert_eq!(time(5, &both(-1)).0, Some(-999_999_995));
    assert_eq!(time(5, &both(1_700_000_000)).0, Some(1_700_000_000_000_000_005));
    for far in [
        time(u64::MAX, &[]),
        time(1 << 63, &resolution(9)),
        time(0, &both(i64::MIN)),
        time(145_224_192, &both(-9_223_372_037)),
    ] {
        assert_eq!(far, (None, Stamps::default()));
    }
    assert_eq!(time(145_224_193, &both(-9_223_372_037)).0, Some(i64::MIN + 1));
}

#[test]
fn stamps_of_an_interface_that_says_so_are_no_times() {
    for ends in [Ends::Little, Ends::Big] {
        let named = |about: &[u8]| [option(ends, 2, b"can0"), option(ends, 3, about), option(ends, 0, &[])].concat();
        let marked: [&[u8]; 2] = [b"tailbyte: no time stamps", b"tailbyte: no time stamps\0"];
        for about in marked {
            let bytes = [
                section(ends),
                interface(ends, 227, &named(about)),
                interface(ends, 227, &named(b"no time stamps")),
                packet(ends, 0, u64::MAX, &can(1, &[]), &[]),
                packet(ends, 0, 7, &can(0x2000_0004, &[]), &option(ends, 2, &ends.words(&[2]))),
                statistics(ends, 0, &[(5, 3)]),
            ];
            let all = read("pcapng", &bytes.concat());
            assert_eq!(
                (&all.0.frames.t[..], &all.0.events.t[..]),
                (&[NO_TIME][..], &[NO_TIME; 2][..])
            );
            assert_eq!((all.0.stamps, &all.0.events.flags[..]), (Stamps::NONE, &[TX, 0][..]));
            // The other interface of that name has times, even such as 0.
            let all = read(
                "pcapng",
                &[bytes.concat(), packet(ends, 1, 0, &can(1, &[]), &[])].concat(),
            );
            assert_eq!(
                (&all.0.frames.t[..], all.0.buses.names()),
                (&[NO_TIME, 0][..], &["can0".to_owned()][..])
            );
        }
    }
}

#[test]
fn statistics_tell_drops_once() {
    for ends in [Ends::Little, Ends::Big] {
        let mut bytes = [
            section(ends),
            interface(ends, 227, &option(ends, 2, b"x\0y")),
            interface(ends, 1, &[]),
        ]
        .concat();
        bytes.extend(statistics(ends, 0, &[(4, 900), (5, 3), (7, 4)]));
        bytes.extend(statistics(ends, 0, &[(5, 3), (7, 4)]));
        bytes.extend(statistics(ends, 0, &[(5, u64::MAX), (7, 6)]));
        bytes.extend(statistics(ends, 1, &[(5, 3)]));
        bytes.extend(statistics(ends, 0, &[]));
        bytes.extend(statistics(ends, 2, &[]));
        let all = read("pcapng", &bytes);
        let events = &all.0.events;
        assert_eq!(
            events.kind,
            [
                EventKind::Drop as u8,
                EventKind::Drop as u8,
                EventKind::Unreadable as u8
            ]
        );
        assert_eq!(
            (&events.class[..2], events.t[0], all.0.buses.names()),
            (&[7, u32::MAX][..], 5000, &["x".to_owned()][..])
        );
        assert_eq!(
            texts(&all)[0],
            "3 frames dropped by the interface, 4 by the system so far"
        );
        assert_eq!(texts(&all)[2], "interface 2 is not described");
    }
}

#[test]
fn a_packet_that_cannot_be_read_says_why() {
    let open = [section(L), interface(L, 227, &[])].concat();
    let mut too_long = packet(L, 0, 1, &can(1, &[]), &[]);
    too_long[20] = 17;
    for (block, reason) in [
        (packet(L, 1, 1, &can(1, &[]), &[]), "interface 1 is not described"),
        (packet(L, 0, 1, &can(0x800, &[]), &[]), "standard identifier above 7FF"),
        (too_long, "packet block of 48 bytes"),
        (block(L, 6, &[0; 16]), "packet block of 28 bytes"),
        (block(L, 2, &[0; 16]), "packet block of 28 bytes"),
        (block(L, 3, &[]), "packet block of 12 bytes"),
        (block(L, 1, &[0; 4]), "interface description of 16 bytes"),
    ] {
        let all = read(
            "pcapng",
            &[&open[..], &block, &packet(L, 0, 1, &can(2, &[]), &[])].concat(),
        );
        assert_eq!(
            (texts(&all), rows(&all).len(), all.1),
            (vec![reason.to_owned()], 1, None)
        );
    }
}

#[test]
fn behind_a_damaged_block_the_next_is_found() {
    let blocks: Vec<Vec<u8>> = (0..9)
        .map(|id| packet(L, 0, id.into(), &can(id, &[6; 8]), &[]))
        .collect();
    let open = [section(L), interface(L, 227, &[])].concat();
    let sound = [open.clone(), blocks.concat()].concat();
    let at = open.len() + 2 * 48;
    for (byte, value, text) in [
        (4, 49, "block of 49 bytes"),
        (4, 8, "block of 8 bytes"),
        (4, 52, "block of 52 bytes that ends as one of 6"),
        (44, 44, "block of 48 bytes that ends as one of 44"),
        (5, 0x10, "record longer than the rest of the capture"),
        (7, 0x10, "block of 268435504 bytes"),
    ] {
        let mut bytes = sound.clone();
        bytes[at + byte] = value;
        let all = read("pcapng", &bytes);
        assert_eq!(texts(&all), [format!("{text}; 48 bytes passed over")]);
        assert!(rows(&all).iter().map(|row| row.2).eq((0..9).filter(|id| *id != 2)));
        assert_eq!(all.1, None);
        let all = read("pcapng", &bytes[..at + 48]);
        if byte == 5 || value == 52 {
            assert_eq!(
                (ending(&all), texts(&all)),
                (Some((at as u64, "pcapng data ends early")), vec![])
            );
        } else {
            assert_eq!((ending(&all).map(|end| end.0), texts(&all).len()), (Some(at as u64), 1));
        }
    }
}

#[test]
fn interfaces_keep_their_numbers_behind_a_damaged_description() {
    let names = |name: &[u8]| interface(L, 227, &option(L, 2, name));
    let mut lost = names(b"a");
    lost[4] = 9;
    let packets = [packet(L, 0, 1, &can(1, &[]), &[]), packet(L, 1, 1, &can(2, &[]), &[])].concat();
    let all = read(
        "pcapng",
        &[section(L), lost.clone(), names(b"b"), packets.clone()].concat(),
    );
    assert_eq!(rows(&all), [(1000, "b".into(), 2, 0, vec![])]);
    assert_eq!(texts(&all)[1], "interface 0 is not described");
    // A section whose start is lost has none of the interfaces before it.
    let mut torn = section(L);
    torn[8] = 0;
    let all = read(
        "pcapng",
        &[section(L), names(b"a"), torn, names(b"c"), packets].concat(),
    );
    assert_eq!(rows(&all), [(1000, "c".into(), 1, 0, vec![])]);
    assert_eq!(
        texts(&all),
        [
            "section of unknown byte order; 44 bytes passed over",
            "interface 1 is not described"
        ]
    );
}

#[test]
fn what_is_no_capture_ends_at_once() {
    for bytes in [&[6; 40][..], &block(L, 0x0A0D_0D0A, &[7; 16])] {
        assert_eq!(ending(&read("pcapng", bytes)), Some((0, "not pcapng data")));
    }
    assert_eq!(
        ending(&read("pcapng", &section(L)[..11])),
        Some((0, "pcapng data ends early"))
    );
}
