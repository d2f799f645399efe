//! Rests of transfers whose start is missing: which orphans of a session belong together.
#![forbid(unsafe_code)]

use std::collections::{BTreeMap, HashMap};

const END: u8 = 0x40;
const ID: u8 = 0x1F;

/// What is kept: open ones at most, frames of one that are named, and in which time the next frame comes.
#[derive(Clone, Copy, Debug)]
pub struct Limits {
    pub open: usize,
    pub named: u32,
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

/// One that may get more frames.
#[derive(Clone, Copy, Debug)]
struct Open {
    serial: i64,
    transfer_id: u8,
    latest: i64,
    received: i64,
    frames: u32,
}

/// One that gets no more frames, and how many bytes it had.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Closed {
    pub serial: i64,
    pub received: i64,
}

/// Those that are closed, as they are: their bytes, and the places of their frames that are named. `left` are the places
/// of frames of those that stay open.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Made {
    pub received: Vec<i64>,
    pub lists: Vec<Vec<i64>>,
    pub left: Vec<i64>,
}

/// Puts orphans together: those of a session with one transfer ID, up to the end bit or a timeout.
#[derive(Clone, Debug)]
pub struct Remainders {
    limits: Limits,
    open: HashMap<i64, Open>,
    order: BTreeMap<i64, i64>, // sessions by serial numbers
    next: i64,
}

impl Remainders {
    pub fn new(limits: Limits) -> Self {
        Remainders {
            limits,
            open: HashMap::new(),
            order: BTreeMap::new(),
            next: 0,
        }
    }

    /// Adds a frame: the serial number of its remainder, None if that has too many to name; what is closed is added to
    /// `closed`.
    pub fn add(&mut self, frame: Frame, closed: &mut Vec<Closed>) -> Option<i64> {
        let Frame { session, t, tail, size } = frame;
        let transfer_id = tail & ID;
        let over = |one: &Open| one.transfer_id != transfer_id || t.saturating_sub(one.latest) > self.limits.timeout;
        if self.open.get(&session).is_some_and(over) {
            self.close(session, closed);
        }
        let named = if let Some(one) = self.open.get_mut(&session) {
            one.latest = t;
            one.received += size;
            let named = one.frames < self.limits.named;
            one.frames += u32::from(named);
            named.then_some(one.serial)
        } else {
            Some(self.begin(frame, closed))
        };
        if tail & END != 0 {
            self.close(session, closed);
        }
        named
    }

    /// Adds frames behind those of remainders that are open, of which `of` gives the serial number each: which frames
    /// make up those that are closed now, counted from the first one that is open. No more will come behind the `last`.
    pub fn put(&mut self, of: &mut Vec<i64>, frames: impl Iterator<Item = Frame>, last: bool) -> Made {
        let mut closed = vec![];
        let new = frames.map(|frame| self.add(frame, &mut closed).unwrap_or(-1));
        of.extend(new);
        if last {
            self.close_all(&mut closed);
        }
        let ranks: HashMap<i64, usize> = closed.iter().map(|one| one.serial).zip(0..).collect();
        let mut lists = vec![vec![]; closed.len()];
        let (mut left, mut left_of) = (vec![], vec![]);
        for (place, &serial) in (0..).zip(&*of) {
            match ranks.get(&serial) {
                Some(&rank) => lists[rank].push(place),
                None if serial >= 0 => {
                    left.push(place);
                    left_of.push(serial);
                }
                None => {}
            }
        }
        *of = left_of;
        Made {
            received: closed.iter().map(|one| one.received).collect(),
            lists,
            left,
        }
    }

    /// Closes all that are open, the oldest first.
    pub fn close_all(&mut self, closed: &mut Vec<Closed>) {
        while let Some((_, session)) = self.order.pop_first() {
            self.close(session, closed);
        }
    }

    fn begin(&mut self, frame: Frame, closed: &mut Vec<Closed>) -> i64 {
        if self.open.len() >= self.limits.open {
            if let Some((_, oldest)) = self.order.pop_first() {
                self.close(oldest, closed);
            }
        }
        let serial = self.next;
        self.next += 1;
        self.order.insert(serial, frame.session);
        let one = Open {
            serial,
            transfer_id: frame.tail & ID,
            latest: frame.t,
            received: frame.size,
            frames: 1,
        };
        self.open.insert(frame.session, one);
        serial
    }

    fn close(&mut self, session: i64, closed: &mut Vec<Closed>) {
        if let Some(Open { serial, received, .. }) = self.open.remove(&session) {
            self.order.remove(&serial);
            closed.push(Closed { serial, received });
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// What became of frames: the serial number of each, and what was closed in turn.
    fn put(rests: &mut Remainders, frames: &[(i64, i64, u8)]) -> (Vec<Option<i64>>, Vec<(i64, i64)>) {
        let mut closed = vec![];
        let frame = |&(session, t, tail)| Frame {
            session,
            t,
            tail,
            size: 7,
        };
        let serials = frames.iter().map(|one| rests.add(frame(one), &mut closed)).collect();
        (serials, closed.iter().map(|one| (one.serial, one.received)).collect())
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
        let (serials, closed) = put(
            &mut rests,
            &[(1, 0, 3), (1, 9, 0x43), (1, 9, 3), (1, 10, 4), (1, 21, 4)],
        );
        assert_eq!(serials, [Some(0), Some(0), Some(1), Some(2), Some(3)]);
        assert_eq!(closed, [(0, 14), (1, 7), (2, 7)]);
    }

    #[test]
    fn frames_beyond_those_that_are_named_count() {
        let mut rests = rests();
        let (serials, _) = put(&mut rests, &[(1, 0, 3); 3]);
        assert_eq!(serials, [Some(0), Some(0), None]);
        let mut closed = vec![];
        rests.close_all(&mut closed);
        assert_eq!(
            closed,
            [Closed {
                serial: 0,
                received: 21
            }]
        );
    }

    #[test]
    fn the_oldest_makes_room() {
        let mut rests = rests();
        let (_, closed) = put(&mut rests, &[(1, 0, 3), (2, 0, 3), (1, 0, 3), (3, 0, 3), (1, 0, 3)]);
        assert_eq!(closed, [(0, 14), (1, 7)], "a frame more makes none younger");
        let mut all = vec![];
        rests.close_all(&mut all);
        assert_eq!(all.iter().map(|one| one.serial).collect::<Vec<_>>(), [2, 3]);
        assert!(rests.open.is_empty() && rests.order.is_empty());
    }

    #[test]
    fn frames_go_where_their_remainder_ends() {
        let frame = |(session, tail)| Frame {
            session,
            t: 0,
            tail,
            size: 7,
        };
        let (mut rests, mut of) = (rests(), vec![]);
        let first = rests.put(&mut of, [(1, 3), (2, 4), (1, 3), (1, 3)].map(frame).into_iter(), false);
        let left = vec![0, 1, 2];
        assert_eq!(first, Made { left, ..Made::default() }, "no more than two are named");
        let second = rests.put(&mut of, [(3, 0x45), (2, 0x44), (4, 6)].map(frame).into_iter(), false);
        let lists = vec![vec![0, 2], vec![3], vec![1, 4]];
        assert_eq!((second.lists, second.left), (lists, vec![5]));
        assert_eq!(second.received, [21, 7, 14]);
        let last = rests.put(&mut of, std::iter::empty(), true);
        assert_eq!((last.lists, last.left), (vec![vec![0]], vec![]));
        assert!(of.is_empty());
    }

    #[test]
    fn frames_without_a_time_are_no_timeout_apart() {
        let (serials, _) = put(
            &mut rests(),
            &[(1, i64::MIN, 3), (1, i64::MIN, 3), (1, i64::MAX, 3), (1, i64::MIN, 3)],
        );
        assert_eq!(serials, [Some(0), Some(0), Some(1), Some(1)]);
    }
}
