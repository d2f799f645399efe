//! Rests of transfers whose start is missing: which orphans of a session belong together.
#![forbid(unsafe_code)]

use std::collections::{BTreeMap, HashMap};

use crate::seeded::Seeded;
use crate::wire::Tail;

/// What is kept: open ones at most, frames of one that are named, and in which time the next frame comes.
#[derive(Clone, Copy, Debug)]
pub struct Limits {
    pub open: usize,
    pub named: usize,
    pub timeout: i64,
}

/// A frame: its session, its time, its tail byte, and the bytes before that.
#[derive(Clone, Copy, Debug)]
pub struct Frame {
    pub session: i64,
    pub t: i64,
    pub tail: u8,
    pub size: i64,
}

/// One that may get more frames. `slots` are those of its frames that are named.
#[derive(Clone, Debug)]
struct Open {
    serial: i64,
    transfer_id: u8,
    latest: i64,
    received: i64,
    slots: Vec<i64>,
}

/// One that gets no more frames: how many bytes it had, and where those stand that are named.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Closed {
    pub received: i64,
    pub slots: Vec<i64>,
}

/// Slots of frames, somewhere else: those that are free, those that are once they have been read, how many there are.
#[derive(Clone, Debug, Default)]
struct Slots {
    free: Vec<i64>,
    read: Vec<i64>,
    count: i64,
}

impl Slots {
    fn take(&mut self) -> i64 {
        self.free.pop().unwrap_or_else(|| {
            self.count += 1;
            self.count - 1
        })
    }
}

/// Puts orphans together: those of a session with one transfer ID, up to the end bit or a timeout.
#[derive(Clone, Debug)]
pub struct Remainders {
    limits: Limits,
    open: HashMap<i64, Open, Seeded>,
    order: BTreeMap<i64, i64>, // sessions by serial numbers
    next: i64,
    slots: Slots,
}

impl Remainders {
    pub fn new(limits: Limits) -> Self {
        Remainders {
            limits,
            open: HashMap::default(),
            order: BTreeMap::new(),
            next: 0,
            slots: Slots::default(),
        }
    }

    /// Forgets where those stand that were closed, which have been read: others may stand there now.
    pub fn forget(&mut self) {
        self.slots.free.append(&mut self.slots.read);
    }

    /// Adds a frame: its slot, None if its remainder has too many to name; what is closed is added to `closed`.
    pub fn add(&mut self, frame: Frame, closed: &mut Vec<Closed>) -> Option<i64> {
        let Frame { session, t, tail, size } = frame;
        let transfer_id = Tail(tail).transfer_id();
        let over = |one: &Open| one.transfer_id != transfer_id || t.saturating_sub(one.latest) > self.limits.timeout;
        if self.open.get(&session).is_some_and(over) {
            self.close(session, closed);
        }
        if !self.open.contains_key(&session) {
            self.begin(session, transfer_id, closed);
        }
        let one = self.open.get_mut(&session)?;
        one.latest = t;
        one.received += size;
        let slot = (one.slots.len() < self.limits.named).then(|| self.slots.take());
        one.slots.extend(slot);
        if Tail(tail).end() {
            self.close(session, closed);
        }
        slot
    }

    /// Closes all that are open, the oldest first.
    pub fn close_all(&mut self, closed: &mut Vec<Closed>) {
        while let Some((_, session)) = self.order.pop_first() {
            self.close(session, closed);
        }
    }

    fn begin(&mut self, session: i64, transfer_id: u8, closed: &mut Vec<Closed>) {
        if self.open.len() >= self.limits.open {
            if let Some((_, oldest)) = self.order.pop_first() {
                self.close(oldest, closed);
            }
        }
        let serial = self.next;
        self.next += 1;
        self.order.insert(serial, session);
        let one = Open {
            serial,
            transfer_id,
            latest: 0,
            received: 0,
            slots: vec![],
        };
        self.open.insert(session, one);
    }

    fn close(&mut self, session: i64, closed: &mut Vec<Closed>) {
        if let Some(one) = self.open.remove(&session) {
            self.order.remove(&one.serial);
            self.slots.read.extend(&one.slots);
            closed.push(Closed {
                received: one.received,
                slots: one.slots,
            });
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Slots and bytes of one that was closed.
    type Ended = (Vec<i64>, i64);

    /// The slots of frames, and what was closed in turn.
    fn put(rests: &mut Remainders, frames: &[(i64, i64, u8)]) -> (Vec<Option<i64>>, Vec<Ended>) {
        let mut closed = vec![];
        let frame = |&(session, t, tail)| Frame {
            session,
            t,
            tail,
            size: 7,
        };
        let slots = frames.iter().map(|one| rests.add(frame(one), &mut closed)).collect();
        (slots, closed.into_iter().map(|one| (one.slots, one.received)).collect())
    }

    fn rests() -> Remainders {
        Remainders::new(Limits {
            open: 2,
            named: 2,
            timeout: 10,
        })
    }

    #[test]
    fn an_end_another_id_and_a_timeout_close() {
        let mut rests = rests();
        let (slots, closed) = put(
            &mut rests,
            &[(1, 0, 3), (1, 9, 0x43), (1, 9, 3), (1, 10, 4), (1, 21, 4)],
        );
        assert_eq!(slots, [0, 1, 2, 3, 4].map(Some));
        assert_eq!(closed, [(vec![0, 1], 14), (vec![2], 7), (vec![3], 7)]);
    }

    #[test]
    fn frames_beyond_those_that_are_named_count() {
        let mut rests = rests();
        let (slots, _) = put(&mut rests, &[(1, 0, 3); 3]);
        assert_eq!(slots, [Some(0), Some(1), None]);
        let mut closed = vec![];
        rests.close_all(&mut closed);
        let (received, slots) = (21, vec![0, 1]);
        assert_eq!(closed, [Closed { received, slots }]);
    }

    #[test]
    fn a_slot_is_free_once_it_was_read() {
        let mut rests = rests();
        put(&mut rests, &[(1, 0, 3), (2, 0, 4), (1, 0, 0x43)]);
        assert_eq!(put(&mut rests, &[(3, 0, 5)]).0, [Some(3)]);
        rests.forget();
        let (slots, closed) = put(&mut rests, &[(2, 0, 4), (2, 0, 0x44), (4, 0, 0x41)]);
        assert_eq!(slots, [Some(2), None, Some(0)]);
        assert_eq!(closed, [(vec![1, 2], 21), (vec![0], 7)]);
        rests.forget();
        assert_eq!(put(&mut rests, &[(4, 0, 1), (5, 0, 1)]).0, [Some(0), Some(2)]);
    }

    #[test]
    fn the_oldest_makes_room() {
        let mut rests = rests();
        let (_, closed) = put(&mut rests, &[(1, 0, 3), (2, 0, 3), (1, 0, 3), (3, 0, 3), (1, 0, 3)]);
        assert_eq!(
            closed,
            [(vec![0, 2], 14), (vec![1], 7)],
            "a frame more makes none younger"
        );
        let mut all = vec![];
        rests.close_all(&mut all);
        assert_eq!(all.iter().map(|one| one.slots[0]).collect::<Vec<_>>(), [3, 4]);
        assert!(rests.open.is_empty() && rests.order.is_empty());
    }

    #[test]
    fn frames_without_a_time_are_no_timeout_apart() {
        let (_, closed) = put(
            &mut rests(),
            &[(1, i64::MIN, 3), (1, i64::MIN, 3), (1, i64::MAX, 3), (1, i64::MIN, 3)],
        );
        assert_eq!(closed, [(vec![0, 1], 14)]);
    }
}
