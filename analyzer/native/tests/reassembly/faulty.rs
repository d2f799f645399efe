//! A sender with the same fault in each of its transfers: believed, so that the fault is told, and not taken for another
//! protocol.

use _native::verdict::{frame_anomaly, Verdict};

use crate::sender::cut;
use crate::{Bus, ESC};

const START: u8 = 0x80;
const END: u8 = 0x40;
const TOGGLE: u8 = 0x20;
/// Of the node that sends [`ESC`].
const STATUS: u32 = 0x1F01_550A;
/// Of a type without a definition, from that node too.
pub(crate) const UNKNOWN: u32 = 0x1003_E70A;

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
pub(crate) fn foreign(bus: &Bus, id: u32) -> usize {
    let capture = bus.end();
    (0..capture.frames.len())
        .filter(|&row| capture.frames.id[row] == id && capture.verdict[row] == Verdict::Foreign as u8)
        .count()
}

pub(crate) fn sent(bus: &Bus, id: u32) -> usize {
    let capture = bus.end();
    capture.frames.id.iter().filter(|&&other| other == id).count()
}

/// A node that speaks DroneCAN otherwise.
pub(crate) fn speaker() -> Bus {
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
            (41, name != "neither"),
            (200, name != "neither"),
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
    let begun = capture
        .anomaly
        .iter()
        .filter(|&&bits| bits & frame_anomaly::START_TOGGLE != 0);
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

/// Sends whole transfers whose ID counts up with every frame.
fn send_counting(bus: &mut Bus, id: u32, sizes: &[usize]) {
    let mut next = 30;
    for &size in sizes {
        for mut data in cut(id, 0, &vec![7; size], false) {
            *tail(&mut data) |= next & 31;
            next = next.wrapping_add(1);
            bus.frame(id, &data);
        }
    }
}

#[test]
fn a_transfer_id_that_counts_frames_is_a_fault_of_a_proven_node() {
    for sizes in [
        &[14; 6][..],
        &[8; 40],
        &[60],
        &[14, 14],
        &[3, 14, 60, 14, 3, 20],
        &[60; 300],
    ] {
        let mut bus = speaker();
        send_counting(&mut bus, ESC, sizes);
        assert_eq!(foreign(&bus, ESC), 0, "{sizes:?}");
        let mut bus = speaker();
        send_counting(&mut bus, UNKNOWN, &sizes[..sizes.len().min(2)]);
        assert_eq!(foreign(&bus, UNKNOWN), sent(&bus, UNKNOWN), "{sizes:?}");
    }
    let mut alone = Bus::default();
    send_counting(&mut alone, ESC, &[14; 40]);
    assert_eq!(foreign(&alone, ESC), 120);
}
