//! One counter for several types.
#![forbid(unsafe_code)]

use std::collections::HashMap;

use super::step::ID;
use crate::seeded::Seeded;

/// Messages that count together without a break, and of each type that is judged.
const RUN: u64 = 20;
const EACH: u64 = 3;
/// Messages of a shared counter that are evidence.
const MOST_SHOWN: u64 = 8;

/// A message of a node: the row in its batch, its type, its ID, and the step of its own session.
#[derive(Clone, Copy, Debug)]
pub struct Message {
    pub row: u32,
    pub code: i64,
    pub id: u8,
    pub step: u8,
}

/// Messages of a node whose IDs rise by 1 over all types, from a breach at `t` on; it ends where they do not.
#[derive(Clone, Debug)]
pub struct SharedCounter {
    pub t: i64,
    last: Option<u8>,
    run: u64,
    /// Messages of each type, and how many of them did not count on in their own session.
    types: HashMap<i64, (u64, u64), Seeded>,
    pub frames: Vec<u64>,
}

impl SharedCounter {
    pub fn new(t: i64) -> Self {
        SharedCounter {
            t,
            last: None,
            run: 0,
            types: HashMap::default(),
            frames: vec![],
        }
    }

    /// Adds the node's next message; false if it does not count on.
    pub fn fits(&mut self, one: &Message, frames_of: &dyn Fn(u32) -> Vec<u64>) -> bool {
        if self.last.is_some_and(|last| (last + 1) & ID != one.id) {
            return false;
        }
        let (sent, jumps) = self.types.entry(one.code).or_default();
        *sent += 1;
        // A type may jump by exactly 32, which reads as a repetition; the first step belongs to what was before.
        *jumps += u64::from(one.step != 1 && self.last.is_some());
        if self.run < MOST_SHOWN {
            self.frames.extend(frames_of(one.row));
        }
        self.last = Some(one.id);
        self.run += 1;
        true
    }

    /// How many types count together, if several do, and none of those sent often counts alone.
    pub fn proven(&self) -> Option<usize> {
        let often = || self.types.values().filter(|(sent, _)| *sent >= EACH);
        let proven = self.run >= RUN && often().count() > 1 && often().all(|(_, jumps)| *jumps > 0);
        proven.then_some(self.types.len())
    }
}
