//! The situations in which receivers differ, each with what the analyzer makes of it. Before each stands a good
//! transfer with transfer ID 4, so that nobody doubts that this is DroneCAN.

use _native::transfers::anomaly::{
    ABANDONED, CAN_FD, CRC, CUT_BY_END, DUPLICATE, DUPLICATE_FRAME, FIRST_TOO_SHORT, FRAME_NOT_FULL, ID_GAP,
    ID_REPEATED, ID_RESTARTED, INTERLEAVED, LAST_EMPTY, LONG, NEEDLESS_MULTI, OTHER_TYPE, PAUSE, PRIORITY_CHANGED,
    SINGLE_TOGGLE, SLOW, TIMEOUT, TOGGLE,
};
use _native::transfers::{Status, NO_GAP, NO_STEP};
use _native::verdict::{frame_anomaly, Verdict};

use crate::capture::Capture;
use crate::sender::{anonymous_id, crc, cut, message_id, signature_of, signatures};
use crate::{Bus, ESC, MS};

use Status::{BadCrc, Interrupted, Ok as Good, Open, TimedOut, TooShort, Unchecked};
use Verdict::{AnonymousMulti, Duplicate, Foreign, NoTail, Orphan, Used, WrongToggle, WrongTransferId};

/// Three frames.
pub(crate) const PAYLOAD: [u8; 14] = *b"a long payload";

/// The good transfer, then the frames that `situation` adds; its verdicts and transfers follow those of the good one.
pub(crate) fn after_a_good_one(
    situation: impl Fn(&mut Bus, &dyn Fn(usize) -> Vec<u8>),
    verdicts: &[Verdict],
    transfers: &[(Status, u32)],
) -> Capture {
    let mut bus = Bus::default();
    bus.transfer(ESC, 4, &PAYLOAD);
    let frames = cut(ESC, 5, &PAYLOAD, false);
    situation(&mut bus, &|at| frames[at].clone());
    let capture = bus.end();
    capture.assert_verdicts(&[&[Used; 3], verdicts].concat());
    capture.assert_transfers(&[&[(Good, 0)], transfers].concat());
    capture
}

/// Only the frames at these places, of a transfer with ID 5 and the good one's payload.
pub(crate) fn parts(places: &[usize], verdicts: &[Verdict], transfers: &[(Status, u32)]) -> Capture {
    let send = |bus: &mut Bus, part: &dyn Fn(usize) -> Vec<u8>| {
        for &at in places {
            bus.frame(ESC, &part(at));
        }
    };
    after_a_good_one(send, verdicts, transfers)
}

#[test]
fn a_whole_transfer_is_good() {
    let capture = parts(&[0, 1, 2], &[Used; 3], &[(Good, 0)]);
    assert_eq!(capture.transfers.payload_of(1), PAYLOAD);
    assert_eq!((capture.transfers.step[0], capture.transfers.gap[0]), (NO_STEP, NO_GAP));
    assert_eq!((capture.transfers.step[1], capture.transfers.gap[1]), (1, 3 * MS));
}

#[test]
fn a_lost_frame_is_one_broken_transfer_whichever_it_was() {
    let lost = parts(&[0, 2], &[Used; 2], &[(Interrupted, TOGGLE | ABANDONED)]);
    assert_eq!(lost.anomaly[3..], [0, frame_anomaly::TOGGLE]);
    assert_eq!(
        lost.transfers.payload_of(1),
        &PAYLOAD[..5],
        "what came before the break"
    );
    parts(&[1, 2], &[Orphan; 2], &[]);
    parts(&[0, 1], &[Used; 2], &[(Open, CUT_BY_END)]);
    let next = |bus: &mut Bus, part: &dyn Fn(usize) -> Vec<u8>| {
        bus.frame(ESC, &part(0)).frame(ESC, &part(1)).transfer(ESC, 6, &PAYLOAD);
    };
    let broken = (Interrupted, ABANDONED);
    after_a_good_one(next, &[Used; 5], &[(Good, 0), broken]);
}

#[test]
fn swapped_frames_break_the_transfer() {
    parts(&[0, 2, 1], &[Used, Used, Orphan], &[(Interrupted, TOGGLE | ABANDONED)]);
}

#[test]
fn copies_of_a_frame_are_dropped() {
    parts(
        &[0, 1, 1, 2],
        &[Used, Used, Duplicate, Used],
        &[(Good, DUPLICATE_FRAME)],
    );
    parts(
        &[0, 0, 1, 2],
        &[Used, Duplicate, Used, Used],
        &[(Good, DUPLICATE_FRAME)],
    );
    parts(&[0, 1, 2, 2], &[Used, Used, Used, Duplicate], &[(Good, 0)]);
}

#[test]
fn transfers_that_interleave_are_both_delivered() {
    let mix = |bus: &mut Bus, part: &dyn Fn(usize) -> Vec<u8>| {
        let other = cut(ESC, 6, b"another payload", false);
        bus.frame(ESC, &part(0)).frame(ESC, &other[0]).frame(ESC, &part(1));
        bus.frame(ESC, &other[1]).frame(ESC, &part(2)).frame(ESC, &other[2]);
    };
    let capture = after_a_good_one(mix, &[Used; 6], &[(Good, INTERLEAVED), (Good, INTERLEAVED)]);
    assert_eq!(capture.transfers.payload_of(1), PAYLOAD);
    assert_eq!(capture.transfers.payload_of(2), b"another payload");
    let sources = |bus: &mut Bus, part: &dyn Fn(usize) -> Vec<u8>| {
        let other = cut(ESC + 1, 5, &PAYLOAD, false);
        for (at, data) in other.iter().enumerate() {
            bus.frame(ESC, &part(at)).frame(ESC + 1, data);
        }
    };
    after_a_good_one(sources, &[Used; 6], &[(Good, 0), (Good, 0)]);
}

#[test]
fn a_frame_of_another_transfer_id_is_astray() {
    let astray = |bus: &mut Bus, part: &dyn Fn(usize) -> Vec<u8>| {
        bus.frame(ESC, &part(0)).frame(ESC, &cut(ESC, 9, &PAYLOAD, false)[1]);
        bus.frame(ESC, &part(1)).frame(ESC, &part(2));
    };
    after_a_good_one(astray, &[Used, WrongTransferId, Used, Used], &[(Good, INTERLEAVED)]);
}

#[test]
fn toggles_that_start_at_one() {
    let inverted = |bus: &mut Bus, part: &dyn Fn(usize) -> Vec<u8>| {
        for at in 0..3 {
            let mut data = part(at);
            *data.last_mut().unwrap() ^= 0x20;
            bus.frame(ESC, &data);
        }
    };
    let capture = after_a_good_one(inverted, &[WrongToggle; 3], &[]);
    assert_eq!(capture.anomaly[3..], [frame_anomaly::START_TOGGLE, 0, 0]);
    let single = |bus: &mut Bus, _: &dyn Fn(usize) -> Vec<u8>| {
        bus.frame(ESC, &[1, 2, 0xE5]);
    };
    after_a_good_one(single, &[Used], &[(Good, SINGLE_TOGGLE)]);
}

#[test]
fn transfer_ids_are_compared_within_the_timeout() {
    let ids = |ids: &[u8], wait: i64, bits: u32| {
        let send = |bus: &mut Bus, _: &dyn Fn(usize) -> Vec<u8>| {
            for (at, &id) in ids.iter().enumerate() {
                bus.wait(wait).transfer(ESC, id, &[at as u8]);
            }
        };
        let rows: Vec<_> = (1..=ids.len())
            .map(|at| (Good, if at == ids.len() { bits } else { 0 }))
            .collect();
        after_a_good_one(send, &vec![Used; ids.len()], &rows);
    };
    ids(&[5, 6], 0, 0);
    ids(&[5, 11], 0, ID_GAP);
    ids(&[5, 3], 0, ID_GAP);
    ids(&[5, 0], 0, ID_RESTARTED);
    ids(&[5, 5], 0, ID_REPEATED);
    ids(&[5, 5], 2500 * MS, 0);
    ids(&[9], 2500 * MS, 0);
}

#[test]
fn an_id_that_has_come_around_again_did_not_stand_still() {
    for (apart, bits) in [(60, ID_REPEATED), (100, ID_GAP), (160, ID_GAP)] {
        for last in [b"more", b"once"] {
            let send = |bus: &mut Bus, _: &dyn Fn(usize) -> Vec<u8>| {
                for id in 5..8 {
                    bus.wait(5 * MS).transfer(ESC, id, b"once");
                }
                bus.wait(apart * MS).transfer(ESC, 7, last);
            };
            let bits = if bits == ID_REPEATED && last == b"once" {
                DUPLICATE
            } else {
                bits
            };
            after_a_good_one(send, &[Used; 4], &[(Good, 0), (Good, 0), (Good, 0), (Good, bits)]);
        }
    }
}

#[test]
fn a_repeated_transfer_is_a_duplicate() {
    let twice = |bus: &mut Bus, _: &dyn Fn(usize) -> Vec<u8>| {
        bus.transfer(ESC, 5, b"once").transfer(ESC, 5, b"once");
    };
    after_a_good_one(twice, &[Used; 2], &[(Good, 0), (Good, DUPLICATE)]);
    parts(&[0, 1, 2, 0, 1, 2], &[Used; 6], &[(Good, 0), (Good, DUPLICATE)]);
}

#[test]
fn priority_may_not_change_but_does() {
    let change = |bus: &mut Bus, part: &dyn Fn(usize) -> Vec<u8>| {
        bus.frame(ESC, &part(0))
            .frame(ESC ^ (1 << 24), &part(1))
            .frame(ESC, &part(2));
    };
    after_a_good_one(change, &[Used; 3], &[(Good, PRIORITY_CHANGED)]);
}

#[test]
fn the_crc_decides_and_a_bad_one_is_decoded_all_the_same() {
    let flipped = |bus: &mut Bus, part: &dyn Fn(usize) -> Vec<u8>| {
        let mut last = part(2);
        last[0] ^= 1;
        bus.frame(ESC, &part(0)).frame(ESC, &part(1)).frame(ESC, &last);
    };
    let capture = after_a_good_one(flipped, &[Used; 3], &[(BadCrc, CRC)]);
    assert_ne!(capture.transfers.crc_wire[1], capture.transfers.crc_here[1]);
    assert_eq!(capture.transfers.crc_wire[1], crc(signature_of(ESC), &PAYLOAD));
    let padded = |bus: &mut Bus, part: &dyn Fn(usize) -> Vec<u8>| {
        let [a, b, tail] = part(2)[..] else {
            panic!("two bytes and a tail")
        };
        bus.frame(ESC, &part(0))
            .frame(ESC, &part(1))
            .frame(ESC, &[a, b, 0, 0, 0, 0, 0, tail]);
    };
    after_a_good_one(padded, &[Used; 3], &[(BadCrc, CRC)]);
}

#[test]
fn types_that_share_an_id_are_told_apart_by_their_crc() {
    let (first, second) = (message_id(1033, 2), message_id(1033, 3));
    assert_ne!(signature_of(first), signature_of(second));
    let capture = Bus::default()
        .transfer(first, 0, &PAYLOAD)
        .transfer(second, 0, &PAYLOAD)
        .end();
    capture.assert_transfers(&[(Good, 0), (Good, OTHER_TYPE)]);
    assert_eq!(capture.transfers.known, [0, 1]);
    assert_eq!(capture.transfers.crc_here[1], crc(signatures(false, 1033)[1], &PAYLOAD));
}

/// A transfer of parts of these lengths, with a good CRC.
fn uneven(lengths: &[usize], status: (Status, u32)) {
    let send = |bus: &mut Bus, _: &dyn Fn(usize) -> Vec<u8>| {
        let total: usize = lengths.iter().sum();
        let payload = &PAYLOAD[..total.saturating_sub(2)];
        let crc = crc(signature_of(ESC), payload).to_le_bytes();
        let bytes: Vec<u8> = crc.iter().chain(payload).copied().take(total).collect();
        let (mut rest, last) = (&bytes[..], lengths.len() - 1);
        for (at, &length) in lengths.iter().enumerate() {
            let (body, behind) = rest.split_at(length);
            let tail = (u8::from(at == 0) << 7) | (u8::from(at == last) << 6) | ((at as u8 & 1) << 5) | 5;
            bus.frame(ESC, &[body, &[tail]].concat());
            rest = behind;
        }
    };
    after_a_good_one(send, &vec![Used; lengths.len()], &[status]);
}

#[test]
fn frames_that_are_not_full() {
    uneven(&[7, 4, 3], (Good, FRAME_NOT_FULL));
    uneven(&[7, 7, 0], (Good, LAST_EMPTY));
    uneven(&[2, 7, 2], (Good, FIRST_TOO_SHORT | FRAME_NOT_FULL));
    uneven(&[7, 2], (Good, NEEDLESS_MULTI));
    uneven(&[1, 0], (TooShort, FIRST_TOO_SHORT | FRAME_NOT_FULL));
    uneven(&[0, 1], (TooShort, FIRST_TOO_SHORT | FRAME_NOT_FULL));
}

#[test]
fn time_within_a_transfer() {
    let pause = |ns: i64| {
        move |bus: &mut Bus, part: &dyn Fn(usize) -> Vec<u8>| {
            bus.frame(ESC, &part(0))
                .wait(ns)
                .frame(ESC, &part(1))
                .frame(ESC, &part(2));
        }
    };
    after_a_good_one(pause(99 * MS), &[Used; 3], &[(Good, 0)]);
    after_a_good_one(pause(100 * MS), &[Used; 3], &[(Good, PAUSE)]);
    after_a_good_one(pause(1000 * MS), &[Used; 3], &[(Good, PAUSE | SLOW)]);
    after_a_good_one(pause(1998 * MS), &[Used; 3], &[(Good, PAUSE | SLOW)]);
    let late = [Used, Used, Orphan];
    after_a_good_one(pause(1999 * MS), &late, &[(TimedOut, TIMEOUT | PAUSE | SLOW)]);
    after_a_good_one(pause(2500 * MS), &[Used, Orphan, Orphan], &[(TimedOut, TIMEOUT)]);
}

#[test]
fn frames_without_a_tail_and_of_others() {
    let mixed = |bus: &mut Bus, part: &dyn Fn(usize) -> Vec<u8>| {
        bus.frame(ESC, &[])
            .remote(ESC)
            .standard(0x123, &part(0))
            .frame(message_id(999, 10), &part(0));
    };
    let capture = after_a_good_one(mixed, &[NoTail, NoTail, Foreign, Foreign], &[]);
    assert_eq!(
        capture.anomaly[3..],
        [frame_anomaly::NO_TAIL, frame_anomaly::REMOTE, 0, 0]
    );
}

#[test]
fn anonymous_frames_are_single() {
    let mut bus = Bus::default();
    for transfer_id in 0..4 {
        bus.transfer(anonymous_id(1, 77 * u16::from(transfer_id)), transfer_id, b"hi");
    }
    bus.transfer(anonymous_id(1, 5), 4, b"not single");
    let capture = bus.end();
    capture.assert_verdicts(&[Used, Used, Used, Used, AnonymousMulti, AnonymousMulti]);
    capture.assert_transfers(&[(Good, 0); 4]);
    assert_eq!(capture.transfers.step, [NO_STEP; 4], "each may be of another node");
}

#[test]
fn long_and_fd_transfers() {
    let payload: Vec<u8> = (0..1100_u32).map(|i| i as u8).collect();
    let capture = Bus::default().transfer(ESC, 0, &payload).end();
    capture.assert_transfers(&[(Good, LONG)]);
    assert_eq!(capture.transfers.payload, payload);
    let mut bus = Bus::default();
    for data in cut(ESC, 0, &payload, true) {
        bus.fd_frame(ESC, &data);
    }
    let capture = bus.end();
    capture.assert_transfers(&[(Good, LONG | CAN_FD)]);
    assert_eq!(capture.transfers.payload[..1100], payload);
    assert!(capture.transfers.payload[1100..].iter().all(|&byte| byte == 0));
    let unknown = message_id(999, 10);
    let mut bus = Bus::default();
    for id in 0..3 {
        bus.transfer(unknown, id, &payload[..20]);
    }
    bus.end().assert_transfers(&[(Unchecked, 0); 3]);
}
