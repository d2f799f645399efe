//! Transfers that did not come, by the gaps in their IDs, added up by node.
//!
//! What comes in another order runs ahead and falls back by as much. How these sums are to be read is said where they are
//! asked for.
#![forbid(unsafe_code)]

mod common;
mod zeroed;

use std::collections::{BTreeMap, HashMap, HashSet};

use crate::groups::{MESSAGE, REQUEST};
use crate::seeded::Seeded;
use crate::transfers::anomaly::{ID_GAP, ID_RESTARTED};
use common::CommonCounters;
use zeroed::{Fall, ZeroedCounters};

pub const IDS: i64 = 32;
/// Sessions whose counters are followed.
const MOST: usize = 8192;
/// Steps from here on are those of transfers that changed places with their neighbours.
const BACK: i64 = IDS - 3;
/// And up to here those of what they changed places with.
const AHEAD: i64 = IDS + 1 - BACK;
/// What cannot be told is as many as there are IDs.
const UNKNOWN: i64 = IDS;

/// The transfers of a batch in columns.
#[derive(Debug)]
pub struct Columns<'a> {
    pub t: &'a [i64],
    pub bus: &'a [u8],
    pub src: &'a [u8],
    pub dst: &'a [u8],
    pub kind: &'a [u8],
    pub type_id: &'a [u16],
    pub transfer_id: &'a [u8],
    pub step: &'a [u8],
    pub anomaly: &'a [u32],
}

impl Columns<'_> {
    fn fits(&self) -> bool {
        let small = [self.bus, self.src, self.dst, self.kind, self.transfer_id, self.step];
        let many = self.t.len();
        small.iter().all(|column| column.len() == many) && [self.type_id.len(), self.anomaly.len()] == [many; 2]
    }

    fn node(&self, row: usize) -> u16 {
        u16::from(self.bus[row]) << 8 | u16::from(self.src[row])
    }

    /// Whose a transfer is and of which type, and to whom.
    fn directed(&self, row: usize, dst: u8) -> i64 {
        let whose = i64::from(self.node(row)) << 8 | i64::from(dst);
        whose << 24 | i64::from(self.kind[row]) << 16 | i64::from(self.type_id[row])
    }

    fn session(&self, row: usize) -> i64 {
        self.directed(row, if self.kind[row] == MESSAGE { 0 } else { self.dst[row] })
    }

    /// The ID that the session had before.
    fn before(&self, row: usize) -> i64 {
        (i64::from(self.transfer_id[row]) - i64::from(self.step[row])).rem_euclid(IDS)
    }
}

/// Sums of a node: lost; lost if one counter serves all its types, and whether it does or not; gaps, those that return
/// from one, and sessions with gaps.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Sums {
    pub lost: i64,
    pub common: i64,
    pub by_both: i64,
    pub gaps: i64,
    pub returns: i64,
    pub types: i64,
}

/// Adds up gaps.
#[derive(Clone, Debug, Default)]
pub struct Losses {
    sums: HashMap<u16, Sums, Seeded>,
    common: CommonCounters,
    known: HashSet<i64, Seeded>,
    zeroed: ZeroedCounters,
    /// Of each session, the ID in front of its last gap.
    before: HashMap<i64, i64, Seeded>,
}

impl Losses {
    /// Adds the next batch; false if columns do not fit together.
    pub fn feed(&mut self, of: &Columns<'_>) -> bool {
        if !of.fits() {
            return false;
        }
        let gap = |&row: &usize| of.anomaly[row] & (ID_GAP | ID_RESTARTED) != 0;
        let counts = |&row: &usize| of.kind[row] == MESSAGE || of.kind[row] == REQUEST;
        let rows: Vec<usize> = (0..of.t.len()).filter(|row| gap(row) && counts(row)).collect();
        if rows.is_empty() {
            return true;
        }
        let returns = self.returned(of, &rows);
        let common = self.common.between(of, &rows);
        let sessions: Vec<i64> = rows.iter().map(|&row| of.session(row)).collect();
        let firsts = self.firsts(&sessions);
        let mut asked: HashSet<i64, Seeded> = HashSet::default();
        let mut falls = Vec::with_capacity(rows.len());
        for (k, &row) in rows.iter().enumerate() {
            let missing = missing(of.step[row]);
            let to_zero = of.anomaly[row] & ID_RESTARTED != 0;
            let sums = self.sums.entry(of.node(row)).or_default();
            sums.lost += if to_zero { 0 } else { missing };
            sums.common += if common[k] < missing && !firsts[k] {
                common[k]
            } else {
                0
            };
            sums.by_both += common[k].min(missing);
            sums.gaps += 1;
            sums.returns += i64::from(returns[k]);
            sums.types += i64::from(firsts[k]);
            if to_zero || self.zeroed.follows(sessions[k]) {
                asked.insert(sessions[k]);
            }
            falls.push(if to_zero { missing } else { -1 });
        }
        self.zero(of, &rows, &sessions, (&falls, &asked));
        true
    }

    pub fn sums(&self, node: u16) -> Sums {
        self.sums.get(&node).copied().unwrap_or_default()
    }

    /// What counters of a node that fell to 0 left out, but for restarts and early wraps.
    pub fn zeroed(&self, node: u16) -> i64 {
        self.zeroed.lost(node)
    }

    /// Which gaps are the first ones of their sessions: a counter may have become a common one just then.
    fn firsts(&mut self, sessions: &[i64]) -> Vec<bool> {
        let mut new: HashSet<i64, Seeded> = HashSet::default();
        let firsts = sessions
            .iter()
            .map(|one| !self.known.contains(one) && new.insert(*one))
            .collect();
        if self.known.len() < MOST {
            self.known.extend(new);
        }
        firsts
    }

    /// At which gaps a counter goes on from where it was before the gap in front of this one.
    fn returned(&mut self, of: &Columns<'_>, rows: &[usize]) -> Vec<bool> {
        let mut latest: BTreeMap<i64, i64> = BTreeMap::new();
        let mut found = Vec::with_capacity(rows.len());
        for &row in rows {
            let session = of.directed(row, of.dst[row]);
            let past = latest
                .insert(session, of.before(row))
                .or_else(|| self.before.get(&session).copied());
            let goes_on = past.is_some_and(|past| i64::from(of.transfer_id[row]) == (past + 1) % IDS);
            let step = i64::from(of.step[row]);
            found.push(goes_on && (step == 0 || (step > AHEAD && step < BACK)));
        }
        remember(&mut self.before, latest);
        found
    }

    /// Takes the gaps of sessions that are asked about, and what is missing where they fell to 0; of their other gaps
    /// only the first one after a fall ends what it began.
    fn zero(
        &mut self,
        of: &Columns<'_>,
        rows: &[usize],
        sessions: &[i64],
        (falls, asked): (&[i64], &HashSet<i64, Seeded>),
    ) {
        let mut fell: HashMap<i64, bool, Seeded> = HashMap::default();
        for (k, &row) in rows.iter().enumerate() {
            let session = sessions[k];
            if !asked.contains(&session) {
                continue;
            }
            let falls_here = falls[k] >= 0;
            let fell_before = fell.insert(session, falls_here);
            if falls_here || fell_before != Some(false) {
                self.zeroed.feed(&Fall {
                    node: of.node(row),
                    session,
                    t: of.t[row],
                    before: of.before(row),
                    missing: falls[k],
                });
            }
        }
    }
}

/// How far a session ran ahead at a step; negative if it fell back.
fn missing(step: u8) -> i64 {
    let step = i64::from(step);
    if step >= BACK {
        step - 1 - IDS
    } else {
        (step - 1).rem_euclid(IDS)
    }
}

/// Takes over what is new, in order, while there is room.
fn remember<T>(known: &mut HashMap<i64, T, Seeded>, new: BTreeMap<i64, T>) {
    for (session, value) in new {
        if known.contains_key(&session) || known.len() < MOST {
            known.insert(session, value);
        }
    }
}
