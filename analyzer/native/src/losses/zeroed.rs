//! Counters that fell to 0: what they would have left out, but for restarts and early wraps.
#![forbid(unsafe_code)]

use std::collections::HashMap;

use super::MOST;
use crate::frames::NO_TIME;
use crate::seeded::Seeded;

/// In which two types of a node that are at 0 tell of a restart, in ns.
const TOGETHER: i64 = 2_000_000_000;
/// Times that a counter comes to 0 from the same ID: it wraps there.
const EARLY: u32 = 3;

/// A session at a gap: the ID before, and what is missing if it fell to 0 there, negative if it did not.
#[derive(Clone, Copy, Debug)]
pub struct Fall {
    pub node: u16,
    pub session: i64,
    pub t: i64,
    pub before: i64,
    pub missing: i64,
}

/// Where a counter may wrap: the ID before, how many times in a row, and what was counted as lost.
#[derive(Clone, Copy, Debug)]
struct Wrap {
    before: i64,
    times: u32,
    counted: i64,
}

#[derive(Clone, Debug, Default)]
pub struct ZeroedCounters {
    lost: HashMap<u16, i64, Seeded>,
    /// Of each node, in the last seconds.
    latest: HashMap<u16, Vec<Fall>, Seeded>,
    wraps: HashMap<i64, Wrap, Seeded>,
}

impl ZeroedCounters {
    pub fn lost(&self, node: u16) -> i64 {
        self.lost.get(&node).copied().unwrap_or_default()
    }

    /// Whether a session may wrap early: all its gaps are to be fed.
    pub fn follows(&self, session: i64) -> bool {
        self.wraps.contains_key(&session)
    }

    pub fn feed(&mut self, fall: &Fall) {
        if fall.missing < 0 {
            self.wraps.remove(&fall.session);
            return;
        }
        let timed = fall.t != NO_TIME;
        let near = |one: &Fall| timed && fall.t.wrapping_sub(one.t) <= TOGETHER;
        let known = self.latest.get(&fall.node).into_iter().flatten();
        let mut recent: Vec<Fall> = known.filter(|one| near(one)).copied().collect();
        let mut missing = fall.missing;
        // Two witnesses of a restart: nothing is missing, of those before neither.
        for other in recent.iter_mut().filter(|one| one.session != fall.session) {
            *self.lost.entry(fall.node).or_default() -= other.missing;
            (other.missing, missing) = (0, 0);
        }
        missing = self.wrapped(fall, missing);
        if timed {
            recent.push(Fall { missing, ..*fall });
            recent.drain(..recent.len().saturating_sub(MOST));
            self.latest.insert(fall.node, recent);
        }
        *self.lost.entry(fall.node).or_default() += missing;
    }

    /// What is lost if this may be where a counter wraps that is shorter than it should be.
    fn wrapped(&mut self, fall: &Fall, mut missing: i64) -> i64 {
        let known = self
            .wraps
            .get(&fall.session)
            .filter(|known| known.before == fall.before);
        let (times, mut counted) = known.map_or((1, 0), |known| (known.times + 1, known.counted));
        if times == EARLY {
            *self.lost.entry(fall.node).or_default() -= counted;
            counted = 0;
        }
        if times >= EARLY {
            missing = 0;
        }
        if self.wraps.contains_key(&fall.session) || self.wraps.len() < MOST {
            let before = fall.before;
            counted += missing;
            self.wraps.insert(fall.session, Wrap { before, times, counted });
        }
        missing
    }
}
