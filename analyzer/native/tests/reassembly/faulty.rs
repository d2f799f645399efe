//! A sender with the same fault in each of its transfers: believed, so that the fault is told, and not taken for another
//! protocol; and other protocols that count, which are not believed.

use _native::verdict::{flaw, Verdict};

use crate::sender::{anonymous_id, cut, service_id};
use crate::{Bus, ESC};

const START: u8 = 0x80;
const END: u8 = 0x40;
const TOGGLE: u8 = 0x20;
/// Of the node that sends [`ESC`].
const STATUS: u32 = 0x1F01_550A;
/// Of a type without a definition, from that node too.
const UNKNOWN: u32 = 0x1003_E70A;

/// Spoils one frame; false when it is never sent.
type Fault = fn(&mut Vec<u8>) -> bool;

fn tail(data: &mut [u8]) -> &mut u8 {
    data.last_mut().expect("every frame has a tail byte")
}

const FAULTS: [(&str, Fault); 8] = [
    ("toggle 0", |data| {
        *tail(data) &= !TOGGLE;
        true
    }),
    ("toggle 1", |data| {
        *tail(data) |= TOGGLE;
        true
    }),
    ("toggle inverted", |data| {
        *tail(data) ^= TOGGLE;
        true
    }),
    ("no end", |data| {
        *tail(data) &= !END;
        true
    }),
    ("no start", |data| {
        *tail(data) &= !START;
        true
    }),
    ("neither", |data| {
        *tail(data) &= !(START | END);
        true
    }),
    ("last not sent", |data| *tail(data) & (START | END) != END),
    ("first not sent", |data| *tail(data) & (START | END) != START),
];

/// Transfers of which each has the fault.
fn send(bus: &mut Bus, id: u32, ids: std::ops::Range<u8>, size: usize, fault: Fault) {
    for transfer_id in ids {
        for mut data in cut(id, transfer_id, &vec![transfer_id; size], false) {
            if fault(&mut data) {
                bus.frame(id, &data);
            }
        }
    }
}

/// Foreign frames with this identifier.
fn foreign(bus: &Bus, id: u32) -> usize {
    let capture = bus.end();
    (0..capture.frames.len())
        .filter(|&row| capture.frames.id[row] == id && capture.verdict[row] == Verdict::Foreign as u8)
        .count()
}

fn sent(bus: &Bus, id: u32) -> usize {
    let capture = bus.end();
    capture.frames.id.iter().filter(|&&other| other == id).count()
}

/// A node that speaks DroneCAN otherwise.
fn speaker() -> Bus {
    let mut bus = Bus::default();
    bus.transfer(STATUS, 0, b"alive");
    bus
}

#[test]
fn a_proven_node_is_believed_whatever_is_wrong_with_its_frames() {
    for (name, fault) in FAULTS {
        for size in [14, 19, 60, 250] {
            let mut bus = speaker();
            send(&mut bus, ESC, 29..36, size, fault);
            assert!(sent(&bus, ESC) > 6);
            assert_eq!(foreign(&bus, ESC), 0, "{name}, {size} bytes");
        }
    }
}

#[test]
fn single_frames_of_a_proven_node_are_believed_after_a_round() {
    for (name, fault) in [FAULTS[1], FAULTS[3], FAULTS[4], FAULTS[5]] {
        for (count, believed) in [
            (41, true),
            (200, true),
            (40, name != "neither"),
            (3, name != "toggle 1"),
        ] {
            let mut bus = speaker();
            send(&mut bus, ESC, 5..5 + count, 4, fault);
            let expected = if believed { 0 } else { usize::from(count) };
            assert_eq!(foreign(&bus, ESC), expected, "{name}, {count} frames");
        }
    }
}

#[test]
fn one_long_transfer_of_a_proven_node_is_believed_at_the_end() {
    for (name, fault) in [FAULTS[0], FAULTS[1], FAULTS[2]] {
        let mut bus = speaker();
        send(&mut bus, ESC, 3..4, 60, fault);
        assert_eq!((sent(&bus, ESC), foreign(&bus, ESC)), (9, 0), "{name}");
    }
}

#[test]
fn the_source_may_turn_out_to_speak_later() {
    let mut bus = Bus::default();
    send(&mut bus, ESC, 0..40, 14, FAULTS[2].1);
    assert_eq!(foreign(&bus, ESC), 120, "Cyphal");
    bus.transfer(STATUS, 0, b"alive");
    send(&mut bus, ESC, 40..42, 14, FAULTS[2].1);
    assert_eq!(foreign(&bus, ESC), 0);
}

#[test]
fn a_node_of_which_nothing_else_is_known_has_to_count_for_longer() {
    for (name, fault) in FAULTS {
        let cyphal = name == "toggle 1" || name == "toggle inverted" || name == "neither";
        // Starts without ends are legal frames.
        let legal = name == "last not sent" || name == "no end";
        for (count, believed) in [(60, !cyphal), (6, legal)] {
            let mut bus = Bus::default();
            send(&mut bus, ESC, 0..count, 14, fault);
            let expected = if believed { 0 } else { sent(&bus, ESC) };
            assert_eq!(foreign(&bus, ESC), expected, "{name}, {count} transfers");
        }
    }
}

#[test]
fn frames_that_the_recorder_lost_do_not_hide_the_fault() {
    let mut bus = speaker();
    let mut whole = Bus::default();
    send(&mut whole, ESC, 0..100, 14, FAULTS[0].1);
    for row in (0..whole.frames.len()).filter(|row| row % 17 != 5) {
        bus.frame(ESC, whole.frames.data_of(row));
    }
    assert_eq!(foreign(&bus, ESC), 0);
}

#[test]
fn transfers_that_the_recorder_lost_do_not_hide_the_fault() {
    let mut bus = speaker();
    for transfers in [0..3, 4..7, 8..20] {
        send(&mut bus, ESC, transfers, 14, FAULTS[0].1);
    }
    assert_eq!(foreign(&bus, ESC), 0);
}

#[test]
fn frames_that_come_twice_do_not_hide_the_fault() {
    let mut once = Bus::default();
    send(&mut once, ESC, 0..20, 14, FAULTS[0].1);
    let mut bus = Bus::default();
    for row in 0..once.frames.len() {
        bus.frame(ESC, once.frames.data_of(row))
            .frame(ESC, once.frames.data_of(row));
    }
    assert_eq!(foreign(&bus, ESC), 0);
}

#[test]
fn what_was_said_of_the_frames_meanwhile_is_set_right() {
    let mut bus = speaker();
    send(&mut bus, ESC, 0..5, 14, FAULTS[2].1);
    let capture = bus.end();
    let begun = capture.anomaly.iter().filter(|&&bits| bits & flaw::START_TOGGLE != 0);
    assert_eq!(begun.count(), 5);
    assert!(capture.verdict[1..]
        .iter()
        .all(|&verdict| verdict == Verdict::WrongToggle as u8));
}

#[test]
fn an_unknown_type_is_not_believed_for_its_tail_bytes() {
    for (name, fault) in &FAULTS[..6] {
        let mut bus = speaker();
        send(&mut bus, UNKNOWN, 0..60, 14, *fault);
        assert_eq!(foreign(&bus, UNKNOWN), sent(&bus, UNKNOWN), "{name}");
    }
}

/// How many frames are believed of another protocol's last bytes, from a node that speaks DroneCAN besides.
fn believed(id: u32, frames: usize, byte: impl Fn(usize) -> usize) -> usize {
    let mut bus = speaker();
    for at in 0..frames {
        bus.frame(id, &[at as u8, 2, 3, 4, 5, 6, 7, byte(at) as u8]);
    }
    frames - foreign(&bus, id)
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
