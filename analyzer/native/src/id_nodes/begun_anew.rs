//! Which counters that come to 0 belong to a node that restarted, and which only lost what is before that.
#![forbid(unsafe_code)]

use std::collections::{HashSet, VecDeque};

use super::step::{Rule, Step, NEAR, QUIET};
use crate::frames::NO_TIME;
use crate::seeded::Seeded;

const SECOND: i64 = 1_000_000_000;
const MOST_STATED: usize = 64;
/// What is told later may have another cause, or follow what is forgotten.
const SOON: i64 = 2 * SECOND;
/// Of an uptime: whole seconds, and jitter.
const ROUGHLY: i64 = 3 * SECOND / 2;

/// An uptime in seconds that a node states, and the transfer ID with which it does; `row` is that of the transfer.
#[derive(Clone, Copy, Debug)]
pub struct Stated {
    pub row: u32,
    pub t: i64,
    pub uptime: i64,
    pub id: u8,
}

/// A step to 0, a restart perhaps.
#[derive(Clone, Copy, Debug)]
pub struct AtZero {
    pub rule: Rule,
    pub t: i64,
    pub since: i64,
    pub place: i64,
}

impl AtZero {
    pub fn of(step: &Step) -> Self {
        AtZero {
            rule: step.rule,
            t: step.t,
            since: step.since,
            place: step.place,
        }
    }
}

/// The latest steps of a node to 0, and its uptimes: the last 64, and the one before them.
#[derive(Clone, Debug, Default)]
pub struct BegunAnew {
    latest: VecDeque<AtZero>,
    stated: VecDeque<Stated>,
    older: Option<Stated>,
}

impl BegunAnew {
    /// Adds a step.
    pub fn add(&mut self, one: AtZero) {
        if self.latest.len() == NEAR {
            self.latest.pop_front();
        }
        self.latest.push_back(one);
    }

    /// Adds an uptime.
    pub fn state(&mut self, one: Stated) {
        if one.t == NO_TIME {
            return;
        }
        if self.stated.len() == MOST_STATED {
            self.older = self.stated.pop_front();
        }
        self.stated.push_back(one);
    }

    /// The rules of steps, with restarts told from what looks like one.
    ///
    /// A restarted node begins all its sessions anew. One that was at 0 by chance did not stand still then, and one that
    /// comes to 0 without another witness has lost what is before that.
    pub fn told(&self, anew: &[AtZero]) -> Vec<Rule> {
        let restarted = anew.iter().filter(|one| one.rule == Rule::Restarted);
        let mut known: HashSet<i64, Seeded> = restarted.map(|one| one.place).collect();
        let rule = |one: &AtZero| match one.rule {
            Rule::Restarted if !self.began_with(one, anew) => Rule::Gap,
            Rule::Repeated if known.insert(one.place) && self.began_with(one, anew) => Rule::Restarted,
            rule => rule,
        };
        anew.iter().map(rule).collect()
    }

    /// The rule of one step like that.
    pub fn alone(&self, one: &AtZero) -> Rule {
        if one.rule == Rule::Restarted && !self.began_with(one, &self.latest) {
            Rule::Gap
        } else {
            one.rule
        }
    }

    /// Whether the uptime witnesses that, or the other sessions do and the uptime is no witness against.
    fn began_with<'z>(&self, one: &AtZero, anew: impl IntoIterator<Item = &'z AtZero>) -> bool {
        let with_others = || {
            anew.into_iter().any(|other| {
                one.t.abs_diff(other.t) <= QUIET.unsigned_abs()
                    && other.place != one.place
                    && [one.rule, other.rule].contains(&Rule::Restarted)
            })
        };
        self.began(one.since, one.t).unwrap_or_else(with_others)
    }

    /// Whether the node began anew between two times: None if its counter may have, and its uptime not.
    fn began(&self, since: i64, until: i64) -> Option<bool> {
        if self.older.is_some_and(|one| one.t > since) {
            return None; // nothing of that time is known any more
        }
        let mut before = self.older.map(|one| one.uptime);
        for one in &self.stated {
            if one.t <= since {
                before = Some(one.uptime);
            } else if one.t > until.saturating_add(SOON) {
                return None;
            } else if before.map_or_else(
                || one.t.saturating_sub(one.uptime * SECOND) >= since.saturating_sub(ROUGHLY),
                |before| one.uptime == 0 || one.uptime < before,
            ) {
                return Some(true);
            } else if one.id == 0 {
                return None;
            } else if one.t > until {
                return Some(false);
            }
        }
        None
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn stated(seconds: &[(i64, i64)]) -> BegunAnew {
        let mut known = BegunAnew::default();
        for &(t, uptime) in seconds {
            known.state(Stated {
                row: 0,
                t: t * SECOND,
                uptime,
                id: 5,
            });
        }
        known
    }

    fn restart(t: i64, place: i64) -> AtZero {
        AtZero {
            rule: Rule::Restarted,
            t: t * SECOND,
            since: t * SECOND - SECOND / 10,
            place,
        }
    }

    #[test]
    fn an_uptime_that_fell_witnesses_a_restart_and_one_that_rises_a_loss() {
        assert_eq!(stated(&[(9, 90), (11, 1)]).alone(&restart(10, 1)), Rule::Restarted);
        assert_eq!(stated(&[(9, 90), (11, 92)]).alone(&restart(10, 1)), Rule::Gap);
    }

    #[test]
    fn without_uptimes_another_session_is_the_witness() {
        let anew = [restart(10, 1), restart(11, 2), restart(20, 3)];
        let rules = BegunAnew::default().told(&anew);
        assert_eq!(rules, [Rule::Restarted, Rule::Restarted, Rule::Gap]);
    }

    #[test]
    fn what_is_older_than_all_that_is_known_shows_nothing() {
        let all: Vec<(i64, i64)> = (0..80).map(|t| (t, t + 100)).collect();
        assert_eq!(stated(&all).began(10 * SECOND, 11 * SECOND), None);
        assert_eq!(stated(&all).began(70 * SECOND, 71 * SECOND), Some(false));
    }
}
