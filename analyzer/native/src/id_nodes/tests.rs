//! Nodes whose counters break, step by step.
#![forbid(unsafe_code)]

use super::*;
use crate::diagnosis::counters::Gaps;
use crate::diagnosis::index::owned::Owned;
use crate::diagnosis::index::{Frames, Index};
use step::{Explains, Rule};

const SECOND: i64 = 1_000_000_000;
const PLACE: i64 = 0x1F_0155;
const SENDER: Sender = Sender { bus: 0, node: 0x55 };

/// A step of a session at a tenth of a second, in a transfer of one frame.
fn step(tenths: i64, place: i64, before: u8, id: u8) -> Step {
    Step {
        rule: if id == 0 { Rule::Restarted } else { Rule::Gap },
        late: false,
        early: false,
        astray: false,
        t: tenths * SECOND / 10,
        since: (tenths - 1) * SECOND / 10,
        gap: SECOND / 10,
        code: place >> 8,
        place,
        id,
        before,
        row: tenths as u32,
        frames: Box::new([tenths as u64]),
    }
}

fn around<'a>(batches: &'a [&'a Index], frames_of: &'a dyn Fn(u32) -> Vec<u64>) -> Around<'a> {
    Around {
        frames: Frames(batches),
        gaps: Gaps { start: 0, ends: &[] },
        least: 5,
        frames_of,
    }
}

/// Takes steps and messages of a node in one batch, up to a time.
fn fed(nodes: &mut IdNodes, steps: Vec<Step>, messages: Vec<Message>, batches: &[&Index], end: i64) -> Events {
    let sent = Sent {
        steps,
        messages,
        stated: vec![],
    };
    let frames_of = |row: u32| vec![u64::from(row)];
    nodes.feed(vec![(SENDER, sent)], around(batches, &frames_of), end * SECOND)
}

fn rules(events: &Events) -> Vec<Rule> {
    events.told.iter().map(|(_, one)| one.step.rule).collect()
}

#[test]
fn a_gap_is_held_back_until_nothing_can_explain_it() {
    let mut nodes = IdNodes::default();
    assert!(fed(&mut nodes, vec![step(10, PLACE, 3, 7)], vec![], &[], 2)
        .told
        .is_empty());
    assert!(fed(&mut nodes, vec![], vec![], &[], 6).told.is_empty());
    assert_eq!(rules(&fed(&mut nodes, vec![], vec![], &[], 7)), [Rule::Gap]);
    assert!(nodes.finish().told.is_empty());
}

#[test]
fn what_is_held_at_the_end_is_told() {
    let mut nodes = IdNodes::default();
    fed(&mut nodes, vec![step(10, PLACE, 3, 7)], vec![], &[], 1);
    let told = nodes.finish().told;
    assert_eq!((told.len(), &told[0].1.step.frames[..]), (1, &[10][..]));
}

#[test]
fn transfers_that_changed_places_are_told_once() {
    let mut nodes = IdNodes::default();
    let steps = vec![step(1, PLACE, 5, 7), step(2, PLACE, 7, 6), step(3, PLACE, 6, 8)];
    fed(&mut nodes, steps, vec![], &[], 1);
    let told = nodes.finish().told;
    assert_eq!(told.len(), 1);
    let moved = told[0].1.moved.as_ref().map(|moved| (&moved.behind[..], moved.noted));
    assert_eq!(moved, Some((&[2][..], false)));
}

#[test]
fn a_counter_that_falls_from_the_same_id_wraps_early() {
    let mut nodes = IdNodes::default();
    let steps: Vec<Step> = (1..4).map(|k| step(10 * k, PLACE, 15, 0)).collect();
    let found = fed(&mut nodes, steps, vec![], &[], 4);
    let causes: Vec<&Cause> = found.causes.iter().map(|(_, cause)| cause).collect();
    assert_eq!(causes.len(), 1);
    assert_eq!(
        (&causes[0].explains, &causes[0].frames[..]),
        (&Explains::Wraps(0, 15), &[10, 30][..])
    );
    let other = [15, 14, 15].map(|before| before);
    let steps = (1..4).zip(other).map(|(k, before)| step(10 * k, PLACE, before, 0));
    assert!(fed(&mut IdNodes::default(), steps.collect(), vec![], &[], 4)
        .causes
        .is_empty());
}

#[test]
fn a_session_that_skips_as_many_each_time_never_restarts() {
    let mut nodes = IdNodes::default();
    let steps = vec![step(1, PLACE, 24, 28), step(2, PLACE, 28, 0)];
    fed(&mut nodes, steps, vec![], &[], 1);
    assert_eq!(rules(&nodes.finish()), [Rule::Gap, Rule::Gap]);
    let steps = vec![step(1, PLACE, 24, 0), step(2, PLACE + (1 << 8), 9, 0)];
    fed(&mut nodes, steps, vec![], &[], 1);
    assert_eq!(rules(&nodes.finish()), [Rule::Restarted, Rule::Restarted]);
}

#[test]
fn types_that_count_together_share_a_counter() {
    let messages = |ids: &dyn Fn(u32) -> u8| -> Vec<Message> {
        let message = |row: u32| Message {
            row,
            code: i64::from(row % 3),
            id: ids(row),
            step: 3,
        };
        (0..60).map(message).collect()
    };
    let steps = || (0..60).map(|k| step(k, PLACE + ((k % 3) << 8), k as u8 & 31, (k + 3) as u8 & 31));
    let found = fed(
        &mut IdNodes::default(),
        steps().collect(),
        messages(&|row| row as u8 & 31),
        &[],
        6,
    );
    assert_eq!(found.causes[0].1.explains, Explains::Types(3));
    assert_eq!(found.causes[0].1.frames, [0, 1, 2, 3, 4, 5, 6, 7]);
    assert!(found.told.is_empty());
    let apart = fed(
        &mut IdNodes::default(),
        steps().collect(),
        messages(&|row| (row / 2) as u8 & 31),
        &[],
        6,
    );
    assert!(apart.causes.is_empty());
}

#[test]
fn several_senders_explain_all_steps_of_a_node() {
    let ids: Vec<u8> = (0..20).flat_map(|n| [n, n + 12]).map(|id| id & 31).collect();
    let rows = ids.len();
    let columns = Owned {
        t: (0..rows as i64).map(|k| k * SECOND / 10).collect(),
        bus: vec![0; rows],
        id: vec![PLACE as u32; rows],
        flags: vec![1; rows],
        offsets: (0..=rows as i32).collect(),
        data: ids.iter().map(|id| 0xC0 | id).collect(),
    };
    let index = Index::new(0, Box::new(columns)).unwrap();
    let steps = (1..rows as i64).map(|k| step(k, PLACE, ids[k as usize - 1], ids[k as usize]));
    let mut nodes = IdNodes::default();
    let found = fed(&mut nodes, steps.collect(), vec![], &[&index], 4);
    assert!(matches!(&found.causes[0].1.explains, Explains::ByTurns(_, ids) if ids.len() == 2));
    assert!(found.causes.len() > 1, "it goes on");
    assert!(found.told.is_empty() && nodes.finish().told.is_empty());
}

#[test]
fn a_transfer_that_came_again_is_a_copy() {
    let tails = [5, 6, 5, 7].map(|id| 0xC0 | id);
    let columns = Owned {
        t: (0..4).map(|k| k * SECOND / 10).collect(),
        bus: vec![0; 4],
        id: vec![PLACE as u32; 4],
        flags: vec![1; 4],
        offsets: (0..=4).collect(),
        data: tails.to_vec(),
    };
    let index = Index::new(0, Box::new(columns)).unwrap();
    let mut nodes = IdNodes::default();
    let steps = vec![step(2, PLACE, 6, 5), step(3, PLACE, 5, 7)];
    fed(&mut nodes, steps, vec![], &[&index], 1);
    let told = nodes.finish().told;
    assert_eq!(told.len(), 1);
    assert_eq!((told[0].1.step.rule, told[0].1.step.gap), (Rule::Copied, SECOND / 5));
}

#[test]
fn steps_that_wait_are_limited() {
    let mut nodes = IdNodes::default();
    let steps = (0..1500).map(|k| {
        let mut one = step(1, PLACE, 3, 7);
        one.row = k;
        one
    });
    let found = fed(&mut nodes, steps.collect(), vec![], &[], 1);
    assert_eq!((found.told.len(), nodes.finish().told.len()), (1500 - 1024, 1024));
}
