//! What goes on with last runs, and what is left.
#![forbid(unsafe_code)]

use super::{Joins, LastRun, LastRuns};
use crate::runs::tests::of as about;
use crate::runs::{About, Apart, Groups, Place};

const PAUSE: Apart = Apart { pause: 10, piece: 0 };
const PLAIN: Joins = Joins {
    close: PAUSE,
    crowded: false,
};

fn run(first: i64, last: i64, full: Option<Place>) -> LastRun {
    LastRun {
        first: (first, 0),
        last: (last, 0),
        full,
    }
}

/// Last runs of one key, of node 5 and key 1, and what is left of rows at some times that are of it.
fn left(known: LastRun, joins: Option<Joins>, t: &[i64]) -> (LastRuns, Vec<i64>) {
    let mut runs = LastRuns::new(1);
    let number = runs.add();
    runs.know(4, (0, 5, 7, 1), number);
    runs.tell(number, Some(known));
    let place = t.iter().map(|&t| (t, 1)).collect();
    let groups = Groups::of(&vec![about(5, 1); t.len()], place, PAUSE);
    let (left, _) = runs.count(&groups, 4, None, joins);
    let first = left
        .iter()
        .flat_map(|one| one.pieces.iter().map(|piece| piece.first.0))
        .collect();
    (runs, first)
}

#[test]
fn what_goes_on_with_a_full_run_is_counted() {
    let full = Some((2, 0));
    let (mut runs, first) = left(run(0, 5, full), Some(PLAIN), &[8, 9, 30]);
    assert_eq!((first, runs.counted()), (vec![30], 1));
    assert_eq!((runs.take_changed(), runs.take_changed()), (vec![0], vec![]));
    assert_eq!((runs.take(0), runs.take(0)), (Some((2, (9, 1))), None));
    let (mut runs, first) = left(run(0, 50, full), Some(PLAIN), &[8]);
    assert_eq!((first, runs.take(0)), (vec![], Some((1, (50, 0))))); // inside of it
}

#[test]
fn what_may_be_an_example_or_begins_a_run_is_left() {
    let is_left = |known: LastRun, t: i64| left(known, Some(PLAIN), &[t]).1 == vec![t];
    assert!(is_left(run(0, 5, None), 8));
    assert!(is_left(run(0, 5, Some((9, 0))), 8));
    assert!(is_left(run(0, 5, Some((2, 0))), 16));
    assert!(is_left(run(9, 9, Some((9, 0))), 8));
    assert!(is_left(run(i64::MIN, i64::MIN, Some((i64::MIN, 0))), 1));
    assert!(!is_left(run(0, 5, Some((2, 0))), 15));
}

#[test]
fn what_comes_behind_a_piece_that_is_left_is_left_too() {
    let (_, first) = left(run(0, 90, Some((25, 0))), Some(PLAIN), &[20, 40, 60]);
    assert_eq!(first, vec![20, 40, 60]);
    let (_, first) = left(run(0, 90, Some((2, 0))), None, &[20, 40]);
    assert_eq!(first, vec![20, 40]);
}

#[test]
fn in_a_crowd_no_pause_ends_a_run_until_something_is_left() {
    let mut runs = LastRuns::new(1);
    for node in [5, 6, 8] {
        let number = runs.add();
        runs.know(0, (0, node, 7, 0), number);
        runs.tell(number, Some(run(0, 5, None)));
    }
    let rows = [about(5, 0), about(6, 0), about(7, 0), about(8, 0)];
    let groups = Groups::of(&rows, vec![(900, 1); 4], PAUSE);
    let crowd = Joins { crowded: true, ..PLAIN };
    let (left, _) = runs.count(&groups, 0, None, Some(crowd));
    let left: Vec<_> = left.iter().map(|one| (one.group, one.known)).collect();
    assert_eq!(left, vec![(2, None), (3, Some(2))]);
}

#[test]
fn what_is_not_kept_apart_is_told() {
    let mut runs = LastRuns::new(1);
    runs.leave_out(4, (0, 5, 7));
    let groups = Groups::of(&[about(5, 1), about(6, 2)], vec![(9, 1); 2], PAUSE);
    assert_eq!(runs.keys(&groups, 4), vec![None, Some((2, 1))]);
    let (left, beyond) = runs.count(&groups, 4, None, Some(PLAIN));
    let left: Vec<_> = left.iter().map(|one| (one.group, one.pieces.len())).collect();
    assert_eq!((left, beyond), (vec![(1, 1)], [vec![0], vec![], vec![], vec![]]));
    runs.leave_out(4, (0, 6, 7));
    assert_eq!(runs.keys(&groups, 4), vec![Some((1, 0)), None]); // forgotten, and asked for again
}

#[test]
fn pieces_of_time_end_runs_and_keys_may_be_others() {
    let mut runs = LastRuns::new(1);
    let number = runs.add();
    let noted = About {
        noted: true,
        ..about(5, 3)
    };
    runs.know(2, (0, 5, 7, 1), number);
    runs.tell(number, Some(run(0, 5, Some((2, 0)))));
    let groups = |t: i64| Groups::of(&[noted], vec![(t, 1)], PAUSE);
    let pieces = Joins {
        close: Apart { pause: 10, piece: 10 },
        crowded: false,
    };
    let mut known = |t: i64, keys: Option<&[i64]>| {
        let (left, _) = runs.count(&groups(t), 0, keys, Some(pieces));
        left.first().map(|one| one.known)
    };
    assert_eq!(known(9, Some(&[1])), None);
    assert_eq!(known(10, Some(&[1])), Some(Some(0)));
    assert_eq!((known(9, None), known(9, Some(&[]))), (Some(None), Some(None)));
}
