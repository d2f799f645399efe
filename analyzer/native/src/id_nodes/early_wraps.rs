//! Counters that always wrap early.
#![forbid(unsafe_code)]

use std::collections::HashMap;

use super::begun_anew::Stated;
use super::step::{Rule, Step};
use crate::frames::NO_TIME;
use crate::seeded::Seeded;

/// Falls from the same ID that are no restarts.
const WRAPS: usize = 3;
/// Sessions of a node that are followed.
const SESSIONS: usize = 256;

/// Falls of a session from an ID: the times of the transfers before the last ones.
#[derive(Clone, Debug)]
struct Alike {
    before: u8,
    since: Vec<i64>,
}

/// Tells a node's counters that always wrap early from restarts.
///
/// In a restart the uptime falls too, and the ID before 0 is a different one each time.
#[derive(Clone, Debug)]
pub struct EarlyWraps {
    alike: HashMap<i64, Alike, Seeded>,
    uptime: i64,
    /// When the uptime last fell, or was 0.
    fell: i64,
}

impl Default for EarlyWraps {
    fn default() -> Self {
        EarlyWraps {
            alike: HashMap::default(),
            uptime: 0,
            fell: NO_TIME,
        }
    }
}

impl EarlyWraps {
    /// Adds what the node's next `NodeStatus` says.
    pub fn state(&mut self, one: &Stated) {
        if one.uptime == 0 || one.uptime < self.uptime {
            self.fell = one.t;
        }
        self.uptime = one.uptime;
    }

    /// Whether the odd steps of a session are, one after the other, falls to 0 from the same ID.
    pub fn add(&mut self, one: &Step) -> bool {
        let to_zero = one.rule == Rule::Restarted;
        let known = self.alike.get(&one.place);
        if !to_zero || known.is_some_and(|known| known.before != one.before) {
            self.alike.remove(&one.place);
        }
        if !to_zero || (!self.alike.contains_key(&one.place) && self.alike.len() >= SESSIONS) {
            return false;
        }
        let alike = self.alike.entry(one.place).or_insert_with(|| Alike {
            before: one.before,
            since: vec![],
        });
        if alike.since.len() == WRAPS {
            alike.since.remove(0);
        }
        alike.since.push(one.since);
        alike.since.len() == WRAPS && (self.fell == NO_TIME || self.fell < alike.since[0])
    }
}
