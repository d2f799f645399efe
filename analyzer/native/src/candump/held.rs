//! Rows that wait until it is known what small time stamps count from. `candump -t z` counts from the first frame,
//! `-t d` from the line before, and both look the same; but only differences can shrink on one interface.
#![forbid(unsafe_code)]

use crate::events::Events;
use crate::frames::Frames;
use crate::stamp::Stamps;

/// Relative stamps looked at before "counted from the first frame" is taken for granted.
const STAMPS: usize = 32;
/// Rows of any kind held meanwhile, at most.
const ROWS: usize = 64;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Base {
    Unknown,
    First,
    Previous { sum: i64 },
}

/// A held row with a relative stamp.
#[derive(Clone, Copy, Debug)]
struct Mark {
    bus: u8,
    is_event: bool,
    row: usize,
    ns: i64,
}

#[derive(Debug)]
pub(super) struct Held {
    base: Base,
    marks: Vec<Mark>,
    frames: Frames,
    events: Events,
}

impl Held {
    pub(super) fn new() -> Held {
        Held {
            base: Base::Unknown,
            marks: vec![],
            frames: Frames::default(),
            events: Events::default(),
        }
    }

    /// Rows are held now, so that later rows must queue behind them.
    pub(super) fn is_waiting(&self) -> bool {
        !self.marks.is_empty()
    }

    /// The time of a row with a relative stamp once the base is known; `None` when the sum does not fit.
    pub(super) fn time(&mut self, ns: i64) -> Option<i64> {
        if let Base::Previous { sum } = &mut self.base {
            *sum = sum.checked_add(ns)?;
            return Some(*sum);
        }
        Some(ns)
    }

    /// Announces that the row pushed next carries a relative stamp.
    pub(super) fn mark(&mut self, bus: u8, is_event: bool, ns: i64) {
        if self.base == Base::Unknown {
            let row = if is_event { self.events.len() } else { self.frames.len() };
            self.marks.push(Mark { bus, is_event, row, ns });
        }
    }

    /// Where the next row goes.
    pub(super) fn tables<'a>(
        &'a mut self,
        frames: &'a mut Frames,
        events: &'a mut Events,
    ) -> (&'a mut Frames, &'a mut Events) {
        if self.is_waiting() {
            (&mut self.frames, &mut self.events)
        } else {
            (frames, events)
        }
    }

    /// Lets the rows go when enough is known; returns what was found.
    pub(super) fn settle(&mut self, frames: &mut Frames, events: &mut Events, at_end: bool) -> Stamps {
        let Some(last) = self.marks.last() else {
            return Stamps::default();
        };
        // Falling to exactly zero may be a second recording behind the first.
        let before = self.marks.iter().rev().skip(1).find(|mark| mark.bus == last.bus);
        let shrinks = last.ns > 0 && before.is_some_and(|before| last.ns < before.ns);
        let full = self.marks.len() >= STAMPS || self.frames.len() + self.events.len() >= ROWS;
        if !shrinks && !full && !at_end {
            return Stamps::default();
        }
        self.base = if shrinks {
            Base::Previous { sum: 0 }
        } else {
            Base::First
        };
        if let Base::Previous { sum } = &mut self.base {
            for mark in &self.marks {
                // No overflow: a relative stamp is below 1e17 ns, and there are at most `STAMPS`.
                *sum += mark.ns;
                if mark.is_event {
                    self.events.t[mark.row] = *sum;
                } else {
                    self.frames.t[mark.row] = *sum;
                }
            }
        }
        self.release(frames, events);
        if shrinks {
            Stamps::DELTA
        } else {
            Stamps::ZERO
        }
    }

    fn release(&mut self, frames: &mut Frames, events: &mut Events) {
        self.marks = vec![];
        let held = std::mem::take(&mut self.frames);
        frames.extend(&held);
        let held = std::mem::take(&mut self.events);
        events.extend(&held, 0..held.len());
    }
}
