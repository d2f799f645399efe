//! Frames of sessions that belong to no transfer: which ones came since a time, before or behind another frame.
#![forbid(unsafe_code)]

use std::collections::{HashMap, VecDeque};

use crate::seeded::Seeded;

const SESSIONS: usize = 1 << 12;
/// Frames of a session that are looked through, the latest: those of two seconds and more.
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

/// Its frames in the order of their numbers.
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

    fn number(self) -> i64 {
        self.1 >> ID_BITS
    }

    fn id(self) -> u8 {
        self.1 as u8 & ID
    }
}

/// Where somebody looks: from a frame of a session on, or back from it, for what came since a time.
#[derive(Clone, Copy, Debug)]
pub struct Place {
    pub session: i64,
    pub since: i64,
    pub number: i64,
}

/// The frames of each session that belong to no transfer.
#[derive(Clone, Debug, Default)]
pub struct Orphans {
    sessions: HashMap<i64, Session, Seeded>,
    /// Sessions with more frames than are looked through.
    full: Vec<i64>,
}

impl Orphans {
    /// Forgets all but the latest frames of each session, before those of the next batch come: of these all are there as
    /// long as somebody asks, so that what is found does not depend on where batches begin.
    pub fn forget(&mut self) {
        for session in self.full.drain(..) {
            if let Some(known) = self.sessions.get_mut(&session) {
                let over = known.frames.len().saturating_sub(FRAMES);
                known.frames.drain(..over);
                known.frames.shrink_to(2 * FRAMES);
            }
        }
    }

    pub fn add(&mut self, session: i64, frame: Frame) {
        if self.sessions.len() >= SESSIONS && !self.sessions.contains_key(&session) {
            return;
        }
        let known = self.sessions.entry(session).or_insert_with(|| Session {
            frames: VecDeque::with_capacity(8),
            newest: frame.t,
        });
        known.newest = known.newest.max(frame.t);
        let at = match known.frames.back() {
            Some(last) if last.number() > frame.number => known.before(frame.number),
            _ => known.frames.len(),
        };
        known.frames.insert(at, Kept::of(frame));
        if known.frames.len() == FRAMES + 1 {
            self.full.push(session);
        }
    }

    /// Whether any frame came before one.
    pub fn before(&self, place: &Place) -> bool {
        self.recent(place)
            .is_some_and(|known| known.back(place).next().is_some())
    }

    /// Whether any frame came behind one.
    pub fn behind(&self, place: &Place) -> bool {
        self.recent(place).is_some_and(|known| {
            let frames = known.frames.range(known.before(place.number.saturating_add(1))..);
            frames.take(FRAMES).any(|frame| frame.0 >= place.since)
        })
    }

    /// Whether frames with each of `count` transfer IDs from `first` on came before one.
    pub fn cover(&self, place: &Place, first: u8, count: u8) -> bool {
        let wanted = (0..count.min(ID + 1)).fold(0_u32, |bits, k| bits | 1 << (first.wrapping_add(k) & ID));
        let frames = self.recent(place).into_iter().flat_map(|known| known.back(place));
        frames.fold(0_u32, |bits, frame| bits | 1 << frame.id()) & wanted == wanted
    }

    fn recent(&self, place: &Place) -> Option<&Session> {
        let known = self.sessions.get(&place.session);
        known.filter(|known| place.since != NO_TIME && known.newest >= place.since)
    }
}

impl Session {
    /// How many frames came before one.
    fn before(&self, number: i64) -> usize {
        self.frames.partition_point(|frame| frame.number() < number)
    }

    /// The latest frames before one, the last one first.
    fn back(&self, place: &Place) -> impl Iterator<Item = &Kept> {
        let (end, since) = (self.before(place.number), place.since);
        let frames = self.frames.range(..end).rev().take(FRAMES);
        frames.filter(move |frame| frame.0 >= since)
    }
}

#[cfg(test)]
mod tests {
    use super::{Frame, Orphans, Place, FRAMES, NO_TIME, SESSIONS};

    fn orphans(frames: impl IntoIterator<Item = (i64, i64, u8)>) -> Orphans {
        let mut found = Orphans::default();
        for (number, t, id) in frames {
            found.add(1, Frame { number, t, id });
        }
        found
    }

    fn place(session: i64, since: i64, number: i64) -> Place {
        Place { session, since, number }
    }

    #[test]
    fn frames_of_a_session_came_before_one_or_behind_it_since_a_time() {
        let found = orphans([(10, 100, 3), (20, 200, 4)]);
        assert!(found.before(&place(1, 100, 11)));
        assert!(!found.before(&place(1, 100, 10)), "it is that one itself");
        assert!(!found.before(&place(2, 100, 11)), "another session");
        assert!(!found.before(&place(1, 101, 20)), "too early, and not before it");
        assert!(!found.before(&place(1, 201, 99)), "nothing is as new");
        assert!(!found.before(&place(1, NO_TIME, 99)), "no time to count from");
        assert!(found.behind(&place(1, 101, 10)));
        assert!(!found.behind(&place(1, 100, 20)), "it is that one itself");
        assert!(!found.behind(&place(1, 201, 10)));
        assert!(!found.behind(&place(1, 100, i64::MAX)));
    }

    #[test]
    fn every_one_of_some_transfer_ids_has_to_be_there() {
        let found = orphans([(10, 100, 30), (11, 100, 31), (12, 100, 0), (40, 100, 1)]);
        assert!(found.cover(&place(1, 0, 20), 30, 3), "IDs begin again at 0");
        assert!(!found.cover(&place(1, 0, 20), 30, 4), "the last one came later");
        assert!(found.cover(&place(1, 0, 50), 30, 4));
        assert!(found.cover(&place(1, 0, 20), 5, 0), "none is asked for");
        assert!(!found.cover(&place(1, 0, 50), 0, 99), "no more IDs than there are");
    }

    #[test]
    fn what_came_late_stands_in_its_place() {
        let found = orphans([(10, 100, 3), (30, 300, 5), (20, 200, 4)]);
        assert!(found.cover(&place(1, 0, 21), 3, 2));
        assert!(!found.cover(&place(1, 0, 20), 3, 2));
        assert!(found.behind(&place(1, 0, 20)));
    }

    #[test]
    fn the_latest_frames_of_a_session_are_looked_through_wherever_batches_begin() {
        let frame = |k: i64| Frame {
            number: k,
            t: k,
            id: if k == 0 { 7 } else { 0 },
        };
        let last = FRAMES as i64;
        for cut in [0, 1, 100, last, last + 1] {
            let mut found = Orphans::default();
            for k in 0..=last {
                if k == cut {
                    found.forget();
                }
                found.add(1, frame(k));
            }
            assert!(found.cover(&place(1, 0, last), 7, 1) || cut == last + 1);
            assert!(!found.cover(&place(1, 0, last + 1), 7, 1), "one too many lies between");
        }
    }

    #[test]
    fn memory_has_a_bound() {
        let mut found = orphans((0..4 * FRAMES as i64).map(|k| (k, k, 0)));
        for k in 0..2 * SESSIONS as i64 {
            let (number, t, id) = (k, k, 0);
            found.add(k, Frame { number, t, id });
        }
        found.forget();
        assert_eq!(found.sessions.len(), SESSIONS);
        assert!(found.sessions.values().all(|known| known.frames.len() <= FRAMES));
        assert!(found.sessions[&1].frames.capacity() <= 4 * FRAMES);
    }
}
