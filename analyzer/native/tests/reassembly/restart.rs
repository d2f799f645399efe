//! A transfer ID that starts again although its last transfer is unfinished.

use _native::transfers::anomaly::{ABANDONED, ID_GAP};
use _native::transfers::Status::{Interrupted, Ok as Good};
use _native::verdict::Verdict::Used;

use crate::receiver::{after_a_good_one, parts, PAYLOAD};
use crate::{Bus, ESC, MS};

#[test]
fn the_same_values_a_round_later_are_no_copy() {
    let round = |bus: &mut Bus, part: &dyn Fn(usize) -> Vec<u8>| {
        bus.frame(ESC, &part(0));
        for id in 6..37 {
            bus.transfer(ESC, id & 31, &PAYLOAD);
        }
        bus.transfer(ESC, 5, &PAYLOAD).transfer(ESC, 6, &PAYLOAD);
    };
    let mut expected = vec![(Good, 0); 34];
    expected[31] = (Interrupted, ABANDONED);
    let capture = after_a_good_one(round, &[Used; 100], &expected);
    assert_eq!(capture.transfers.frames_of(32), [3]);
    assert!(capture.transfers.step[1..].iter().all(|&step| step == 1));
    // The same with nothing but silence in between: 31 are missing.
    let silence = |bus: &mut Bus, part: &dyn Fn(usize) -> Vec<u8>| {
        bus.frame(ESC, &part(0)).wait(90 * MS);
        bus.transfer(ESC, 5, &PAYLOAD);
    };
    let capture = after_a_good_one(silence, &[Used; 4], &[(Interrupted, ABANDONED), (Good, ID_GAP)]);
    assert_eq!(capture.transfers.step[2], 0);
    assert_eq!(capture.transfers.gap[2], 91 * MS);
}

#[test]
fn a_restart_is_measured_from_the_starts_since() {
    let late = |bus: &mut Bus, part: &dyn Fn(usize) -> Vec<u8>| {
        bus.frame(ESC, &part(0)).frame(ESC, &part(1));
        for id in 6..9 {
            bus.transfer(ESC, id, &PAYLOAD);
        }
        bus.transfer(ESC, 5, &PAYLOAD).transfer(ESC, 6, &PAYLOAD);
    };
    let expected = [
        (Good, 0),
        (Good, 0),
        (Good, 0),
        (Interrupted, ABANDONED),
        (Good, ID_GAP),
        (Good, 0),
    ];
    let capture = after_a_good_one(late, &[Used; 17], &expected);
    assert_eq!(capture.transfers.step[5..], [29, 1]);
}

#[test]
fn a_new_start_of_the_same_id_is_a_restart() {
    let capture = parts(&[0, 1, 0, 1, 2], &[Used; 5], &[(Interrupted, ABANDONED), (Good, 0)]);
    assert_eq!(capture.transfers.frames_of(2), [5, 6, 7]);
    assert_eq!(capture.transfers.step[2], 1, "measured from before the attempt");
}
