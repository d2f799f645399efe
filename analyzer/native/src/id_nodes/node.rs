//! A node whose transfer-ID counters break: what is held back, and what comes of it.
#![forbid(unsafe_code)]

use std::collections::{HashMap, VecDeque};
use std::mem::take;

use super::around::Around;
use super::begun_anew::{AtZero, BegunAnew, Stated};
use super::early_wraps::EarlyWraps;
use super::late_copies::time_before;
use super::places::oldest;
use super::several::SeveralSenders;
use super::shared_counter::SharedCounter;
use super::step::{Cause, Explains, Rule, Step, Told, LATE, NEAR, QUIET};
use super::walk::Walk;
use crate::frames::NO_TIME;
use crate::seeded::Seeded;

const SECOND: i64 = 1_000_000_000;
/// A node is judged anew after this time without a breach.
const EXPIRY: i64 = 10 * SECOND;
/// What goes on is counted once in this time.
const EVERY: i64 = SECOND;
/// A step is held back so long at most.
const LONGEST: i64 = 15 * SECOND;
/// Steps held back; the oldest ones are told first.
const MOST_HELD: usize = 1024;
/// Sessions whose latest step is known; of others none is seen to skip as many each time.
const SESSIONS: usize = 1 << 12;

/// One node of one interface, from its first breach on.
#[derive(Clone, Debug)]
pub struct Node {
    held: VecDeque<Step>,
    found: Vec<Told>,
    senders: SeveralSenders,
    shared: Option<SharedCounter>,
    wraps: EarlyWraps,
    anew: BegunAnew,
    /// Of the steps so far, the latest time.
    last: i64,
    next: i64,
    cause: Option<Cause>,
    /// Before the second of several senders came.
    since: i64,
    /// The ID that each session came to with its latest step, and how far that counted.
    latest: HashMap<i64, (u8, u8), Seeded>,
}

impl Default for Node {
    fn default() -> Self {
        Node {
            held: VecDeque::new(),
            found: vec![],
            senders: SeveralSenders::default(),
            shared: None,
            wraps: EarlyWraps::default(),
            anew: BegunAnew::default(),
            last: NO_TIME,
            next: NO_TIME,
            cause: None,
            since: NO_TIME,
            latest: HashMap::default(),
        }
    }
}

impl Node {
    /// Whether a counter that several types may share is followed.
    pub fn shares(&self) -> bool {
        self.shared.is_some()
    }

    /// Whether steps are held back.
    pub fn holds(&self) -> bool {
        !self.held.is_empty()
    }

    /// The latest time of a step.
    pub fn last(&self) -> i64 {
        self.last
    }

    /// Takes the steps that nothing explains.
    pub fn founds(&mut self) -> impl Iterator<Item = Told> {
        take(&mut self.found).into_iter()
    }

    /// Takes the messages and the uptimes up to a row.
    pub fn pass(&mut self, walk: &mut Walk<'_>, around: Around<'_>, row: u32) {
        walk.run(&mut self.shared, row, around.frames_of);
        self.tell(walk, row);
    }

    /// Takes the uptimes that were stated before a row.
    fn tell(&mut self, walk: &mut Walk<'_>, row: u32) {
        while let Some(one) = walk.stated(row) {
            if self.holds() && one.t.saturating_sub(self.last) > LATE {
                self.calm();
            }
            self.state(one);
        }
    }

    fn state(&mut self, one: Stated) {
        self.wraps.state(&one);
        self.anew.state(one);
    }

    /// Gives up looking for a cause of what is held.
    pub fn calm(&mut self) {
        self.release();
        self.senders.clear();
    }

    /// Takes what is held as it is.
    fn release(&mut self) {
        self.shared = None;
        self.latest.clear();
        let mut told: Vec<Told> = std::iter::from_fn(|| oldest(&mut self.held)).collect();
        let is_zero = |one: &&mut Told| one.moved.is_none() && one.step.is_zero();
        let zero: Vec<AtZero> = told
            .iter_mut()
            .filter(is_zero)
            .map(|one| AtZero::of(&one.step))
            .collect();
        let rules = self.anew.told(&zero);
        for (one, rule) in told.iter_mut().filter(is_zero).zip(rules) {
            one.step.rule = rule;
        }
        self.found.append(&mut told);
    }

    /// Adds the next step; a cause comes once it shows, and each second that it goes on.
    pub fn add(&mut self, mut one: Step, walk: &mut Walk<'_>, around: Around<'_>, causes: &mut Vec<Cause>) {
        self.tell(walk, one.row);
        let quiet = if self.last == NO_TIME {
            0
        } else {
            one.t.saturating_sub(self.last)
        };
        if quiet > QUIET {
            self.calm();
        }
        if quiet > EXPIRY {
            self.cause = None;
        }
        self.last = self.last.max(one.t);
        self.settle(&mut one);
        walk.run(&mut self.shared, one.row, around.frames_of);
        if self.cause.as_ref().is_some_and(Cause::is_several) {
            self.see_others(&one, around);
        }
        let Some(cause) = &self.cause else {
            self.hold(one, walk, around, causes);
            return;
        };
        if !cause.explains(&one) {
            self.found.push(Told::plain(one));
        } else if cause.is_several() && one.t.saturating_sub(self.senders.seen) > QUIET {
            self.held.push_back(one); // until one of the senders speaks again, or not
            if self.held.len() > MOST_HELD {
                self.release();
            }
        } else if one.t >= self.next {
            self.next = one.t.saturating_add(EVERY);
            causes.push(Cause {
                explains: cause.explains.clone(),
                t: one.t,
                frames: one.frames.to_vec(),
            });
        }
    }

    /// Makes a gap of what skips as many as the step before in its session, and notes it.
    fn settle(&mut self, one: &mut Step) {
        let before = self.latest.get(&one.place);
        if one.rule == Rule::Restarted && before == Some(&(one.before, one.skips())) {
            one.rule = Rule::Gap;
        }
        if before.is_some() || self.latest.len() < SESSIONS {
            self.latest.insert(one.place, (one.id, one.skips()));
        }
        if one.is_zero() {
            self.anew.add(AtZero::of(one));
        }
    }

    /// Gives up several devices as the cause where only one has counted for long.
    fn see_others(&mut self, one: &Step, around: Around<'_>) {
        let before = self.senders.seen;
        let shared = self.senders.shared(one, around);
        if one.t.saturating_sub(self.senders.seen) > EXPIRY {
            self.cause = None;
            self.senders.clear();
        } else if let (Some(shared), true) = (shared, self.holds() && self.senders.seen > before) {
            self.explain(one.place, shared.since.max(self.senders.seen.saturating_sub(LATE)));
        }
    }

    /// Tells what is held but for what the cause explains.
    ///
    /// Several devices explain what is since a time in a session, and in others, where they may have begun earlier.
    fn explain(&mut self, place: i64, since: i64) {
        if let Some(cause) = &self.cause {
            self.held.retain(|one| {
                let earliest = if one.place == place {
                    since
                } else {
                    since.saturating_sub(QUIET)
                };
                !cause.explains(one) || (cause.is_several() && one.t < earliest)
            });
        }
        self.release();
    }

    /// Holds a step back, unless the cause shows with it.
    fn hold(&mut self, one: Step, walk: &mut Walk<'_>, around: Around<'_>, causes: &mut Vec<Cause>) {
        let wraps = self.wraps(&one);
        let shares = self.counts_for_all(&one, walk, around);
        self.cause = shares.or_else(|| self.are_several(&one, around)).or(wraps);
        let (t, place) = (one.t, one.place);
        if let Some(cause) = &self.cause {
            causes.push(cause.clone());
            let several = cause.is_several();
            self.next = t.saturating_add(EVERY);
            self.held.push_back(one);
            self.explain(place, self.since);
            if !several {
                self.senders.clear();
            }
        } else if !self.is_copy(&one, around) {
            self.held.push_back(one);
        }
        let limit = t.saturating_sub(LONGEST);
        let goes = |held: &VecDeque<Step>| held.len() > MOST_HELD || held.front().is_some_and(|first| first.t < limit);
        while goes(&self.held) {
            if let Some(mut told) = oldest(&mut self.held) {
                if told.step.rule == Rule::Restarted && told.moved.is_none() {
                    told.step.rule = self.anew.alone(&AtZero::of(&told.step));
                }
                self.found.push(told);
            }
        }
    }

    /// Makes a copy of the last step held of its session if that and this one are of a transfer that came again.
    fn is_copy(&mut self, one: &Step, around: Around<'_>) -> bool {
        let mut near = self.held.iter_mut().rev().take(NEAR);
        let Some(back) = near.find(|back| back.place == one.place) else {
            return false;
        };
        let Some(t) = time_before(back, one, around.frames) else {
            return false;
        };
        back.rule = Rule::Copied;
        back.gap = back.t.saturating_sub(t);
        true
    }

    fn counts_for_all(&mut self, one: &Step, walk: &mut Walk<'_>, around: Around<'_>) -> Option<Cause> {
        if !one.of_message() {
            return None;
        }
        if self.shared.is_none() {
            self.shared = Some(SharedCounter::new(one.t));
            walk.begin(one.row);
            walk.run(&mut self.shared, one.row, around.frames_of);
        }
        let shared = self.shared.as_ref()?;
        Some(Cause {
            explains: Explains::Types(shared.proven()?),
            t: shared.t,
            frames: shared.frames.clone(),
        })
    }

    fn wraps(&mut self, one: &Step) -> Option<Cause> {
        if one.rule == Rule::Copied || !self.wraps.add(one) {
            return None;
        }
        let alike = |held: &&Step| held.rule == Rule::Restarted && held.before == one.before;
        let first = self.held.iter().find(alike).unwrap_or(one);
        Some(Cause {
            explains: Explains::Wraps(one.id, one.before),
            t: first.t,
            frames: once_each(first.frames.iter().chain(&one.frames)),
        })
    }

    fn are_several(&mut self, one: &Step, around: Around<'_>) -> Option<Cause> {
        let shared = self.senders.shared(one, around)?;
        self.senders.seen = one.t;
        self.since = shared.since;
        let since = |held: &&Step| held.place == one.place && held.t >= shared.since;
        let first = self.held.iter().find(since).unwrap_or(one);
        Some(Cause {
            explains: shared.explains,
            t: first.t,
            frames: once_each(first.frames.iter().chain(&shared.frames)),
        })
    }
}

/// Numbers without repetitions, in their order.
fn once_each<'n>(numbers: impl Iterator<Item = &'n u64>) -> Vec<u64> {
    let mut found = vec![];
    for &number in numbers {
        if !found.contains(&number) {
            found.push(number);
        }
    }
    found
}
