//! Requests and responses of services: which belong together, and which are late or missing.
//!
//! A transfer comes out when its session is proven, a request perhaps long after its response: each waits, and they are
//! taken in the order of their first frames.
#![forbid(unsafe_code)]

use std::collections::{BTreeMap, HashMap, HashSet, VecDeque};
use std::iter::once;

use crate::seeded::Seeded;

const NO_TIME: i64 = i64::MIN;
const NODES: i64 = 128;

/// Times in ns: after which a client gives up, a response is slow, it belongs to no request any more, and none that comes
/// before can still come out. At most so many transfers of a link wait, and so many links are followed.
#[derive(Clone, Copy, Debug)]
pub struct Limits {
    pub answer: i64,
    pub slow: i64,
    pub open: i64,
    pub late: i64,
    pub waiting: usize,
    pub links: usize,
}

/// A request or response. `id` is whatever its events are to be called, `first` the number of its first frame.
#[derive(Clone, Copy, Debug)]
pub struct Part {
    pub id: i64,
    pub first: i64,
    pub t: i64,
    pub t_end: i64,
    pub transfer_id: u8,
    pub priority: u8,
    pub asks: bool,
    pub whole: bool,
}

/// What there is to say of a transfer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub enum Kind {
    /// A response without a request.
    Stray,
    /// A request without a response.
    Missed,
    Slow,
    Repeated,
    OtherPriority,
}

/// What is said of a transfer, and the one that it is compared with.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Event {
    pub kind: Kind,
    pub part: i64,
    pub other: Option<i64>,
}

/// A request and its first response; a damaged one needs no answer.
#[derive(Clone, Debug)]
struct Call {
    request: Part,
    response: Option<i64>,
    missed: bool,
}

impl Call {
    /// Notes that there is no response once `now` has waited too long for it.
    fn judge(&mut self, now: i64, limits: &Limits, events: &mut Vec<Event>) {
        let Part { id, t_end, whole, .. } = self.request;
        let waits = whole && self.response.is_none() && !self.missed && t_end != NO_TIME;
        if waits && now != NO_TIME && now.saturating_sub(t_end) > limits.answer {
            self.missed = true;
            events.push(Event {
                kind: Kind::Missed,
                part: id,
                other: None,
            });
        }
    }
}

impl Call {
    /// What the request and the response are called.
    fn names(&mut self) -> impl Iterator<Item = &mut i64> {
        once(&mut self.request.id).chain(self.response.as_mut())
    }

    fn answer(&mut self, part: &Part, limits: &Limits, events: &mut Vec<Event>) {
        let request = self.request;
        let timed = part.t_end != NO_TIME && request.t_end != NO_TIME;
        let say = |kind, other: i64| Event {
            kind,
            part: part.id,
            other: Some(other),
        };
        if let Some(response) = self.response {
            events.push(say(Kind::Repeated, response));
        } else {
            self.judge(part.t_end, limits, events);
            self.response = Some(part.id);
            if timed && part.t_end.saturating_sub(request.t_end) > limits.slow {
                events.push(say(Kind::Slow, request.id));
            }
        }
        if part.priority != request.priority {
            events.push(say(Kind::OtherPriority, request.id));
        }
    }
}

/// The calls of one client and one server for one service: what waits, and calls by transfer ID.
///
/// `gone` are transfers of which nothing is to be said any more, `grown` says whether there are some without a slot.
#[derive(Clone, Debug, Default)]
struct Talk {
    waiting: VecDeque<Part>,
    calls: Vec<Call>,
    asked: bool,
    answered: bool,
    gone: Vec<i64>,
    grown: bool,
}

impl Talk {
    fn add(&mut self, part: Part) {
        let at = self.waiting.partition_point(|one| one.first <= part.first);
        self.waiting.insert(at, part);
        self.asked |= part.asks;
        self.answered |= !part.asks;
        self.grown = true;
    }

    /// Takes the next transfer in the order of the capture.
    fn next(&mut self, limits: &Limits, events: &mut Vec<Event>) {
        let Some(part) = self.waiting.pop_front() else { return };
        let id = part.transfer_id;
        let call = self.calls.iter_mut().find(|call| call.request.transfer_id == id);
        match call {
            Some(call) if part.asks => {
                call.judge(part.t, limits, events);
                self.gone.extend(call.names().map(|name| *name));
                *call = Call::from(part);
            }
            None if part.asks => self.calls.push(Call::from(part)),
            _ if !part.whole => self.gone.push(part.id),
            Some(call) if part.t.saturating_sub(call.request.t) <= limits.open => {
                self.gone.extend(call.response.is_some().then_some(part.id));
                call.answer(&part, limits, events);
            }
            _ => {
                self.gone.push(part.id);
                events.push(Event {
                    kind: Kind::Stray,
                    part: part.id,
                    other: None,
                });
            }
        }
    }

    /// Takes all that waits since before a time, and judges the calls that are open.
    fn release(&mut self, until: i64, limits: &Limits, events: &mut Vec<Event>) {
        while self.waiting.front().is_some_and(|part| part.t < until) {
            self.next(limits, events);
        }
        for call in &mut self.calls {
            call.judge(until, limits, events);
        }
        self.calls.retain_mut(|call| {
            let open = until.saturating_sub(call.request.t) <= limits.open;
            if !open {
                self.gone.extend(call.names().map(|name| *name));
            }
            open
        });
    }

    /// Takes all that waits, and what is still open at the end.
    fn settle(&mut self, end: i64, limits: &Limits, events: &mut Vec<Event>) {
        while !self.waiting.is_empty() {
            self.next(limits, events);
        }
        for call in &mut self.calls {
            call.judge(end, limits, events);
        }
    }

    /// What all transfers are called.
    fn names(&mut self) -> impl Iterator<Item = &mut i64> {
        let waiting = self.waiting.iter_mut().map(|part| &mut part.id);
        waiting.chain(self.calls.iter_mut().flat_map(Call::names))
    }
}

impl From<Part> for Call {
    fn from(request: Part) -> Self {
        Call {
            request,
            response: None,
            missed: false,
        }
    }
}

/// Follows the calls of all links: bus << 32 | service << 16 | client << 8 | server.
#[derive(Clone, Debug)]
pub struct Calls {
    limits: Limits,
    talks: HashMap<i64, Talk, Seeded>,
    order: BTreeMap<i64, i64>, // links as they were opened
    opened: i64,
    held: HashSet<i64, Seeded>,
    heard: HashSet<i64, Seeded>,
    now: i64,
    gone: Vec<i64>, // of links that are followed no more
    slots: i64,
    free: Vec<i64>,
}

/// Which new transfers may still be told and are called by a slot from now on, and which slots were left before.
#[derive(Debug, Default, PartialEq, Eq)]
pub struct Kept {
    pub new: Vec<i64>,
    pub slots: Vec<i64>,
    pub left: Vec<i64>,
}

impl Calls {
    pub fn new(limits: Limits) -> Self {
        Calls {
            limits,
            talks: HashMap::default(),
            order: BTreeMap::new(),
            opened: 0,
            held: HashSet::default(),
            heard: HashSet::default(),
            now: NO_TIME,
            gone: vec![],
            slots: 0,
            free: vec![],
        }
    }

    /// There are frames that look like responses of a link, whether or not one is out yet.
    pub fn hold(&mut self, link: i64) {
        if self.held.len() < self.limits.links {
            self.held.insert(link);
        }
    }

    /// A transfer of a node, bus << 7 | node, has come out.
    pub fn hear(&mut self, node: i64) {
        self.heard.insert(node);
    }

    /// The time that the capture has come to.
    pub fn go_on(&mut self, now: i64) {
        self.now = now;
    }

    /// Adds a transfer of a link; `end` is the last time so far.
    pub fn add(&mut self, link: i64, part: Part, end: i64, events: &mut Vec<Event>) {
        if !self.talks.contains_key(&link) {
            if self.talks.len() >= self.limits.links {
                if let Some((_, oldest)) = self.order.pop_first() {
                    if let Some(mut talk) = self.talks.remove(&oldest) {
                        talk.settle(end, &self.limits, events);
                        self.gone.append(&mut talk.gone);
                        self.gone.extend(talk.names().map(|name| *name));
                    }
                }
            }
            self.order.insert(self.opened, link);
            self.talks.insert(link, Talk::default());
            self.opened += 1;
        }
        self.release(link, events);
        if let Some(talk) = self.talks.get_mut(&link) {
            talk.add(part);
            if talk.waiting.len() > self.limits.waiting {
                talk.next(&self.limits, events);
            }
        }
    }

    /// Judges what has waited long enough.
    pub fn release_all(&mut self, events: &mut Vec<Event>) {
        for link in self.order.values().copied().collect::<Vec<_>>() {
            self.release(link, events);
        }
    }

    /// Judges everything, after the last transfer.
    pub fn settle_all(&mut self, end: i64, events: &mut Vec<Event>) {
        for link in self.order.values() {
            if let Some(talk) = self.talks.get_mut(link) {
                talk.settle(end, &self.limits, events);
            }
        }
    }

    /// Gives slots to the transfers that may still be told and have none: those that are called `begin` or more.
    pub fn keep(&mut self, begin: i64) -> Kept {
        let mut kept = Kept::default();
        for talk in self.talks.values_mut() {
            self.gone.append(&mut talk.gone);
        }
        kept.left.extend(self.gone.drain(..).filter(|&name| name < begin));
        self.free.extend(&kept.left);
        for link in self.order.values() {
            let Some(talk) = self.talks.get_mut(link).filter(|talk| talk.grown) else {
                continue;
            };
            for name in talk.names().filter(|name| **name >= begin) {
                let slot = self.free.pop().unwrap_or(self.slots);
                self.slots = self.slots.max(slot + 1);
                kept.new.push(*name - begin);
                kept.slots.push(slot);
                *name = slot;
            }
            talk.grown = false;
        }
        kept
    }

    /// A request waits for a sign of its server, and for a response that may have been sent, but is not out yet.
    fn release(&mut self, link: i64, events: &mut Vec<Event>) {
        let server = (link >> 32) * NODES + (link & (NODES - 1));
        let Some(talk) = self.talks.get_mut(&link) else { return };
        let silent = !talk.answered && (self.held.contains(&link) || !self.heard.contains(&server));
        if self.now != NO_TIME && talk.asked && !silent {
            talk.release(self.now.saturating_sub(self.limits.late), &self.limits, events);
        }
    }
}

#[cfg(test)]
mod tests;
