//! Messages of nodes counted as if all their types had one counter, from the first batch with a gap of theirs on.
#![forbid(unsafe_code)]

use std::collections::{BTreeMap, HashMap, HashSet};

use super::{remember, Columns, IDS, MOST, UNKNOWN};
use crate::groups::MESSAGE;
use crate::seeded::Seeded;

#[derive(Clone, Debug, Default)]
pub struct CommonCounters {
    followed: HashSet<u16, Seeded>,
    /// Of each node its last ID, and what was missing until then.
    latest: HashMap<u16, (i64, i64), Seeded>,
    /// Of each session what was missing until its last message.
    until: HashMap<i64, i64, Seeded>,
}

impl CommonCounters {
    /// What is missing before each of some messages since the one before of its type, by one counter; `gaps` are their
    /// rows, in order.
    pub fn between(&mut self, of: &Columns<'_>, gaps: &[usize]) -> Vec<i64> {
        if self.followed.len() < MOST {
            self.followed.extend(gaps.iter().map(|&row| of.node(row)));
        }
        let follows = |&row: &usize| of.kind[row] == MESSAGE && self.followed.contains(&of.node(row));
        let mut rows: Vec<usize> = (0..of.t.len()).filter(follows).collect();
        if !rows.is_sorted_by_key(|&row| of.t[row]) {
            rows.sort_by_key(|&row| of.t[row]); // IDs are given at the start
        }
        let mut wanted: HashMap<usize, i64, Seeded> = gaps.iter().map(|&row| (row, UNKNOWN)).collect();
        let mut until: BTreeMap<i64, i64> = BTreeMap::new();
        for row in rows {
            let id = i64::from(of.transfer_id[row]);
            let missing = match self.latest.get(&of.node(row)) {
                None => 0,
                Some((before, missing)) => missing + (id - before - 1).rem_euclid(IDS),
            };
            self.latest.insert(of.node(row), (id, missing));
            let session = of.session(row);
            let before = until
                .insert(session, missing)
                .or_else(|| self.until.get(&session).copied());
            if let (Some(found), Some(before)) = (wanted.get_mut(&row), before) {
                // Messages that come in another order than that of their IDs leave out a whole round together, and
                // nothing.
                *found = (missing - before) % IDS;
            }
        }
        remember(&mut self.until, until);
        gaps.iter().map(|row| wanted[row]).collect()
    }
}
