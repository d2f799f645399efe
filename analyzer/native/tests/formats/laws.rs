//! What holds for any bytes: chunks do not matter, nothing panics, and damage costs little more than where it is.

use crate::pcap::{file, record as pcap_record};
use crate::pcapng::{interface, option, packet, section};
use crate::readers::{check, read, FORMS};
use crate::{can, can_fd, dataflash, dronecan, Ends};

/// A small capture of each format, and how many of its bytes come before the first frame.
fn captures() -> [(&'static str, Vec<u8>, usize); 6] {
    let id = |at: u8| 0x8000_0000 | u32::from(at) << 8;
    let data = |at: u8| vec![at; 8];
    let frames = || {
        (1..=12).map(|at| {
            if at % 4 == 0 {
                can_fd(id(at), 4, &[at; 12])
            } else {
                can(id(at), &data(at))
            }
        })
    };
    let pcap = |ends, magic, link, header: &[u8]| {
        let records = frames().map(|frame| pcap_record(ends, 1_700_000_000, 70, &[header, &frame].concat()));
        [file(ends, magic, link), records.flatten().collect()].concat()
    };
    let pcapng = |ends| {
        let head = [section(ends), interface(ends, 227, &option(ends, 2, b"can3"))].concat();
        let flags = option(ends, 2, &ends.words(&[1]));
        let packets: Vec<u8> = frames()
            .flat_map(|frame| packet(ends, 0, 1 << 50, &frame, &flags))
            .collect();
        (head.len(), [head, packets].concat())
    };
    let ((big, big_bytes), (little, little_bytes)) = (pcapng(Ends::Big), pcapng(Ends::Little));
    let cooked = Ends::Big.halves(&[0x0C, 0, 0, 3, 280, 256, 0, 0, 0, 0]);
    let log = (1..=12).flat_map(|at| dronecan::record(5, u16::from(at % 4 == 0), id(at), &data(at)));
    let mut flash = dataflash::open();
    let head = flash.len();
    for at in 1..=12 {
        flash.extend(dataflash::frame(9, 0, id(at), 8, &data(at)));
        flash.extend(dataflash::other());
    }
    [
        ("pcap", pcap(Ends::Little, 0xA1B2_C3D4, 227, &[]), 24),
        ("pcap", pcap(Ends::Big, 0xA1B2_3C4D, 276, &cooked), 24),
        ("pcapng", big_bytes, big),
        ("pcapng", little_bytes, little),
        ("dataflash", flash, head),
        ("dronecan", log.collect(), 0),
    ]
}

#[test]
fn chunks_do_not_matter() {
    for (form, bytes, _) in captures() {
        for sizes in [&[1][..], &[2], &[7], &[64, 3], &[1, 100]] {
            let (all, damage) = check(form, &bytes, sizes);
            assert_eq!(
                (all.frames.len(), all.counts.unreadable, damage),
                (12, 0, None),
                "{form}"
            );
        }
    }
}

#[test]
fn a_cut_capture_keeps_all_frames_before_the_cut() {
    for (form, bytes, head) in captures() {
        let mut frames = 0;
        for length in 0..bytes.len() {
            let (all, damage) = check(form, &bytes[..length], &[1, 5]);
            let more = all.frames.len() - frames;
            assert!(more <= 1 && (length > head || all.frames.is_empty()));
            frames += more;
            assert_eq!(
                (all.counts.unreadable, all.counts.lines),
                (0, all.counts.frames + all.counts.other)
            );
            // At the end of a record the damage ends, too.
            assert!(
                damage.is_none_or(|damage| damage.reason.ends_with(" ends early"))
                    && (more == 0 || frames == all.frames.len())
            );
        }
        assert!(frames >= 11, "{form}");
    }
}

#[test]
fn a_flipped_byte_costs_at_most_its_record_and_the_next() {
    for (form, bytes, head) in captures() {
        let sound = read(form, &bytes).0;
        let ids = &sound.frames.id;
        for at in 0..bytes.len() {
            for flip in [0x01, 0x10, 0x80, 0xFF] {
                let mut bytes = bytes.clone();
                bytes[at] ^= flip;
                let all = check(form, &bytes, &[3, 1, 70]).0;
                let kept = ids.iter().filter(|id| all.frames.id.contains(id)).count();
                assert!(
                    at < head || kept >= 10,
                    "{form}: {kept} frames left, byte {at} ^ {flip:#X}"
                );
            }
        }
    }
}

#[test]
fn missing_and_foreign_bytes_cost_at_most_two_frames() {
    for (form, bytes, head) in captures() {
        let ids = &read(form, &bytes).0.frames.id;
        for at in head..bytes.len() {
            for (gap, foreign) in [
                (1, &[][..]),
                (9, &[]),
                (0, &[0x5A]),
                (0, &[0; 33]),
                (0, b"\x34\x29\xA3\x95\xC8\x06\0\0\0\x20\0\0\0"),
            ] {
                let (before, behind) = (&bytes[..at], &bytes[(at + gap).min(bytes.len())..]);
                let all = check(form, &[before, foreign, behind].concat(), &[1, 60]).0;
                let kept = ids.iter().filter(|id| all.frames.id.contains(id)).count();
                assert!(
                    kept >= 9,
                    "{form}: {kept} frames left, {gap} bytes less and {foreign:?} more at {at}"
                );
            }
        }
    }
}

#[test]
fn lengths_are_not_believed() {
    for (form, bytes, head) in captures() {
        for at in 0..head + 100 {
            for word in [u32::MAX, 0x7FFF_FFFF, 0x00FF_FFFC, 0x1000_0000, 0] {
                for word in [word.to_le_bytes(), word.to_be_bytes()] {
                    let mut bytes = bytes.clone();
                    bytes[at..at + 4].copy_from_slice(&word);
                    check(form, &bytes, &[1000, 1]);
                }
            }
        }
    }
}

#[test]
fn long_blocks_are_passed_over_within_bounds() {
    let ends = Ends::Little;
    let long = |length: u32, kind| {
        [
            ends.words(&[kind, length]),
            vec![0x11; length as usize - 12],
            ends.words(&[length]),
        ]
        .concat()
    };
    let open = [section(ends), interface(ends, 227, &[])].concat();
    let frame = packet(ends, 0, 1, &can(1, &[]), &[]);
    let kept = check("pcapng", &[&open[..], &long(1 << 24, 9), &frame].concat(), &[1 << 20]);
    assert_eq!((kept.0.counts.other, kept.0.frames.len(), kept.1), (3, 1, None));
    let passed = check(
        "pcapng",
        &[&open[..], &long((1 << 24) + 4, 9), &frame].concat(),
        &[1 << 20],
    );
    assert_eq!(
        (passed.0.counts.unreadable, passed.0.frames.len(), passed.1),
        (1, 1, None)
    );
    // Every block claims to be long, and between them stand sound ones.
    let claims = [ends.words(&[9, (1 << 18) + 8]), frame].concat().repeat(8000);
    let (all, _) = check("pcapng", &[open, claims].concat(), &[4096]);
    assert_eq!((all.frames.len(), all.counts.unreadable), (8000, 8000));
}

#[test]
fn any_bytes_are_something() {
    let mut state = 0x9E37_79B9_7F4A_7C15_u64;
    let mut next = move |limit: usize| {
        state ^= state << 13;
        state ^= state >> 7;
        state ^= state << 17;
        (state >> 20) as usize % limit
    };
    let captures = captures();
    for _ in 0..3000 {
        let (form, bytes, _) = &captures[next(captures.len())];
        let mut bytes = bytes.clone();
        for _ in 0..next(12) {
            let (at, from) = (next(bytes.len()), next(bytes.len()));
            match next(4) {
                0 => bytes[at] = next(256) as u8,
                1 => bytes[at] = bytes[from],
                2 => drop(bytes.drain(at..(at + next(20)).min(bytes.len()))),
                _ => {
                    let part = bytes[from..(from + next(60)).min(bytes.len())].to_vec();
                    bytes.splice(at..at, part);
                }
            }
        }
        check(form, &bytes, &[1 + next(9), 1 + next(90)]);
        check(FORMS[next(4)], &bytes, &[1 + next(9)]);
    }
}
