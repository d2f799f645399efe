//! Where frames of a sender are missing: between two frames of a session that cannot follow each other.
#![forbid(unsafe_code)]

use std::collections::HashMap;

use super::known::Known;
use crate::frames::{ERROR, NO_TIME};
use crate::heard::by_session::Sent;
use crate::seeded::Seeded;
use crate::session_code::{is_response, is_service, node_of};

const START: u8 = 1 << 7;
const END: u8 = 1 << 6;
const TOGGLE: u8 = 1 << 5;
const ID: u8 = 31;
/// Whether a frame is the last one is not known before.
const FOLLOWS: u8 = START | TOGGLE | ID;
/// Frames that did not follow, of a session that may become known.
const MOST_UNKNOWN: i64 = 32;
/// One of so many requests may have an odd ID; of tools that count otherwise more have.
const HABIT: i64 = 4;
/// Within which a frame that was overtaken is still to come.
const SWAPPED: i64 = 100_000_000;
/// In place of the number of a frame.
const NONE: i64 = -1;

/// How much is remembered, and what joint lacks are: times in ns.
#[derive(Clone, Copy, Debug)]
pub struct Limits {
    pub sessions: usize,
    /// Frames of the bus, as it is on average, and no less than `window`, nor more than `widest`.
    pub few: i64,
    pub window: i64,
    pub widest: i64,
    /// What is missing so long before may not be joint with what is missing now.
    pub reach: i64,
}

/// Frames are missing between two of a session: numbers, times and places of these.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Lack {
    pub session: i64,
    pub number: i64,
    pub behind: i64,
    pub since: i64,
    pub until: i64,
    pub place: i64,
    pub place_behind: i64,
    /// What the second one has in its tail byte, and what it should have.
    pub tail: u8,
    pub wanted: u8,
    /// How far joint ones are apart at most.
    pub window: i64,
    /// The frame at which the session left off where it goes on now, or -1.
    pub left: i64,
    /// Nothing is missing: frames only came in another order.
    pub void: bool,
}

/// Frames of a bus in a batch, and the flags of all frames of that; time does not go back in it if that goes `forward`.
#[derive(Clone, Copy, Debug)]
pub struct Batch<'a> {
    pub bus: u8,
    pub sent: Sent<'a>,
    pub flags: &'a [u16],
    pub forward: bool,
}

/// The latest lack of a session: its second frame, and what of it decides about the next one.
#[derive(Clone, Copy, Debug)]
struct Latest {
    behind: i64,
    until: i64,
    wanted: Option<u8>,
    void: bool,
}

impl Latest {
    const NONE: Latest = Latest {
        behind: NONE,
        until: 0,
        wanted: None,
        void: false,
    };
}

/// The last frame of a session, how many did not follow the one before as they should, transfers begun.
#[derive(Clone, Copy, Debug)]
struct Last {
    tail: u8,
    t: i64,
    number: i64,
    place: i64,
    odd: i64,
    begun: i64,
    latest: Latest,
}

impl Last {
    const NONE: Last = Last {
        tail: 0,
        t: NO_TIME,
        number: NONE,
        place: NONE,
        odd: 0,
        begun: 0,
        latest: Latest::NONE,
    };
}

/// A bus so far: frames, its first time, and the senders, a bit each.
#[derive(Clone, Copy, Debug)]
struct Bus {
    heard: i64,
    since: i64,
    senders: u128,
}

/// Follows the tail bytes of all transfers.
#[derive(Clone, Debug)]
pub struct Lacks {
    limits: Limits,
    pub known: Known,
    last: HashMap<i64, Last, Seeded>,
    buses: HashMap<u8, Bus>,
    found: Vec<Lack>,
}

impl Lacks {
    pub fn new(limits: Limits) -> Lacks {
        Lacks {
            limits,
            known: Known::default(),
            last: HashMap::default(),
            buses: HashMap::new(),
            found: vec![],
        }
    }

    /// Whether transfers may prove something new: of these sessions or those that were heard some are not known, or were
    /// left out.
    pub fn open(&self, codes: &[i64]) -> bool {
        let full = self.last.len() >= self.limits.sessions;
        full || codes.iter().chain(self.last.keys()).any(|&code| !self.known.has(code))
    }

    /// Adds the frames of a bus; false if columns do not fit together.
    pub fn feed(&mut self, batch: &Batch<'_>) -> bool {
        let sent = &batch.sent;
        let fits = sent.fits() && batch.flags.len() == sent.t.len();
        if !fits || sent.codes.is_empty() {
            return sent.codes.is_empty();
        }
        let base = self.buses.get(&batch.bus).map_or(0, |bus| bus.heard);
        let begins = sent.first[..sent.codes.len()]
            .iter()
            .map(|&at| sent.t[sent.row[at as usize] as usize]);
        let bus = self.buses.entry(batch.bus).or_insert(Bus {
            heard: 0,
            since: begins.min().unwrap_or(NO_TIME),
            senders: 0,
        });
        bus.heard += sent.row.len() as i64;
        bus.senders = sent
            .codes
            .iter()
            .fold(bus.senders, |all, &code| all | 1 << node_of(code));
        let (since, alone) = (bus.since, bus.senders.is_power_of_two());
        let errors = batch.flags.iter().fold(0, |all, flags| all | flags) & ERROR != 0;
        let without = self.beyond(sent);
        let begin = self.found.len();
        for k in (0..sent.codes.len()).filter(|&k| !without[k]) {
            self.follow(sent, k, (base, since), errors.then_some(batch.flags));
        }
        if alone && batch.forward && self.found.len() > begin {
            self.near_end(begin, sent.t.iter().copied().max().unwrap_or(NO_TIME));
        }
        true
    }

    /// Which sessions there is no room for: known ones go first, then those that were heard first.
    fn beyond(&self, sent: &Sent<'_>) -> Vec<bool> {
        let room = self.limits.sessions.saturating_sub(self.last.len());
        let mut beyond = vec![false; sent.codes.len()];
        if sent.codes.len() <= room {
            return beyond;
        }
        let unheard = |k: &usize| !self.last.contains_key(&sent.codes[*k]);
        let mut new: Vec<usize> = (0..sent.codes.len()).filter(unheard).collect();
        if new.len() > room {
            new.sort_by_key(|&k| (!self.known.has(sent.codes[k]), sent.heard(k)));
            new[room..].iter().for_each(|&k| beyond[k] = true);
        }
        beyond
    }

    /// Looks at each frame of a session; `base` are the frames of the bus before the batch, `start` its first time. Those
    /// are no frames whose `flags` say so, if some do.
    fn follow(&mut self, sent: &Sent<'_>, k: usize, (base, start): (i64, i64), flags: Option<&[u16]>) {
        let code = sent.codes[k];
        let mut last = self.last.get(&code).copied().unwrap_or(Last::NONE);
        let known = self.known.since(code);
        let (mut odd_at_all, service, response) = (last.odd, is_service(code), is_response(code));
        for at in sent.places(k) {
            let row = sent.row[at] as usize;
            if flags.is_some_and(|flags| flags[row] & ERROR != 0) {
                continue;
            }
            let (before, tail) = (last, sent.tail[at]);
            let (number, place) = (sent.number + row as i64, sent.place[at] + base);
            let starts = tail & START != 0;
            last.begun += i64::from(starts);
            last.tail = tail;
            (last.t, last.number, last.place) = (sent.t[row], number, place);
            let wanted = wanted(before.tail);
            if tail & FOLLOWS == wanted || tail == before.tail || before.number == NONE {
                continue;
            }
            odd_at_all += 1;
            let ended = before.tail & END != 0;
            if (last.t < known && odd_at_all > MOST_UNKNOWN) || (ended && tail & FOLLOWS == START) {
                continue;
            }
            last.odd += 1;
            if (service && HABIT * last.odd > last.begun) || (response && ended && starts) {
                continue;
            }
            let each = last.t.wrapping_sub(start).max(0).checked_div(place).unwrap_or(0);
            self.found.push(Lack {
                session: code,
                number: before.number,
                behind: number,
                since: before.t,
                until: last.t,
                place: before.place,
                place_behind: place,
                tail: tail & FOLLOWS,
                wanted,
                window: self
                    .limits
                    .few
                    .wrapping_mul(each)
                    .clamp(self.limits.window, self.limits.widest),
                left: NONE,
                void: false,
            });
        }
        self.last.insert(code, last);
    }

    /// Leaves out of what the only sender of a bus lacks what no later one can lack together with it.
    ///
    /// Where frames may have come in another order nothing is left out. `end` is the time of the last frame.
    fn near_end(&mut self, begin: usize, end: i64) {
        let lacks = self.found.split_off(begin);
        let late: Vec<bool> = lacks.iter().map(|one| one.until >= end - self.limits.reach).collect();
        let mut at = 0;
        for own in lacks.chunk_by(|one, other| one.session == other.session) {
            let last = self.last.get_mut(&own[0].session);
            let latest = last.as_ref().map_or(Latest::NONE, |last| last.latest);
            let again = own.windows(2).any(|pair| pair[1].tail == pair[0].wanted);
            let whole = again || latest.void || latest.wanted == Some(own[0].tail);
            let kept = (at..)
                .zip(own)
                .filter(|&(k, _)| whole || late[k] || late.get(k + 1) == Some(&true));
            let before = self.found.len();
            self.found.extend(kept.map(|(_, one)| one));
            if self.found.len() - before < own.len() {
                if let Some(last) = last {
                    last.latest = Latest::NONE;
                }
            }
            at += own.len();
        }
    }

    /// All that is missing since the last time, in the order of the frames behind it, and second frames of what is void
    /// now from before: what was missing is taken back if it comes, and so is what is odd about the frames around it.
    pub fn take(&mut self) -> (Vec<Lack>, Vec<i64>) {
        let mut lacks = std::mem::take(&mut self.found);
        lacks.sort_by_key(|one| one.place_behind);
        let mut latest_row: HashMap<i64, usize, Seeded> = HashMap::default();
        let mut gone = vec![];
        for k in 0..lacks.len() {
            let one = lacks[k];
            let Some(last) = self.last.get_mut(&one.session) else {
                continue;
            };
            let before = last.latest;
            let returns = before.wanted == Some(one.tail);
            let swaps = returns && one.until.wrapping_sub(before.until) <= SWAPPED;
            let void = if before.void {
                before.behind == one.number
            } else {
                swaps
            };
            lacks[k].void |= void;
            lacks[k].left = if returns { before.behind } else { NONE };
            match latest_row.insert(one.session, k) {
                Some(row) => lacks[row].void |= swaps,
                None if swaps && !before.void => gone.push(before.behind),
                None => {}
            }
            last.latest = Latest {
                behind: one.behind,
                until: one.until,
                wanted: Some(one.wanted),
                void,
            };
        }
        (lacks, gone)
    }
}

/// What the tail byte behind one should have of [`FOLLOWS`].
fn wanted(tail: u8) -> u8 {
    if tail & END == 0 {
        tail & ID | !tail & TOGGLE
    } else {
        START | tail.wrapping_add(1) & ID
    }
}
