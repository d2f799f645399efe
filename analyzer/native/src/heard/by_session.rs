//! Frames of a bus, one session after the other.
#![forbid(unsafe_code)]

use std::ops::Range;

use crate::grouped::grouped;
use crate::session_code::of_bits;

const NODE: u32 = 0x7F;
/// Below the node: a type, or a service with whether it asks and whom, and behind it whether it is one.
const KEY_BITS: u32 = 17;
const KEY: u32 = (1 << KEY_BITS) - 1;

/// Frames of a bus by session: places among them, rows of the batch, tail bytes; codes of sessions, where each begins,
/// and where the last one ends.
#[derive(Debug, PartialEq, Eq)]
pub struct BySession {
    pub place: Vec<i64>,
    pub row: Vec<i64>,
    pub tail: Vec<u8>,
    pub first: Vec<i64>,
    pub codes: Vec<i64>,
}

/// The same, lent, of a batch: times of all its rows, and the number of its first frame.
#[derive(Clone, Copy, Debug)]
pub struct Sent<'a> {
    pub row: &'a [i64],
    pub tail: &'a [u8],
    pub place: &'a [i64],
    pub first: &'a [i64],
    pub codes: &'a [i64],
    pub t: &'a [i64],
    pub number: i64,
}

impl Sent<'_> {
    /// Whether all that is looked up is there.
    pub fn fits(&self) -> bool {
        let many = self.row.len();
        let within = |&row: &i64| usize::try_from(row).is_ok_and(|row| row < self.t.len());
        let rises = self.first.windows(2).all(|pair| pair[0] < pair[1]);
        let ends = self.first.first() == Some(&0) && self.first.last() == Some(&(many as i64));
        let whole = self.tail.len() == many && self.place.len() == many;
        whole && rises && ends && self.first.len() == self.codes.len() + 1 && self.row.iter().all(within)
    }

    /// Where the frames of a session are.
    pub fn places(&self, k: usize) -> Range<usize> {
        self.first[k] as usize..self.first[k + 1] as usize
    }

    /// When the bus heard a session first, as a place among its frames.
    pub fn heard(&self, k: usize) -> i64 {
        self.place[self.first[k] as usize]
    }
}

/// Puts frames of a bus in order by identifiers and tail bytes of a batch, of which they have some rows, or all.
///
/// None if there are no such rows.
pub fn by_session(bus: u8, id: &[u32], tail: &[u8], rows: Option<&[i64]>) -> Option<BySession> {
    let key = |id: u32| (id & NODE) << KEY_BITS | id >> 7 & KEY;
    let keys: Vec<u32> = match rows {
        None => id.iter().copied().map(key).collect(),
        Some(rows) => rows
            .iter()
            .map(|&row| Some(key(*id.get(row as usize)?)))
            .collect::<Option<_>>()?,
    };
    let (place, mut first) = grouped(&keys);
    let row = rows.map_or_else(
        || place.clone(),
        |rows| place.iter().map(|&at| rows[at as usize]).collect(),
    );
    let tail = row
        .iter()
        .map(|&row| tail.get(row as usize).copied())
        .collect::<Option<_>>()?;
    let session = |&at: &i64| {
        let key = i64::from(keys[place[at as usize] as usize]);
        of_bits(bus, (key >> KEY_BITS) as u8, key & i64::from(KEY))
    };
    let codes = first.iter().map(session).collect();
    first.push(keys.len() as i64);
    Some(BySession {
        place,
        row,
        tail,
        first,
        codes,
    })
}

#[cfg(test)]
mod tests {
    use super::by_session;

    #[test]
    fn sessions_follow_each_other_by_node_and_type() {
        let id = [0x1803_E90C, 0x1003_E80B, 0x1E01_8B8C, 0x0003_E90C];
        let found = by_session(2, &id, &[1, 2, 3, 4], None).unwrap();
        assert_eq!((found.place, found.first), (vec![1, 2, 0, 3], vec![0, 1, 2, 4]));
        assert_eq!((found.row, found.tail), (vec![1, 2, 0, 3], vec![2, 3, 1, 4]));
        let code = |node: i64, kind: i64| 2 << 24 | node << 17 | kind;
        assert_eq!(found.codes, [code(11, 0x3E8), code(12, 0x1_018B), code(12, 0x3E9)]);
    }

    #[test]
    fn some_rows_of_a_batch() {
        let found = by_session(0, &[0x1, 0x2, 0x1], &[7, 8, 9], Some(&[1, 2])).unwrap();
        assert_eq!((found.place, found.row), (vec![1, 0], vec![2, 1]));
        assert_eq!(found.tail, [9, 8]);
        assert!(by_session(0, &[1], &[1], Some(&[1])).is_none());
        assert!(by_session(0, &[1], &[], None).is_none());
    }
}
