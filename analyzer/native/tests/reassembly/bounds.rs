//! What a hostile capture cannot do: grow a transfer, a session table or a silence without end.

use _native::frames::{Frames, EXTENDED};
use _native::reassembly::{Reassembler, MAX_HELD};
use _native::sessions::MAX_SESSIONS;
use _native::slot::MAX_TRANSFER;
use _native::transfers::{anomaly, Status};
use _native::verdict::{frame_anomaly, Verdict};

use crate::sender::{cut, message_id, signatures};
use crate::{Bus, ESC, MS};

/// A good transfer, then one that never ends, of this many middle frames.
fn endless(body: &[u8], frames: usize) -> Bus {
    let mut bus = Bus::default();
    bus.transfer(ESC, 0, b"a good transfer")
        .frame(ESC, &[body, &[0x81]].concat());
    for at in 1..frames {
        // Too fast for the timeout.
        bus.wait(10_000 - MS)
            .frame(ESC, &[body, &[((at as u8 & 1) << 5) | 1]].concat());
    }
    bus
}

fn assert_cut(bus: &Bus, frames: usize, orphans: usize) {
    let capture = bus.so_far();
    let rows = &capture.transfers;
    assert_eq!(rows.status, [Status::Ok as u8, Status::Interrupted as u8]);
    let bits = anomaly::LIMIT | anomaly::ABANDONED;
    assert_eq!(rows.anomaly[1] & bits, bits);
    assert!(rows.payload_of(1).len() <= MAX_TRANSFER + 7 && rows.frames_of(1).len() == frames);
    let over = capture
        .verdict
        .iter()
        .filter(|&&verdict| verdict == Verdict::Orphan as u8);
    assert_eq!(over.count(), orphans);
}

#[test]
fn a_transfer_has_a_longest_payload() {
    let most = MAX_TRANSFER / 7 + 1;
    assert_cut(&endless(&[9; 7], most + 100), most, 100);
}

#[test]
fn a_transfer_has_most_frames() {
    let most = MAX_TRANSFER + 1;
    assert_cut(&endless(&[], most + 10), most, 10);
}

#[test]
fn every_transfer_id_has_one_slot() {
    let mut bus = Bus::default();
    bus.transfer(ESC, 0, b"a good transfer");
    for round in 0..3 {
        for id in 0..32 {
            bus.frame(ESC, &cut(ESC, id, &[round; 20], false)[0]);
        }
    }
    let capture = bus.end();
    let rows = &capture.transfers;
    let status = |status| -> usize { rows.status.iter().map(|&s| usize::from(s == status as u8)).sum() };
    // Later starts have left all but the last of them behind.
    assert_eq!(
        (status(Status::Ok), status(Status::Interrupted), status(Status::Open)),
        (1, 95, 1)
    );
}

#[test]
fn sessions_beyond_the_limit_are_foreign_and_marked() {
    let mut frames = Frames::default();
    for at in 0..MAX_SESSIONS as u32 + 5 {
        frames.push(
            0,
            0,
            message_id((at >> 6) as u16, (at & 63) as u8 + 1),
            EXTENDED,
            0,
            &[0xC0],
        );
    }
    let known = message_id(341, 1);
    frames.push(0, 0, known, EXTENDED, 0, &[0xC1]);
    frames.push(0, 1, known, EXTENDED, 0, &[0xC1]);
    let mut reassembler = Reassembler::new(Box::new(signatures));
    reassembler.feed(&frames, 0);
    let results = reassembler.take();
    let marked: Vec<_> = (0..)
        .zip(&results.anomaly)
        .filter(|(_, bits)| **bits & frame_anomaly::LIMIT != 0)
        .collect();
    let rows: Vec<usize> = marked.iter().map(|(row, _)| *row).collect();
    let last = MAX_SESSIONS + 6;
    assert_eq!(rows, (MAX_SESSIONS..MAX_SESSIONS + 5).chain([last]).collect::<Vec<_>>());
    assert!(rows.iter().all(|&row| results.verdict[row] == Verdict::Foreign as u8));
    assert_eq!(
        results.verdict[last - 1],
        Verdict::Used as u8,
        "a session that was there goes on"
    );
    assert_eq!(reassembler.counts().iter().sum::<u64>(), frames.len() as u64);
}

#[test]
fn what_timed_out_on_a_silent_session_is_closed_by_the_traffic_of_others() {
    let mut bus = Bus::default();
    bus.transfer(ESC, 0, b"a good transfer")
        .frame(ESC, &cut(ESC, 1, b"a broken transfer", false)[0]);
    let opened = bus.t;
    for id in 0..30 {
        bus.wait(100 * MS).transfer(message_id(341, 20), id, b"alive");
    }
    let capture = bus.so_far();
    let timed_out: Vec<usize> = (0..capture.transfers.len())
        .filter(|&row| capture.transfers.status[row] == Status::TimedOut as u8)
        .collect();
    let [row] = timed_out[..] else { panic!("{timed_out:?}") };
    assert_eq!(
        (capture.transfers.t[row], capture.transfers.t_end[row]),
        (opened, opened)
    );
    assert_eq!(capture.transfers.anomaly[row], anomaly::TIMEOUT);
    assert!(
        row < capture.transfers.len() - 1,
        "as soon as the time has come, not at the end"
    );
    assert_eq!(bus.end().transfers, capture.transfers);
}

#[test]
fn a_capture_without_time_never_times_out() {
    let mut frames = Frames::default();
    for data in cut(ESC, 0, b"a transfer of three", false) {
        frames.push(_native::frames::NO_TIME, 0, ESC, EXTENDED, 0, &data);
    }
    let mut reassembler = Reassembler::new(Box::new(signatures));
    reassembler.feed(&frames, 0);
    reassembler.finish();
    assert_eq!(reassembler.take().transfers.status, [Status::Ok as u8]);
}

#[test]
fn frames_held_back_have_a_limit_for_all_sessions_together() {
    // Unknown types whose transfer IDs never rise: nothing is ever proven, and nothing looks wrong.
    let mut frames = Frames::default();
    let sessions = (MAX_HELD / 60) as u32;
    for _ in 0..61 {
        for at in 0..sessions {
            let id = message_id(40_000 + (at >> 6) as u16, (at & 63) as u8 + 1);
            frames.push(0, 0, id, EXTENDED, 0, &[0xC0]);
        }
    }
    let mut reassembler = Reassembler::new(Box::new(signatures));
    reassembler.feed(&frames, 0);
    reassembler.finish();
    let results = reassembler.take();
    let first = results.anomaly.iter().position(|bits| bits & frame_anomaly::LIMIT != 0);
    assert_eq!(first, Some(MAX_HELD));
    assert!(results.verdict.iter().all(|&verdict| verdict == Verdict::Foreign as u8));
    assert!(results.transfers.is_empty());
}

#[test]
fn one_stamp_far_ahead_does_not_stop_the_clock() {
    let year = 365 * 24 * 3600 * 1000 * MS;
    let mut bus = Bus::default();
    bus.transfer(ESC, 0, b"a good transfer");
    bus.wait(year).transfer(ESC, 1, b"a good transfer").wait(-year);
    bus.frame(ESC, &cut(ESC, 2, b"a good transfer", false)[0]);
    // Another session goes on for three seconds; only the sweep can close the first one's transfer.
    for id in 0..30 {
        bus.wait(100 * MS).transfer(ESC + 1, id, b"a good transfer");
    }
    let rows = bus.so_far().transfers;
    assert!(rows.status.contains(&(Status::TimedOut as u8)));
}
