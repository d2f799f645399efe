//! One counter that goes on although transfers with other IDs come in between: those are another sender's.
#![forbid(unsafe_code)]

use std::collections::VecDeque;

use super::starts::OddStart;
use super::ID;
use crate::frames::NO_TIME;

/// Interruptions that are judged.
const LATEST: usize = 64;
/// IDs in a row that make an interruption the counter: what is between was lost.
const COUNTS: u8 = 2;
/// IDs that an interruption may have on average; by chance 32 bring the next one.
const OTHERS: usize = 4;
/// Transfers that changed places with each other.
const MOVED: u8 = 8;

/// Nanoseconds in which the other one may have been taken for it.
const BEFORE: i64 = 1_000_000_000;

/// The time before it, how many IDs it had, and whether the counter went on behind it.
#[derive(Clone, Copy, Debug)]
struct Interruption {
    since: i64,
    ids: usize,
    survived: bool,
}

/// A counter that goes on: its ID, the frame where it last did, a time before the first interruption.
///
/// `other` is the ID that most of those in between have, if there is one.
#[derive(Clone, Copy, Debug)]
pub struct GoesOn {
    pub last: u8,
    pub number: Option<u64>,
    pub since: i64,
    pub other: Option<u8>,
}

/// Tells whether a counter goes on by 1 behind each interruption; it is told only of starts whose step is not 1.
///
/// A sender that loses transfers, begins anew or changes their order does not come back to where it was. The other one
/// may send one ID again and again, or any. An ID that was there shortly before may be a late copy, and proves nothing.
#[derive(Clone, Debug)]
pub struct Resumed {
    last: u8,
    number: Option<u64>,
    /// The ID that interrupts it now.
    other: Option<u8>,
    now: Interruption,
    copy: bool,
    past: VecDeque<Interruption>,
    survived: usize,
    /// Of the other one.
    ids: VecDeque<u8>,
}

impl Resumed {
    /// Begins with the counter's ID.
    pub fn new(last: u8) -> Self {
        Resumed {
            last,
            number: None,
            other: None,
            now: Interruption {
                since: NO_TIME,
                ids: 0,
                survived: false,
            },
            copy: true,
            past: VecDeque::new(),
            survived: 0,
            ids: VecDeque::new(),
        }
    }

    /// Adds a start; returns whether the counter goes on behind an interruption with it.
    pub fn add(&mut self, one: &OddStart) -> bool {
        match self.other {
            None => self.last = one.before,
            Some(other) if one.before.wrapping_sub(other) & ID >= COUNTS => {
                self.end(false);
                self.last = one.before;
            }
            Some(_) => {}
        }
        if self.other.is_some() && one.id == (self.last + 1) & ID {
            (self.last, self.number) = (one.id, Some(one.number));
            let proves = !self.copy;
            self.end(true);
            return proves;
        }
        if !one.again {
            self.interrupt(one);
        }
        false
    }

    fn end(&mut self, survived: bool) {
        if !survived || !self.copy {
            if self.past.len() == LATEST {
                self.survived -= usize::from(self.past.pop_front().is_some_and(|one| one.survived));
            }
            self.past.push_back(Interruption { survived, ..self.now });
            self.survived += usize::from(survived);
        }
        if !survived {
            self.ids.clear();
        }
        self.other = None;
    }

    fn interrupt(&mut self, one: &OddStart) {
        if self.other.is_none() {
            (self.now.since, self.now.ids, self.copy) = (one.since, 0, true);
        }
        self.now.ids += usize::from(self.other != Some(one.id));
        self.other = Some(one.id);
        if self.last.wrapping_sub(one.id) & ID > MOVED {
            self.copy = false;
            if self.ids.len() == LATEST {
                self.ids.pop_front();
            }
            self.ids.push_back(one.id);
        }
    }

    /// What goes on, if it did so often, and seldom did not.
    pub fn goes_on(&self, least: usize) -> Option<GoesOn> {
        let survived = self.survived;
        if survived < least || 4 * (self.past.len() - survived) > survived {
            return None;
        }
        let ids: usize = self.past.iter().filter(|one| one.survived).map(|one| one.ids).sum();
        if ids > OTHERS * survived {
            return None;
        }
        let timed = self.past.iter().find(|one| one.survived && one.since != NO_TIME);
        let often = |id: &&u8| 4 * self.ids.iter().filter(|other| other == id).count() > 3 * self.ids.len();
        Some(GoesOn {
            last: self.last,
            number: self.number,
            since: timed.map_or(NO_TIME, |one| one.since.saturating_sub(BEFORE)),
            other: self.ids.iter().find(often).copied(),
        })
    }
}
