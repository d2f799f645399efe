//! The last run of each key of findings: what goes on with one that wants no more examples is only counted.
#![forbid(unsafe_code)]

use std::collections::{HashMap, HashSet};

use crate::runs::{About, Apart, Groups, Piece, Place};
use crate::seeded::Seeded;

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

/// Pieces of a group that were not counted, and the number of its key, if it is known.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Left {
    pub group: usize,
    pub known: Option<usize>,
    pub pieces: Vec<Piece>,
}

/// Groups that are not kept apart: plain ones, doubtful ones, noted ones, and those that are both.
pub type Beyond = [Vec<usize>; 4];

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
    numbers: HashMap<Key, usize, Seeded>,
    beyond: HashMap<u64, HashSet<(i64, i64, i64), Seeded>, Seeded>,
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
            numbers: HashMap::default(),
            beyond: HashMap::default(),
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

    /// Counts what goes on with last runs, unless `joins` is none, and gives what is left, in order, and the groups that
    /// are not kept apart.
    ///
    /// What is noted or doubtful has a number of its own, behind `alike`. `keys` stand instead of those of the groups.
    pub fn count(
        &mut self,
        groups: &Groups,
        alike: u64,
        keys: Option<&[i64]>,
        joins: Option<Joins>,
    ) -> (Vec<Left>, Beyond) {
        self.times += 1;
        let (mut joins, mut left, mut beyond) = (joins, vec![], Beyond::default());
        for (group, (about, _)) in groups.each().enumerate() {
            let key = keys.map_or(Some(about.key), |keys| keys.get(group).copied());
            let known = key.and_then(|key| self.numbers.get(&key_of(alike, about, key)).copied());
            let pieces = match known {
                Some(number) => self.left(number, groups.pieces(group), joins),
                None if self.is_beyond(alike, about) => {
                    beyond[kind_of(about)].push(group);
                    vec![]
                }
                None => groups.pieces(group),
            };
            if !pieces.is_empty() {
                left.push(Left { group, known, pieces });
            } else if known.is_some() {
                continue;
            }
            joins = joins.map(|joins| Joins {
                crowded: false, // what is left may end the crowd
                ..joins
            });
        }
        (left, beyond)
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

fn kind_of(about: About) -> usize {
    usize::from(about.noted) * 2 + usize::from(about.doubtful)
}

fn number_of(alike: u64, about: About) -> u64 {
    alike + kind_of(about) as u64
}

fn key_of(alike: u64, about: About, key: i64) -> Key {
    (number_of(alike, about), about.bus, about.node, about.type_, key)
}

fn close(apart: Apart, last: i64, t: i64) -> bool {
    let same = apart.piece == 0 || t.div_euclid(apart.piece) <= last.div_euclid(apart.piece);
    same && t.saturating_sub(last) <= apart.pause
}

#[cfg(test)]
mod tests;
