//! Whose traffic is it: what a session has to show before it is believed, and what becomes of its frames meanwhile.

use _native::reassembly::Reassembler;
use _native::transfers::{Status, Transfers};
use _native::verdict::{frame_anomaly, Verdict};

use crate::sender::{anonymous_id, cut, message_id, service_id, signatures};
use crate::{Bus, ESC};

/// Of a type without a definition.
const UNKNOWN: u32 = 0x104E_200A;

/// Used frames and foreign ones.
fn used_and_foreign(bus: &Bus) -> (usize, usize) {
    let capture = bus.end();
    let of = |verdict| capture.verdict.iter().map(|&v| usize::from(v == verdict as u8)).sum();
    (of(Verdict::Used), of(Verdict::Foreign))
}

#[test]
fn frames_that_an_earlier_batch_called_foreign_are_settled() {
    let mut reassembler = Reassembler::new(Box::new(signatures));
    let (mut batches, mut before) = (vec![], vec![]);
    for transfer_id in 30..33 {
        let mut bus = Bus::default();
        bus.transfer(UNKNOWN, transfer_id, b"a multi-frame one");
        reassembler.feed(&bus.frames, 0);
        batches.push(reassembler.take());
        before.push(reassembler.settled_before());
    }
    assert_eq!(before, [0, 6, 9]);
    // Two transfers with the CRC of one type are the proof.
    let verdicts: Vec<_> = batches.iter().map(|batch| batch.verdict.clone()).collect();
    assert_eq!(verdicts, [vec![1; 3], vec![0; 3], vec![0; 3]]);
    assert_eq!(batches[1].settled.frame, [0, 1, 2]);
    assert_eq!(batches[1].settled.verdict, [Verdict::Used as u8; 3]);
    assert!(batches[0].settled.frame.is_empty() && batches[2].settled.frame.is_empty());
    let rows: Vec<_> = batches.iter().map(|batch| batch.transfers.frame.clone()).collect();
    assert_eq!(rows, [vec![], vec![0, 1, 2, 3, 4, 5], vec![6, 7, 8]]);
    assert_eq!(reassembler.counts(), [9, 0, 0, 0, 0, 0, 0, 0]);
}

#[test]
fn the_oldest_frame_that_is_held_is_of_any_session() {
    let mut reassembler = Reassembler::new(Box::new(signatures));
    let mut bus = Bus::default();
    let other = UNKNOWN + 1;
    let mut before = |bus: &Bus, first: usize| {
        reassembler.feed(&bus.frames, first);
        reassembler.settled_before()
    };
    let mut found = vec![];
    for (type_, id) in [
        (other, 0),
        (UNKNOWN, 0),
        (other, 1),
        (UNKNOWN, 1),
        (other, 2),
        (other, 3),
        (UNKNOWN, 2),
    ] {
        let first = bus.frames.len();
        bus.transfer(type_, id, b"x");
        found.push(before(&bus, first));
    }
    assert_eq!(found, [0, 0, 0, 0, 1, 1, 7]);
}

#[test]
fn an_unknown_type_is_believed_after_three_rising_ids_or_two_alike_crcs() {
    let mut bus = Bus::default();
    bus.transfer(UNKNOWN, 31, b"ab").transfer(UNKNOWN, 0, b"cd");
    assert_eq!(used_and_foreign(&bus), (0, 2));
    bus.transfer(UNKNOWN, 1, b"ef");
    assert_eq!(used_and_foreign(&bus), (3, 0));
    let mut bus = Bus::default();
    bus.transfer(UNKNOWN, 7, b"not in a row")
        .transfer(UNKNOWN, 3, b"but of one type");
    assert_eq!(used_and_foreign(&bus), (5, 0));
    let mut bus = Bus::default();
    for (at, id) in [7, 3, 1, 5].into_iter().enumerate() {
        let mut frames = cut(UNKNOWN, id, b"broken CRC", false);
        frames[0][0] ^= 1 << at;
        for data in frames {
            bus.frame(UNKNOWN, &data);
        }
    }
    assert_eq!(used_and_foreign(&bus), (0, 8));
}

#[test]
fn an_unknown_type_without_proof_is_foreign_for_good() {
    let noise = |frames: usize| {
        let mut bus = Bus::default();
        for at in 0..frames {
            bus.frame(UNKNOWN, &[at as u8, 0x00]);
        }
        for id in 0..3 {
            bus.transfer(UNKNOWN, id, b"x");
        }
        used_and_foreign(&bus)
    };
    assert_eq!(noise(61), (3, 0), "61 orphans, and then three in a row");
    assert_eq!(noise(62), (0, 65), "one too many");
}

#[test]
fn a_long_transfer_of_an_unknown_type_is_waited_for() {
    let mut bus = Bus::default();
    for id in [0, 5] {
        bus.transfer(UNKNOWN, id, &[id; 1000]);
    }
    assert_eq!(used_and_foreign(&bus), (2 * 144, 0));
    let endless = |frames: usize| {
        let mut bus = Bus::default();
        bus.frame(UNKNOWN, &[0, 0, 0, 0, 0, 0, 0, 0x80]);
        for at in 1..frames {
            bus.frame(UNKNOWN, &[0, 0, 0, 0, 0, 0, 0, (at as u8 & 1) << 5]);
        }
        for id in 1..4 {
            bus.transfer(UNKNOWN, id, b"x");
        }
        used_and_foreign(&bus)
    };
    assert_eq!(endless(509), (512, 0));
    assert_eq!(endless(510), (0, 513), "but not for ever");
}

#[test]
fn a_known_type_is_taken_at_its_word_until_it_fails() {
    let mut bus = Bus::default();
    bus.frame(ESC, &[1, 2, 3, 4, 5, 6, 7, 8]);
    bus.so_far().assert_verdicts(&[Verdict::Orphan]);
    for at in 0..20 {
        bus.frame(ESC, &[1, 2, 3, 4, 5, 6, 7, at]);
    }
    assert_eq!(used_and_foreign(&bus), (0, 21));
    bus.transfer(ESC, 3, b"single");
    assert_eq!(
        used_and_foreign(&bus),
        (0, 22),
        "once foreign, one frame proves nothing"
    );
    bus.transfer(ESC, 4, b"with a good CRC");
    assert_eq!(used_and_foreign(&bus).0, 4);
}

#[test]
fn services_and_anonymous_frames_need_more() {
    let request = service_id(1, true, 10, 20);
    let mut bus = Bus::default();
    bus.frame(request, &[0x00])
        .transfer(request, 0, b"")
        .frame(request, &[0x00])
        .frame(request, &[0x01]);
    assert_eq!(used_and_foreign(&bus).0, 0, "one against three");
    let mut speaker = Bus::default();
    speaker
        .transfer(ESC, 0, b"a node that is known")
        .frame(request, &[0xC0]);
    speaker.so_far().assert_transfers(&[(Status::Ok, 0), (Status::Ok, 0)]);
    let mut anonymous = Bus::default();
    for id in 0..4 {
        anonymous.so_far().assert_transfers(&[]);
        anonymous.transfer(anonymous_id(1, 99 * u16::from(id)), id, b"x");
    }
    anonymous.so_far().assert_transfers(&[(Status::Ok, 0); 4]);
}

#[test]
fn cyphal_is_noted_once_an_identifier() {
    let mut bus = Bus::default();
    for id in 0..40 {
        for data in cut(ESC, id, b"Cyphal starts with toggle 1", false) {
            let (tail, body) = data.split_last().unwrap();
            bus.frame(ESC, &[body, &[tail ^ 0x20]].concat());
        }
    }
    let capture = bus.end();
    assert_eq!(used_and_foreign(&bus), (0, capture.verdict.len()));
    let noted = capture
        .anomaly
        .iter()
        .filter(|&&bits| bits & frame_anomaly::CYPHAL != 0);
    assert_eq!(noted.count(), 1);
}

#[test]
fn other_protocols_stay_foreign() {
    // J1939: identifiers with priority, page, format and source; the data ends in anything.
    let mut bus = Bus::default();
    for at in 0..200_u32 {
        for id in [0x0CF0_0400, 0x18FE_F100, 0x18FE_EE17, 0x18EA_FF03] {
            let data = at.wrapping_mul(2_654_435_761_u32.rotate_left(id & 7)).to_le_bytes();
            bus.frame(id, &[&data[..], &[0xFF, 0xFF, 0xFF, data[1] | 0x0F]].concat());
        }
    }
    assert_eq!(used_and_foreign(&bus), (0, 800));
    let mut vesc = Bus::default();
    for at in 0..100_u8 {
        vesc.frame(message_id(9, 1), &[0, 0, 1, at, 0, 0, 3, 0xE8]);
    }
    assert_eq!(used_and_foreign(&vesc), (0, 100));
}

#[test]
fn transfers_of_sessions_that_nobody_asks_for_are_counted_and_make_no_rows_but_the_first() {
    let mut bus = Bus::default();
    let other = ESC + 1;
    for transfer_id in 0..10 {
        bus.transfer(ESC, transfer_id, b"of whom it is asked");
        bus.transfer(other, transfer_id, b"of another one");
        bus.frame(other, &[transfer_id | 0xC0])
            .frame(ESC, &[transfer_id | 0x60]);
    }
    let read = |asked: fn(u8) -> bool| {
        let mut reassembler = Reassembler::new(Box::new(signatures));
        reassembler.ask_only(Box::new(move |id| asked(id.src)));
        reassembler.feed(&bus.frames, 0);
        reassembler.finish();
        let (results, unasked) = (reassembler.take(), reassembler.unasked());
        (results, unasked, reassembler.counts())
    };
    let (every, none, counts) = read(|_| true);
    let (some, left_out, recount) = read(|src| src == ESC as u8);
    assert_eq!((none, counts), (0, recount));
    assert_eq!((&some.verdict, &some.anomaly), (&every.verdict, &every.anomaly));
    assert_eq!(some.transfers.len() as u64 + left_out, every.transfers.len() as u64);
    let of = |src: u32, rows: &Transfers| rows.src.iter().filter(|&&other| u32::from(other) == src & 0x7F).count();
    assert_eq!(of(ESC, &some.transfers), of(ESC, &every.transfers));
    assert_eq!((of(other, &some.transfers), of(other, &every.transfers)), (1, 20));
}
