//! The starts of transfers in a session, finished or not: those whose transfer ID is not that of the one before plus 1.
#![forbid(unsafe_code)]

use std::collections::VecDeque;

use super::index::Index;
use super::{Part, END, ID};

/// A start whose ID does not follow that of the one before, which came at `since`.
///
/// `again` says that it may only begin that one again, which did not end.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct OddStart {
    pub number: u64,
    pub t: i64,
    pub before: u8,
    pub id: u8,
    pub since: i64,
    pub again: bool,
}

/// The last start of a session: its ID, its time, the bytes of its frame, and whether its transfer has ended.
#[derive(Clone, Debug, Default)]
pub struct Latest {
    pub id: u8,
    pub t: i64,
    pub tail: u8,
    pub body: Vec<u8>,
    pub ended: bool,
}

/// Follows one session from a frame on.
#[derive(Clone, Debug)]
pub struct Starts {
    /// Of the bus and the identifier, as an index has it.
    key: u32,
    next: u64,
    latest: Latest,
    waiting: VecDeque<OddStart>,
}

impl Starts {
    pub fn new(key: u32, next: u64, latest: Latest) -> Self {
        Starts {
            key,
            next,
            latest,
            waiting: VecDeque::new(),
        }
    }

    /// The first frame that was not read yet.
    pub fn next(&self) -> u64 {
        self.next
    }

    /// Reads what is new in a batch.
    pub fn read(&mut self, index: &Index) {
        for part in index.since(self.key, self.next) {
            self.take(&part);
        }
        self.next = self.next.max(index.range().end);
    }

    fn take(&mut self, part: &Part<'_>) {
        let latest = &mut self.latest;
        if part.start() {
            let id = part.id();
            let same = id == latest.id;
            let copy = same && part.tail == latest.tail && part.body == latest.body;
            if id != (latest.id + 1) & ID && !copy {
                self.waiting.push_back(OddStart {
                    number: part.number,
                    t: part.t,
                    before: latest.id,
                    id,
                    since: latest.t,
                    again: same && !latest.ended,
                });
            }
            (latest.id, latest.t, latest.tail, latest.ended) = (id, part.t, part.tail, false);
            latest.body.clear();
            latest.body.extend_from_slice(part.body);
        }
        latest.ended |= part.tail & (END | ID) == END | latest.id;
    }

    /// The next odd start up to a frame.
    pub fn pop(&mut self, number: u64) -> Option<OddStart> {
        self.waiting.pop_front_if(|one| one.number <= number)
    }
}

#[cfg(test)]
mod tests {
    use super::super::index::owned::Owned;
    use super::*;

    const SESSION: u32 = 0x1F_0155;

    fn index(first: u64, tails: &[u8]) -> Index {
        let rows = tails.len();
        let columns = Owned {
            t: (0..rows as i64).collect(),
            bus: vec![0; rows],
            id: vec![SESSION; rows],
            flags: vec![1; rows],
            offsets: (0..=rows as i32).collect(),
            data: tails.to_vec(),
        };
        Index::new(first, Box::new(columns)).unwrap()
    }

    fn odd(parts: &[&[u8]]) -> Vec<(u64, u8, u8, bool)> {
        let latest = Latest {
            tail: 0xC0,
            ended: true,
            ..Latest::default()
        };
        let mut starts = Starts::new(SESSION, 0, latest);
        let mut first = 0;
        for tails in parts {
            starts.read(&index(first, tails));
            first += tails.len() as u64;
        }
        let next = || starts.pop(u64::MAX);
        std::iter::from_fn(next)
            .map(|one| (one.number, one.before, one.id, one.again))
            .collect()
    }

    #[test]
    fn counts_are_odd_that_are_no_step_of_one() {
        let tails = [0xC1, 0x82, 0x22, 0x42, 0xC3, 0xC7, 0xC8];
        assert_eq!(odd(&[&tails]), [(5, 3, 7, false)]);
        for cut in 1..tails.len() {
            assert_eq!(odd(&[&tails[..cut], &tails[cut..]]), [(5, 3, 7, false)]);
        }
    }

    #[test]
    fn a_copy_is_none_and_what_did_not_end_may_begin_again() {
        assert_eq!(odd(&[&[0xC1, 0xC1, 0xC2]]), []);
        assert_eq!(odd(&[&[0x81, 0xC1, 0xC2]]), [(1, 1, 1, true)]);
        assert_eq!(odd(&[&[0x81, 0x61, 0xA1, 0xC2]]), [(2, 1, 1, false)]);
    }

    #[test]
    fn only_what_was_asked_for_is_told() {
        let latest = Latest {
            id: 0,
            t: 0,
            tail: 0,
            body: vec![],
            ended: true,
        };
        let mut starts = Starts::new(SESSION, 1, latest);
        starts.read(&index(0, &[0xC9, 0xC3, 0xC5]));
        assert_eq!(starts.next(), 3);
        assert_eq!(starts.pop(0), None);
        assert_eq!(starts.pop(1).map(|one| one.id), Some(3));
        assert_eq!(starts.pop(1), None);
    }
}
