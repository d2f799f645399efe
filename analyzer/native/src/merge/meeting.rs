//! How far the clocks of two captures are apart, from frames that both saw.
#![forbid(unsafe_code)]

use std::collections::HashMap;

use super::overlap::content;
use crate::frames::{Frames, NO_TIME};

/// Different frames remembered; beyond that only every second one is, then every fourth, and so on.
const MOST: usize = 1 << 17;
/// Clocks that run apart keep their difference within this.
const WIDTH: i64 = 200_000_000;
/// Clocks run apart: the first few frames that both saw say how far they are at the beginning.
const FIRST: usize = 25;
/// Frames that have to agree, and their part of all the frames that both could have seen.
const ENOUGH: usize = 8;
const PART: usize = 2;

/// Frames of a capture that occur once in it, by content.
#[derive(Default)]
pub struct Fingerprint {
    /// The time of a frame, [`NO_TIME`] if it came again.
    once: HashMap<u64, i64>,
    /// Frames are kept whose hash ends in this many zero bits.
    thin: u32,
    start: Option<i64>,
}

/// What to add to the second clock, and how many frames say so.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Meeting {
    pub offset: i64,
    pub frames: usize,
}

impl Fingerprint {
    pub fn add(&mut self, frames: &Frames) {
        for row in 0..frames.len() {
            let t = frames.t[row];
            let key = content(0, (frames.id[row], frames.flags[row], frames.data_of(row)));
            if t != NO_TIME {
                self.start = Some(self.start.map_or(t, |start| start.min(t)));
            }
            if t == NO_TIME || key.trailing_zeros() < self.thin {
                continue;
            }
            self.once.entry(key).and_modify(|t| *t = NO_TIME).or_insert(t);
            if self.once.len() > MOST {
                self.thin += 1;
                let thin = self.thin;
                self.once.retain(|key, _| key.trailing_zeros() >= thin);
            }
        }
    }

    /// The earliest time of any frame.
    pub fn start(&self) -> Option<i64> {
        self.start
    }

    /// The difference of the clocks at the beginning, if the two captures overlap and agree on most of what both saw.
    pub fn meet(&self, other: &Fingerprint) -> Option<Meeting> {
        let mut apart: Vec<(i64, i64)> = self
            .unique(other.thin)
            .filter_map(|(key, t)| Some((t.saturating_sub(*other.once.get(key).filter(|&&t| t != NO_TIME)?), t)))
            .collect();
        apart.sort_unstable();
        let (mut start, mut best) = (0, 0..0);
        for end in 0..apart.len() {
            while apart[end].0.saturating_sub(apart[start].0) > WIDTH {
                start += 1;
            }
            if end + 1 - start > best.len() {
                best = start..end + 1;
            }
        }
        let frames = best.len();
        if frames < ENOUGH {
            return None;
        }
        let mut met = apart[best].to_vec();
        met.sort_unstable_by_key(|&(_, t)| t);
        met.truncate(FIRST);
        met.sort_unstable();
        let offset = met[met.len() / 2].0;
        let (mine, yours) = (self.span(other.thin, 0)?, other.span(self.thin, offset)?);
        let (low, high) = (mine.0.max(yours.0), mine.1.min(yours.1));
        let within = |print: &Fingerprint, thin, offset: i64| {
            let times = print.unique(thin).map(|(_, t)| t.saturating_add(offset));
            times.filter(|t| (low..=high).contains(t)).count()
        };
        let both = within(self, other.thin, 0).min(within(other, self.thin, offset));
        (frames * PART >= both).then_some(Meeting { offset, frames })
    }

    /// The frames that occur once and that a capture thinned to `thin` would have kept.
    fn unique(&self, thin: u32) -> impl Iterator<Item = (&u64, i64)> {
        let kept = self
            .once
            .iter()
            .filter(move |(key, &t)| t != NO_TIME && key.trailing_zeros() >= thin);
        kept.map(|(key, &t)| (key, t))
    }

    fn span(&self, thin: u32, offset: i64) -> Option<(i64, i64)> {
        let times = || self.unique(thin).map(|(_, t)| t.saturating_add(offset));
        Some((times().min()?, times().max()?))
    }
}
