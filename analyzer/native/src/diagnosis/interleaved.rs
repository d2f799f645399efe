//! Several senders behind one node ID and type, each with a counter of its own.
#![forbid(unsafe_code)]

use std::collections::VecDeque;

use super::starts::OddStart;
use super::ID;
use crate::frames::NO_TIME;

const SENDERS: usize = 8;
/// Turns that a counter may miss.
const PATIENCE: u64 = 4;
/// Starts that are judged.
const LATEST: usize = 64;
const IDS: i128 = ID as i128 + 1;

/// One sender's counter: the ID it came to, and how often it went on by 1 after another one spoke, at least.
///
/// `turns` is how often it took over, `begun` and `heard` at which odd start first and last; `start` is that frame.
/// `since` is the time of the start before its first one.
#[derive(Clone, Copy, Debug)]
pub struct Chain {
    pub last: u8,
    pub begun: u64,
    pub since: i64,
    length: u64,
    pub turns: u64,
    heard: u64,
    pub start: Option<u64>,
}

impl Chain {
    fn new(last: u8, begun: u64, since: i64) -> Self {
        Chain {
            last,
            begun,
            since,
            length: 1,
            turns: 1,
            heard: 0,
            start: None,
        }
    }

    /// Whether it has not taken over for far longer than it used to: it is gone.
    fn silent(&self, now: u64) -> bool {
        let turns = (self.turns - 1).max(1);
        let usual = self.heard.saturating_sub(self.begun);
        (now - self.heard) * turns > PATIENCE * (usual + turns)
    }
}

/// Tells whether a session is several interleaved counters; it is told only of starts whose step is not 1.
///
/// A lost transfer leaves a counter that nobody continues. Several senders continue all of them, by turns, whether or
/// not they finish what they start. Losses that come at regular intervals may look the same, but then time goes on as
/// the IDs do.
#[derive(Clone, Debug, Default)]
pub struct Interleaved {
    speaks: Option<Chain>,
    /// The one that spoke last at the end.
    waiting: Vec<Chain>,
    /// Of the latest odd start.
    at: Option<i64>,
    /// Of odd starts.
    count: u64,
    /// Whether the latest continued a counter that waited, and whether losses explain them.
    latest: VecDeque<(bool, bool)>,
    continued: usize,
    in_time: usize,
}

impl Interleaved {
    /// Adds a start; returns whether it goes on with a counter that waited.
    pub fn add(&mut self, one: &OddStart) -> bool {
        let follows = one.id.wrapping_sub(1) & ID;
        // The latest one: an older one that is as far was left behind by a loss.
        let known = self.waiting.iter().rposition(|chain| chain.last == follows);
        if one.again && known.is_none() {
            return false;
        }
        let mut spoke = self.speaks.take().unwrap_or(Chain::new(one.before, 0, NO_TIME));
        self.count += 1;
        let silent = one.before.wrapping_sub(spoke.last) & ID;
        let took = self.at.map_or(0, |at| i128::from(one.since) - i128::from(at));
        if silent != 0 {
            spoke.last = one.before;
            spoke.length += 1;
        }
        let mut goes_on = if let Some(at) = known {
            let chain = self.waiting.remove(at);
            Chain {
                length: chain.length + 1,
                turns: chain.turns + 1,
                ..chain
            }
        } else {
            let spare = (self.waiting.len() + 2).saturating_sub(SENDERS);
            self.waiting.drain(..spare);
            Chain::new(one.id, self.count, one.since)
        };
        self.waiting.push(spoke);
        (goes_on.last, goes_on.heard, goes_on.start) = (one.id, self.count, Some(one.number));
        self.speaks = Some(goes_on);
        self.at = (one.t != NO_TIME).then_some(one.t);
        self.note(known.is_some(), is_loss(silent, took, one));
        known.is_some()
    }

    fn note(&mut self, continued: bool, in_time: bool) {
        if self.latest.len() == LATEST {
            if let Some((continued, in_time)) = self.latest.pop_front() {
                self.continued -= usize::from(continued);
                self.in_time -= usize::from(in_time);
            }
        }
        self.latest.push_back((continued, in_time));
        self.continued += usize::from(continued);
        self.in_time += usize::from(in_time);
    }

    /// The counters, the latest last, once two had so many transfers and all explain nearly every step.
    pub fn counters(&self, least: u64) -> Vec<Chain> {
        let judged = self.latest.len();
        if 8 * self.continued < 7 * judged || 4 * self.in_time >= 3 * judged {
            return vec![];
        }
        let heard = self.waiting.iter().chain(&self.speaks);
        let mut chains: Vec<Chain> = heard.filter(|one| !one.silent(self.count)).copied().collect();
        if chains.iter().filter(|one| one.length >= least).count() <= 1 {
            return vec![];
        }
        chains.retain(|one| 2 * one.length >= least);
        chains
    }
}

/// Whether one sender may have lost transfers: the IDs before, `silent` of them, came as fast as the lost ones.
///
/// A period may be off by a quarter.
fn is_loss(silent: u8, took: i128, one: &OddStart) -> bool {
    let step = i128::from(one.id.wrapping_sub(one.before) & ID);
    let gap = i128::from(one.t) - i128::from(one.since);
    if step == 0 || one.t == NO_TIME || gap <= 0 || took <= 0 {
        return false;
    }
    let fits = |ids: i128| ids != 0 && 4 * (took * step - ids * gap).abs() <= ids * gap;
    (0..4).any(|rounds| fits(i128::from(silent) + rounds * IDS))
}
