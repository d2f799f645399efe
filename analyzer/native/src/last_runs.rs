//! The last run of each key of findings: what goes on with one that wants no more examples is only counted.
#![forbid(unsafe_code)]

use std::collections::{HashMap, HashSet};

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

/// Pieces of a group that were not counted; the number of its key, if it is known, and if it is not kept apart.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Left {
    pub group: usize,
    pub known: Option<usize>,
    pub beyond: bool,
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
#[derive(Clone, Debug)]
pub struct LastRuns {
    most_beyond: usize,
    numbers: HashMap<Key, usize>,
    beyond: HashMap<u64, HashSet<(i64, i64, i64)>>,
    kept: Vec<Kept>,
    changed: Vec<usize>,
    times: u64,
    counted: u64,
}

impl LastRuns {
    /// None yet; so many that are alike and not kept apart are remembered.
    pub fn new(most_beyond: usize) -> Self {
        LastRuns {
            most_beyond,
            numbers: HashMap::new(),
            beyond: HashMap::new(),
            kept: vec![],
            changed: vec![],
            times: 0,
            counted: 0,
        }
    }

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

    /// Of a bus, a node and a type nothing will be kept apart.
    pub fn leave_out(&mut self, alike: u64, about: (i64, i64, i64)) {
        let beyond = self.beyond.entry(alike).or_default();
        if beyond.len() >= self.most_beyond {
            beyond.clear();
        }
        beyond.insert(about);
    }

    /// The key of each group and its first row; none of those that are not kept apart.
    pub fn keys(&self, groups: &Groups, alike: u64) -> Vec<Option<(i64, u32)>> {
        let key = |(about, row): (About, u32)| (!self.is_beyond(alike, about)).then_some((about.key, row));
        groups.each().map(key).collect()
    }

    fn is_beyond(&self, alike: u64, about: About) -> bool {
        let beyond = self.beyond.get(&number_of(alike, about));
        beyond.is_some_and(|beyond| beyond.contains(&(about.bus, about.node, about.type_)))
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
            let beyond = known.is_none() && self.is_beyond(alike, about);
            let pieces = match known {
                _ if beyond => vec![],
                Some(number) => self.left(number, groups.pieces(group), joins),
                None => groups.pieces(group),
            };
            if beyond || !pieces.is_empty() {
                left.push(Left {
                    group,
                    known,
                    beyond,
                    pieces,
                });
                joins = joins.map(|joins| Joins {
                    crowded: false, // what is left may end the crowd
                    ..joins
                });
            }
        }
        left
    }

    /// Counts pieces that go on with the last run of a key, up to the first one that does not; gives the others.
    pub fn left(&mut self, number: usize, pieces: Vec<Piece>, joins: Option<Joins>) -> Vec<Piece> {
        let Some(joins) = joins else {
            return pieces;
        };
        let counted = pieces
            .iter()
            .take_while(|piece| self.goes_on(number, **piece, joins))
            .count();
        if let Some(kept) = self.kept.get_mut(number).filter(|_| counted < pieces.len()) {
            kept.left = self.times;
        }
        pieces.into_iter().skip(counted).collect()
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

fn number_of(alike: u64, about: About) -> u64 {
    alike + u64::from(about.noted) * 2 + u64::from(about.doubtful)
}

fn key_of(alike: u64, about: About, key: i64) -> Key {
    (number_of(alike, about), about.bus, about.node, about.type_, key)
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
        let mut runs = LastRuns::new(1);
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
        let mut runs = LastRuns::new(1);
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
    fn what_is_not_kept_apart_is_told() {
        let mut runs = LastRuns::new(1);
        runs.leave_out(4, (0, 5, 7));
        let groups = Groups::of(&[about(5, 1), about(6, 2)], vec![(9, 1); 2], PAUSE);
        assert_eq!(runs.keys(&groups, 4), vec![None, Some((2, 1))]);
        let left = runs.count(&groups, 4, None, Some(PLAIN));
        let left: Vec<_> = left
            .iter()
            .map(|one| (one.group, one.beyond, one.pieces.len()))
            .collect();
        assert_eq!(left, vec![(0, true, 0), (1, false, 1)]);
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
            let left = runs.count(&groups(t), 0, keys, Some(pieces));
            left.first().map(|one| one.known)
        };
        assert_eq!(known(9, Some(&[1])), None);
        assert_eq!(known(10, Some(&[1])), Some(Some(0)));
        assert_eq!((known(9, None), known(9, Some(&[]))), (Some(None), Some(None)));
    }
}
