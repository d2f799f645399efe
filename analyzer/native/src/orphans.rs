//! Frames of sessions that belong to no transfer: which ones came since a time, before or behind another frame.
#![forbid(unsafe_code)]

use std::collections::{HashMap, VecDeque};
use std::ops::Range;

const SESSIONS: usize = 1 << 12;
/// Frames of a session that are remembered, the latest: those of two seconds and more.
const FRAMES: usize = 256;
const NO_TIME: i64 = i64::MIN;
const ID: u8 = 31;

#[derive(Clone, Copy, Debug)]
pub struct Frame {
    pub number: i64,
    pub t: i64,
    pub id: u8,
}

#[derive(Clone, Debug)]
struct Session {
    frames: VecDeque<Frame>,
    newest: i64,
}

/// A stretch of a session: since a time, frames of these numbers.
#[derive(Clone, Debug)]
pub struct Stretch {
    pub session: i64,
    pub since: i64,
    pub numbers: Range<i64>,
}

/// The frames of each session that belong to no transfer.
#[derive(Clone, Debug, Default)]
pub struct Orphans {
    sessions: HashMap<i64, Session>,
}

impl Orphans {
    pub fn add(&mut self, session: i64, frame: Frame) {
        if self.sessions.len() >= SESSIONS && !self.sessions.contains_key(&session) {
            return;
        }
        let known = self.sessions.entry(session).or_insert_with(|| Session {
            frames: VecDeque::with_capacity(8),
            newest: frame.t,
        });
        known.newest = known.newest.max(frame.t);
        if known.frames.len() == FRAMES {
            known.frames.pop_front();
        }
        known.frames.push_back(frame);
    }

    fn ids<'s>(&'s self, stretch: &'s Stretch) -> impl Iterator<Item = u8> + 's {
        let known = self.sessions.get(&stretch.session);
        let recent = known.filter(|known| stretch.since != NO_TIME && known.newest >= stretch.since);
        let frames = recent.into_iter().flat_map(|known| known.frames.iter().rev());
        let inside = |frame: &&Frame| frame.t >= stretch.since && stretch.numbers.contains(&frame.number);
        frames.filter(inside).map(|frame| frame.id)
    }

    /// Whether any frame came then.
    pub fn any(&self, stretch: &Stretch) -> bool {
        self.ids(stretch).next().is_some()
    }

    /// Whether frames with each of `count` transfer IDs from `first` on came then.
    pub fn all(&self, stretch: &Stretch, first: u8, count: u8) -> bool {
        let wanted = (0..count.min(ID + 1)).fold(0_u32, |bits, k| bits | 1 << (first.wrapping_add(k) & ID));
        self.ids(stretch).fold(0_u32, |bits, id| bits | 1 << (id & ID)) & wanted == wanted
    }
}
