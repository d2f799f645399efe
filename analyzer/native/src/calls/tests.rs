//! What is said of requests and responses.
#![forbid(unsafe_code)]

use super::*;

const LINK: i64 = 5 << 16 | 0x0A << 8 | 0x0B;

fn calls() -> Calls {
    let limits = Limits {
        answer: 10,
        slow: 5,
        open: 20,
        late: 30,
        waiting: 3,
        links: 2,
    };
    let mut calls = Calls::new(limits);
    calls.hear(11);
    calls
}

fn part(id: i64, t: i64, asks: bool) -> Part {
    Part {
        id,
        first: t,
        t,
        t_end: t + 1,
        transfer_id: 3,
        priority: 30,
        asks,
        whole: true,
    }
}

/// What is said of transfers of one link once all of them are there.
fn said(parts: &[Part]) -> Vec<(Kind, i64, Option<i64>)> {
    let (mut calls, mut events) = (calls(), vec![]);
    for part in parts {
        calls.go_on(part.t);
        calls.add(LINK, *part, part.t, &mut events);
    }
    calls.settle_all(1000, &mut events);
    events.iter().map(|one| (one.kind, one.part, one.other)).collect()
}

#[test]
fn an_answer_in_time_is_nothing_to_say() {
    assert_eq!(said(&[part(0, 100, true), part(1, 104, false)]), []);
    assert_eq!(
        said(&[part(0, 104, false), part(1, 100, true)]),
        [],
        "whichever came out first"
    );
}

#[test]
fn answers_are_slow_repeated_stray_or_missing() {
    let priority = Part {
        priority: 20,
        ..part(2, 103, false)
    };
    assert_eq!(
        said(&[part(0, 100, true), part(1, 107, false)]),
        [(Kind::Slow, 1, Some(0))]
    );
    let twice = [(Kind::Repeated, 2, Some(1)), (Kind::OtherPriority, 2, Some(0))];
    assert_eq!(said(&[part(0, 100, true), part(1, 102, false), priority]), twice);
    assert_eq!(
        said(&[part(0, 100, true), part(1, 121, false)])[0],
        (Kind::Stray, 1, None)
    );
    assert_eq!(
        said(&[part(0, 100, true), part(1, 112, true), part(2, 113, false)]),
        [(Kind::Missed, 0, None)]
    );
    let damaged = Part {
        whole: false,
        ..part(0, 100, true)
    };
    assert_eq!(said(&[damaged]), [], "it needs no answer");
}

#[test]
fn a_request_waits_for_a_sign_of_its_server() {
    for (held, heard) in [(true, true), (false, false), (false, true)] {
        let (mut calls, mut events) = (calls(), vec![]);
        if held {
            calls.hold(LINK);
        }
        if !heard {
            calls.heard.clear();
        }
        calls.add(LINK, part(0, 100, true), 100, &mut events);
        calls.go_on(1000);
        calls.release_all(&mut events);
        assert_eq!(events.len(), usize::from(!held && heard));
    }
}

#[test]
fn what_waits_is_bounded() {
    let (mut calls, mut events) = (calls(), vec![]);
    (0..5).for_each(|k| calls.add(LINK, part(k, 100 + k, true), 100, &mut events));
    let kept = calls.keep(0);
    assert_eq!(kept.new, [2, 3, 4, 1], "three that wait, and a call");
    assert_eq!((kept.slots, kept.left), (vec![0, 1, 2, 3], vec![]));
    (1..3).for_each(|k| calls.add(LINK + (k << 8), part(9 + k, 100, true), 1000, &mut events));
    assert_eq!(calls.talks.len(), 2, "the oldest one made room");
    let kept = calls.keep(10);
    assert_eq!((kept.new, kept.slots.len()), (vec![0, 1], 2));
    assert_eq!(sorted(kept.left), [0, 1, 2, 3]);
    assert_eq!(
        events.len(),
        1,
        "of the last request: each other one was followed by another at once"
    );
}

#[test]
fn slots_are_left_by_what_is_told_no_more() {
    let (mut calls, mut events) = (calls(), vec![]);
    calls.add(LINK, part(0, 100, true), 100, &mut events);
    calls.add(LINK, part(1, 101, true), 100, &mut events);
    assert_eq!(calls.keep(0).slots, [0, 1]);
    calls.add(LINK, part(64, 102, false), 100, &mut events);
    calls.add(LINK, part(65, 103, false), 100, &mut events);
    calls.go_on(133);
    calls.release_all(&mut events);
    assert_eq!(
        events.last().map(|one| (one.kind, one.part, one.other)),
        None,
        "two wait"
    );
    let kept = calls.keep(64);
    assert_eq!(
        (&kept.new, &kept.slots, &kept.left),
        (&vec![1, 0], &vec![0, 2], &vec![0]),
        "the first call is over"
    );
    calls.go_on(135);
    calls.release_all(&mut events);
    assert_eq!(
        events.last().map(|one| (one.kind, one.part, one.other)),
        Some((Kind::Repeated, 0, Some(2))),
        "by their slots"
    );
    assert_eq!(calls.keep(64).left, [0], "but not the response that answers");
    calls.go_on(500);
    calls.release_all(&mut events);
    assert_eq!(sorted(calls.keep(64).left), [1, 2]);
}

fn sorted(mut slots: Vec<i64>) -> Vec<i64> {
    slots.sort_unstable();
    slots
}
