//! The sessions of a node in which several devices send, by the starts of their transfers.
//!
//! Transfers are told in the order of their ends, and what never ends is told late; only the starts say who counted how.
#![forbid(unsafe_code)]

use std::collections::hash_map::Entry;
use std::collections::HashMap;

use super::around::Around;
use super::step::{Explains, Rule, Step};
use crate::diagnosis::counters::Counters;
use crate::diagnosis::index::{key, Frames, SESSION};
use crate::diagnosis::interleaved::Chain;
use crate::diagnosis::starts::{Latest, OddStart, Starts};
use crate::frames::NO_TIME;
use crate::seeded::Seeded;
use crate::wire::Tail;

/// Sessions of a node that are followed.
const SESSIONS: usize = 1 << 12;

/// A session that several devices share: what shows it, the time before the second one came, and frames of them.
#[derive(Debug)]
pub struct Shared {
    pub explains: Explains,
    pub since: i64,
    pub frames: Vec<u64>,
}

/// Follows the sessions of a node whose counters broke; `seen` is when one of several senders took over last.
#[derive(Clone, Debug)]
pub struct SeveralSenders {
    followed: HashMap<i64, Counters, Seeded>,
    pub seen: i64,
}

impl Default for SeveralSenders {
    fn default() -> Self {
        SeveralSenders {
            followed: HashMap::default(),
            seen: NO_TIME,
        }
    }
}

impl SeveralSenders {
    /// Forgets all sessions.
    pub fn clear(&mut self) {
        self.followed.clear();
    }

    /// What shows several senders in a session, up to an odd step of it; None if one is enough.
    pub fn shared(&mut self, one: &Step, around: Around<'_>) -> Option<Shared> {
        let room = self.followed.len() < SESSIONS;
        let followed = match self.followed.entry(one.place) {
            Entry::Occupied(known) => known.into_mut(),
            Entry::Vacant(new) if room => new.insert(followed_from(one, around)?),
            Entry::Vacant(_) => return None,
        };
        let number = *one.frames.last()?;
        if number >= followed.starts.next() {
            read(followed, around.frames);
        }
        while let Some((start, took_over)) = followed.shows(number, around.gaps) {
            if took_over {
                self.seen = start.t;
            }
        }
        shared_by(followed, one.code)
    }
}

/// Follows a session from an odd step on; None if its first frame is gone.
fn followed_from(one: &Step, around: Around<'_>) -> Option<Counters> {
    let number = *one.frames.first()?;
    let part = around.frames.part(number)?;
    let latest = Latest {
        id: one.id,
        t: one.t,
        tail: part.tail,
        body: part.body.to_vec(),
        ended: Tail(part.tail).end(),
    };
    let session = key((one.place >> 32) as u8, one.place as u32 & SESSION);
    let mut followed = Counters::new(Starts::new(session, number + 1, latest), one.before, around.least);
    let start = OddStart {
        number,
        t: one.t,
        before: one.before,
        id: one.id,
        since: one.since,
        again: false,
    };
    if one.rule != Rule::Copied && !around.gaps.explain(&start) {
        followed.add(&start);
    }
    Some(followed)
}

/// Reads the frames that were not read yet.
fn read(followed: &mut Counters, frames: Frames<'_>) {
    for index in frames.0 {
        if index.range().end > followed.starts.next() {
            followed.starts.read(index);
        }
    }
}

fn shared_by(followed: &Counters, code: i64) -> Option<Shared> {
    let chains = followed.chains();
    if !chains.is_empty() {
        return Some(Shared {
            explains: Explains::ByTurns(code, chains.iter().map(|one| one.last).collect()),
            since: onset(&chains)?,
            frames: chains.iter().filter_map(|one| one.start).collect(),
        });
    }
    let resumed = followed.goes_on()?;
    Some(Shared {
        explains: Explains::GoesOn(code, resumed.last, resumed.other),
        since: resumed.since,
        frames: resumed.number.into_iter().collect(),
    })
}

/// The time before the second counter began. One that never took over again was left behind by a loss.
fn onset(chains: &[Chain]) -> Option<i64> {
    let mut alive: Vec<&Chain> = chains.iter().filter(|one| one.turns > 1).collect();
    if alive.len() < 2 {
        alive = chains.iter().collect();
    }
    alive.sort_by_key(|one| one.begun);
    alive.get(1).map(|one| one.since)
}
