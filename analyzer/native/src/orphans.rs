//! Frames of sessions that belong to no transfer: which ones came since a time, before or behind another frame.
#![forbid(unsafe_code)]

use std::collections::{HashMap, VecDeque};
use std::ops::Range;

const SESSIONS: usize = 1 << 12;
/// Frames of a session that are remembered, the latest: those of two seconds and more.
const FRAMES: usize = 256;
const NO_TIME: i64 = i64::MIN;
const ID_BITS: u32 = 5;
const ID: u8 = (1 << ID_BITS) - 1;

#[derive(Clone, Copy, Debug)]
pub struct Frame {
    pub number: i64,
    pub t: i64,
    pub id: u8,
}

#[derive(Clone, Debug)]
struct Session {
    frames: VecDeque<Kept>,
    newest: i64,
}

/// A frame in two thirds of the room: its time, and its transfer ID below its number.
#[derive(Clone, Copy, Debug)]
struct Kept(i64, i64);

impl Kept {
    fn of(frame: Frame) -> Self {
        Kept(frame.t, frame.number << ID_BITS | i64::from(frame.id & ID))
    }

    fn frame(self) -> Frame {
        Frame {
            number: self.1 >> ID_BITS,
            t: self.0,
            id: self.1 as u8 & ID,
        }
    }
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
        known.frames.push_back(Kept::of(frame));
    }

    fn ids<'s>(&'s self, stretch: &'s Stretch) -> impl Iterator<Item = u8> + 's {
        let known = self.sessions.get(&stretch.session);
        let recent = known.filter(|known| stretch.since != NO_TIME && known.newest >= stretch.since);
        let frames = recent.into_iter().flat_map(|known| known.frames.iter().rev());
        let frames = frames.map(|kept| kept.frame());
        let inside = |frame: &Frame| frame.t >= stretch.since && stretch.numbers.contains(&frame.number);
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

#[cfg(test)]
mod tests {
    use super::{Frame, Orphans, Stretch, FRAMES, NO_TIME, SESSIONS};
    use std::ops::Range;

    fn orphans(frames: impl IntoIterator<Item = (i64, i64, u8)>) -> Orphans {
        let mut found = Orphans::default();
        for (number, t, id) in frames {
            found.add(1, Frame { number, t, id });
        }
        found
    }

    fn stretch(session: i64, since: i64, numbers: Range<i64>) -> Stretch {
        Stretch {
            session,
            since,
            numbers,
        }
    }

    #[test]
    fn a_stretch_has_frames_of_its_session_and_numbers_since_its_time() {
        let found = orphans([(10, 100, 3), (20, 200, 4)]);
        assert!(found.any(&stretch(1, 100, 10..11)));
        assert!(!found.any(&stretch(2, 100, 10..11)), "another session");
        assert!(
            !found.any(&stretch(1, 101, 10..20)),
            "too early, and before the other one"
        );
        assert!(!found.any(&stretch(1, 201, 0..99)), "nothing is as new");
        assert!(!found.any(&stretch(1, NO_TIME, 0..99)), "no time to count from");
    }

    #[test]
    fn every_one_of_some_transfer_ids_has_to_be_there() {
        let found = orphans([(10, 100, 30), (11, 100, 31), (12, 100, 0), (40, 100, 1)]);
        assert!(found.all(&stretch(1, 0, 10..20), 30, 3), "IDs begin again at 0");
        assert!(!found.all(&stretch(1, 0, 10..20), 30, 4), "the last one came later");
        assert!(found.all(&stretch(1, 0, 10..50), 30, 4));
        assert!(found.all(&stretch(1, 0, 10..20), 5, 0), "none is asked for");
        assert!(!found.all(&stretch(1, 0, 10..50), 0, 99), "no more IDs than there are");
    }

    #[test]
    fn a_session_keeps_its_latest_frames_and_no_others_come_beyond_the_bound() {
        let most = FRAMES as i64;
        let mut found = orphans((0..=most).map(|number| (number, number, 0)));
        assert!(!found.any(&stretch(1, 0, 0..1)));
        assert!(found.any(&stretch(1, 0, 1..2)));
        let frame = Frame { number: 5, t: 5, id: 0 };
        for session in 2..=SESSIONS as i64 + 1 {
            found.add(session, frame);
        }
        assert!(found.any(&stretch(SESSIONS as i64, 0, 5..6)));
        assert!(!found.any(&stretch(SESSIONS as i64 + 1, 0, 5..6)));
    }
}
