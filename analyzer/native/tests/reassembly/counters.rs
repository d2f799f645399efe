//! Other protocols that count in their last bytes: none of it is believed.

use _native::verdict::Verdict;

use crate::faulty::{foreign, sent, speaker, UNKNOWN};
use crate::sender::{anonymous_id, service_id};
use crate::{Bus, ESC};

/// How many frames are believed of another protocol's last bytes, from a node that speaks DroneCAN besides.
fn believed(id: u32, frames: usize, byte: impl Fn(usize) -> usize) -> usize {
    let mut bus = speaker();
    for at in 0..frames {
        bus.frame(id, &[at as u8, 2, 3, 4, 5, 6, 7, byte(at) as u8]);
    }
    frames - foreign(&bus, id)
}

#[test]
fn frames_that_count_but_are_not_framed_are_not_believed() {
    let flags: [&[usize]; 6] = [
        &[0x80, 0x60, 0x00],
        &[0x80, 0x20, 0x20, 0x40],
        &[0x80, 0x40],
        &[0xA0, 0x00, 0x60],
        &[0x80, 0x20, 0x80, 0x60],
        &[0x00, 0x20, 0x40],
    ];
    for pattern in flags {
        assert_eq!(
            believed(ESC, 900, |at| pattern[at % pattern.len()] | at & 31),
            0,
            "{pattern:02X?}"
        );
    }
}

#[test]
fn a_counter_of_a_whole_byte_is_none_of_a_known_type_either() {
    for first in [0x00, 0x15, 0x3E, 0x5F, 0x77, 0xA1, 0xBE, 0xE0, 0xFE] {
        for slow in 1..4 {
            assert_eq!(
                believed(ESC, 1500, |at| (first + at / slow) & 0xFF),
                0,
                "from {first:02X}"
            );
            let mut alone = Bus::default();
            for at in 0..1500 {
                alone.frame(ESC, &[1, 2, 3, 4, 5, 6, 7, (first + at / slow) as u8]);
            }
            assert_eq!(foreign(&alone, ESC), 1500, "from {first:02X}, alone");
        }
    }
    let mut bus = Bus::default();
    for at in 0xA0..0x3A0_u16 {
        bus.frame(ESC, &[1, 2, 3, 4, 5, 6, 7, at as u8]);
    }
    bus.transfer(ESC, 4, b"with a good CRC");
    assert!(sent(&bus, ESC) - foreign(&bus, ESC) >= 3, "a valid transfer is");
}

#[test]
fn a_counter_of_five_bits_without_marks_is_not_believed() {
    for flags in [0x00, 0x20] {
        for slow in 1..4 {
            assert_eq!(believed(ESC, 1000, |at| flags | (at / slow) & 31), 0);
        }
    }
}

#[test]
fn counters_of_other_protocols_are_not_believed() {
    for first in (0..256).step_by(16) {
        for (bits, slow) in [
            (2, 1),
            (3, 1),
            (4, 1),
            (6, 1),
            (7, 1),
            (8, 1),
            (4, 3),
            (6, 3),
            (8, 2),
            (8, 3),
        ] {
            let low = (1 << bits) - 1;
            let byte = |at: usize| (first & !low) | ((first + at / slow) & low);
            let single = (0..1000).any(|at| byte(at) & 0xE0 == 0xC0);
            // A capture that begins with legal frames is taken at its word, and so is one that repeats them.
            if matches!(first & 0xE0, 0x80 | 0xC0) || (single && slow > 1) {
                continue;
            }
            let name = format!("{bits} bits from {first:02X}, each {slow} times");
            assert_eq!(believed(UNKNOWN, 1000, byte), 0, "{name}");
            if !single {
                assert_eq!(believed(ESC, 1000, byte), 0, "{name}, of a known type");
            }
        }
    }
}

#[test]
fn a_transfer_id_that_overflows_is_a_fault() {
    // Toggles begin with 1 in every second round.
    let overflows = |at: usize| 0xC0 | ((0x20 + at) & 0x3F);
    assert!(believed(ESC, 300, overflows) >= 256);
}

#[test]
fn slow_signals_and_flags_of_other_protocols_are_not_believed() {
    let signals: [fn(usize) -> usize; 7] = [
        |_| 0xFF,
        |at| (at / 7) & 1,
        |at| [0x00, 0x20, 0x40, 0x60][at / 11 % 4],
        |at| 0x20 * (at % 2),
        |at| (at / 9) & 0x3F,
        |at| 0xF0 | (at % 16),
        |at| (at * at / 50) & 0x7F,
    ];
    for (number, signal) in signals.into_iter().enumerate() {
        assert_eq!(believed(ESC, 1000, signal), 0, "signal {number}");
    }
}

#[test]
fn at_the_end_of_a_capture_all_that_came_must_fit() {
    let last_bytes: [&[usize]; 6] = [
        &[0x05, 0x45, 0x06, 0x46, 0x11, 0x51],
        &[0x05, 0x45, 0x06, 0x06, 0x07, 0x07, 0x08],
        &[0x85, 0x05, 0x85, 0x45],
        &[0x05, 0x05, 0x25, 0x45],
        &[0x01, 0x02, 0x03, 0x04, 0x05],
        &[0x41, 0x42, 0x42, 0x43, 0x44],
    ];
    for bytes in last_bytes {
        assert_eq!(believed(ESC, bytes.len(), |at| bytes[at]), 0, "{bytes:02X?}");
    }
    assert_eq!(believed(ESC, 4, |at| 0x41 + at), 4);
    assert_eq!(believed(ESC, 5, |at| [0x05, 0x45, 0x06, 0x46, 0x07][at]), 5);
}

#[test]
fn anonymous_frames_and_services_of_others_gain_nothing() {
    let mut bus = speaker();
    for at in 0..100_u8 {
        bus.frame(anonymous_id(1, 7), &[1, at & 31]);
        bus.frame(service_id(1, true, 11, 20), &[1, at & 31]);
    }
    assert_eq!(foreign(&bus, anonymous_id(1, 7)), 100);
    assert_eq!(foreign(&bus, service_id(1, true, 11, 20)), 100);
}

#[test]
fn frames_of_a_session_that_counts_are_held_for_a_bounded_time() {
    // As Cyphal counts; nobody knows the node.
    let mut bus = Bus::default();
    for at in 0..1100 {
        bus.frame(ESC, &[0, 0xE0 | (at as u8 & 31)]);
    }
    let verdicts = bus.so_far().verdict;
    let foreign = verdicts.iter().filter(|&&verdict| verdict == Verdict::Foreign as u8);
    assert_eq!(foreign.count(), 1100);
}
