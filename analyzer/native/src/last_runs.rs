//! The last run of each key of findings: what goes on with one that wants no more examples is only counted.
#![forbid(unsafe_code)]

use std::collections::HashMap;

use crate::runs::{About, Apart, Groups, Piece, Place};

/// The number of those that are alike, and what keeps them apart: bus, node, type and key.
type Key = (u64, i64, i64, i64, i64);

/// A run: its first and last place, and where its last example is if it has all that it may have.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct LastRun {
    pub first: Place,
    pub last: Place,
    pub full: Option<Place>,
}

/// What makes one run of two: no pause, or the same piece of time; whatever the pause if there is a crowd of them.
#[derive(Clone, Copy, Debug)]
pub struct Joins {
    pub close: Apart,
    pub crowded: bool,
}

/// Pieces of a group that were not counted; the number of its key, if it is known.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Left {
    pub group: usize,
    pub known: Option<usize>,
    pub pieces: Vec<Piece>,
}

#[derive(Clone, Debug, Default)]
struct Kept {
    run: Option<LastRun>,
    more: u64,
    changed: bool,
    left: u64, // when a piece was left: those behind it have to wait for it
}

/// Last runs by key.
#[derive(Clone, Debug, Default)]
pub struct LastRuns {
    numbers: HashMap<Key, usize>,
    kept: Vec<Kept>,
    changed: Vec<usize>,
    times: u64,
    counted: u64,
}

impl LastRuns {
    /// Makes room for the last run of one more key, and gives its number.
    pub fn add(&mut self) -> usize {
        self.kept.push(Kept::default());
        self.kept.len() - 1
    }

    /// Occurrences that are of this belong to the key with a number.
    pub fn know(&mut self, alike: u64, about: (i64, i64, i64, i64), number: usize) {
        let (bus, node, type_, key) = about;
        self.numbers.insert((alike, bus, node, type_, key), number);
    }

    /// The last run of a key is this one now; none goes on with it if there is none.
    pub fn tell(&mut self, number: usize, run: Option<LastRun>) {
        if let Some(kept) = self.kept.get_mut(number) {
            kept.run = run;
        }
    }

    /// How many occurrences the last run of a key has more, and its last place; none if no more than when last asked.
    pub fn take(&mut self, number: usize) -> Option<(u64, Place)> {
        let kept = self.kept.get_mut(number).filter(|kept| kept.more > 0)?;
        let more = std::mem::take(&mut kept.more);
        kept.run.map(|run| (more, run.last))
    }

    /// The keys of which something was counted since the last call.
    pub fn take_changed(&mut self) -> Vec<usize> {
        for &number in &self.changed {
            self.kept[number].changed = false;
        }
        std::mem::take(&mut self.changed)
    }

    /// How many pieces were counted.
    pub fn counted(&self) -> u64 {
        self.counted
    }

    /// Counts what goes on with last runs, unless `joins` is none, and gives what is left, in order.
    ///
    /// What is noted or doubtful has a number of its own, behind `alike`. `keys` stand instead of those of the groups.
    pub fn count(&mut self, groups: &Groups, alike: u64, keys: Option<&[i64]>, joins: Option<Joins>) -> Vec<Left> {
        self.times += 1;
        let mut joins = joins;
        let mut left = vec![];
        for (group, (about, _)) in groups.each().enumerate() {
            let key = keys.map_or(Some(about.key), |keys| keys.get(group).copied());
            let known = key.and_then(|key| self.numbers.get(&key_of(alike, about, key)).copied());
            let mut pieces = vec![];
            for piece in groups.pieces(group) {
                if known.is_some_and(|number| joins.is_some_and(|joins| self.goes_on(number, piece, joins))) {
                    continue;
                }
                if let Some(kept) = known.and_then(|number| self.kept.get_mut(number)) {
                    kept.left = self.times;
                }
                if let Some(joins) = &mut joins {
                    joins.crowded = false; // it may end the crowd
                }
                pieces.push(piece);
            }
            if !pieces.is_empty() {
                left.push(Left { group, known, pieces });
            }
        }
        left
    }

    /// Counts a piece if it goes on with the last run of a key.
    fn goes_on(&mut self, number: usize, piece: Piece, joins: Joins) -> bool {
        let times = self.times;
        let Some(kept) = self.kept.get_mut(number).filter(|kept| kept.left != times) else {
            return false;
        };
        let Some(run) = kept.run.as_mut().filter(|run| run.first < piece.first) else {
            return false;
        };
        let full = run.full.is_some_and(|example| example < piece.first);
        let goes_on = if piece.last > run.last {
            joins.crowded || (full && close(joins.close, run.last.0, piece.first.0))
        } else {
            full
        };
        if goes_on {
            run.last = run.last.max(piece.last);
            kept.more += (piece.end - piece.begin) as u64;
            if !kept.changed {
                kept.changed = true;
                self.changed.push(number);
            }
            self.counted += 1;
        }
        goes_on
    }
}

fn key_of(alike: u64, about: About, key: i64) -> Key {
    let number = alike + u64::from(about.noted) * 2 + u64::from(about.doubtful);
    (number, about.bus, about.node, about.type_, key)
}

fn close(apart: Apart, last: i64, t: i64) -> bool {
    let same = apart.piece == 0 || t.div_euclid(apart.piece) <= last.div_euclid(apart.piece);
    same && t.saturating_sub(last) <= apart.pause
}

#[cfg(test)]
mod tests {
    use super::{Joins, LastRun, LastRuns};
    use crate::runs::{About, Apart, Groups, Place};

    const PAUSE: Apart = Apart { pause: 10, piece: 0 };
    const PLAIN: Joins = Joins {
        close: PAUSE,
        crowded: false,
    };

    fn about(node: i64, key: i64) -> About {
        About {
            bus: 0,
            node,
            type_: 7,
            noted: false,
            doubtful: false,
            key,
        }
    }

    fn run(first: i64, last: i64, full: Option<Place>) -> LastRun {
        LastRun {
            first: (first, 0),
            last: (last, 0),
            full,
        }
    }

    /// Last runs of one key, of node 5 and key 1, and what is left of rows at some times that are of it.
    fn left(known: LastRun, joins: Option<Joins>, t: &[i64]) -> (LastRuns, Vec<i64>) {
        let mut runs = LastRuns::default();
        let number = runs.add();
        runs.know(4, (0, 5, 7, 1), number);
        runs.tell(number, Some(known));
        let place = t.iter().map(|&t| (t, 1)).collect();
        let groups = Groups::of(&vec![about(5, 1); t.len()], place, PAUSE);
        let left = runs.count(&groups, 4, None, joins);
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
        let mut runs = LastRuns::default();
        for node in [5, 6, 8] {
            let number = runs.add();
            runs.know(0, (0, node, 7, 0), number);
            runs.tell(number, Some(run(0, 5, None)));
        }
        let rows = [about(5, 0), about(6, 0), about(7, 0), about(8, 0)];
        let groups = Groups::of(&rows, vec![(900, 1); 4], PAUSE);
        let crowd = Joins { crowded: true, ..PLAIN };
        let left = runs.count(&groups, 0, None, Some(crowd));
        let left: Vec<_> = left.iter().map(|one| (one.group, one.known)).collect();
        assert_eq!(left, vec![(2, None), (3, Some(2))]);
    }

    #[test]
    fn pieces_of_time_end_runs_and_keys_may_be_others() {
        let mut runs = LastRuns::default();
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
            let left = runs.count(&groups(t), 0, keys, Some(pieces));
            left.first().map(|one| one.known)
        };
        assert_eq!(known(9, Some(&[1])), None);
        assert_eq!(known(10, Some(&[1])), Some(Some(0)));
        assert_eq!((known(9, None), known(9, Some(&[]))), (Some(None), Some(None)));
    }
}
