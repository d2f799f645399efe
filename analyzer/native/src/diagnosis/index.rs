//! The frames of a batch by session, for those who ask for many.
#![forbid(unsafe_code)]

use std::collections::HashMap;
use std::ops::Range;

use super::Part;

/// Bits of an identifier that tell sessions apart: all but the priority.
pub const SESSION: u32 = 0xFF_FFFF;
/// Bits of `frames.flags`: a data frame of a session has the first alone.
const EXTENDED: u16 = 1;
const KINDS: u16 = 7;

/// Columns of a batch of frames; `first` is the number of the first one.
#[derive(Debug, Default)]
pub struct Columns {
    pub first: u64,
    pub t: Vec<i64>,
    pub bus: Vec<u8>,
    pub id: Vec<u32>,
    pub flags: Vec<u16>,
    pub offsets: Vec<i32>,
    pub data: Vec<u8>,
}

/// These, and their rows in the order of sessions.
#[derive(Debug)]
pub struct Index {
    columns: Columns,
    order: Vec<u32>,
    places: HashMap<u32, Range<u32>>,
}

impl Index {
    /// None if the columns do not fit together.
    pub fn new(columns: Columns) -> Option<Self> {
        let rows = columns.t.len();
        let same = [columns.bus.len(), columns.id.len(), columns.flags.len()] == [rows; 3];
        let whole = columns.offsets.len() == rows + 1
            && columns.offsets.first().is_some_and(|&at| at >= 0)
            && columns.offsets.is_sorted()
            && columns
                .offsets
                .last()
                .is_some_and(|&end| end as usize <= columns.data.len());
        if !same || !whole || u32::try_from(rows).is_err() {
            return None;
        }
        let mut places: HashMap<u32, Range<u32>> = HashMap::new();
        let key = |row: usize| key(columns.bus[row], columns.id[row]);
        for row in 0..rows {
            places.entry(key(row)).or_insert(0..0).end += 1;
        }
        let mut begin = 0;
        for place in places.values_mut() {
            let count = place.end;
            *place = begin..begin;
            begin += count;
        }
        let mut order = vec![0; rows];
        for row in 0..rows {
            if let Some(place) = places.get_mut(&key(row)) {
                order[place.end as usize] = row as u32;
                place.end += 1;
            }
        }
        Some(Index { columns, order, places })
    }

    fn range(&self) -> Range<u64> {
        self.columns.first..self.columns.first + self.columns.t.len() as u64
    }

    /// Rows of a session, in order.
    fn rows(&self, key: u32) -> &[u32] {
        self.places
            .get(&key)
            .map_or(&[], |place| &self.order[place.start as usize..place.end as usize])
    }

    /// The frame in a row, None without a tail byte.
    fn part(&self, row: usize) -> Option<Part<'_>> {
        let columns = &self.columns;
        let data = &columns.data[columns.offsets[row] as usize..columns.offsets[row + 1] as usize];
        let (&tail, body) = data.split_last()?;
        Some(Part {
            number: columns.first + row as u64,
            tail,
            body,
            t: columns.t[row],
        })
    }

    fn is_plain(&self, row: usize) -> bool {
        self.columns.flags[row] & KINDS == EXTENDED
    }
}

fn key(bus: u8, id: u32) -> u32 {
    u32::from(bus) << 24 | id & SESSION
}

/// The batches of the recent past, in order.
#[derive(Clone, Copy, Debug)]
pub struct Frames<'a>(pub &'a [&'a Index]);

impl<'a> Frames<'a> {
    fn find(&self, number: u64) -> Option<(&'a Index, usize)> {
        let at = self.0.partition_point(|index| index.range().end <= number);
        let index = *self.0.get(at)?;
        let row = number.checked_sub(index.columns.first)?;
        Some((index, row as usize))
    }

    /// A frame with a tail byte, and the key of its session.
    pub fn part(&self, number: u64) -> Option<Part<'a>> {
        self.find(number).and_then(|(index, row)| index.part(row))
    }

    pub fn session(&self, number: u64) -> Option<u32> {
        let (index, row) = self.find(number)?;
        Some(key(index.columns.bus[row], index.columns.id[row]))
    }

    /// Adds the data frames of a session among some frames to `found`: the first or the `last` of them, at most so many,
    /// those that are none counted, too.
    pub fn take(&self, key: u32, range: &Range<u64>, most: usize, last: bool, found: &mut Vec<Part<'a>>) {
        let known = found.len();
        let mut left = most;
        let within = |index: &&&Index| index.range().start < range.end && range.start < index.range().end;
        let mut add = |index: &'a Index| {
            let rows = index.rows(key);
            let begin = rows.partition_point(|&row| index.columns.first + u64::from(row) < range.start);
            let end = rows.partition_point(|&row| index.columns.first + u64::from(row) < range.end);
            let count = left.min(end - begin);
            left -= count;
            let some = if last {
                &rows[end - count..end]
            } else {
                &rows[begin..begin + count]
            };
            let plain = some.iter().map(|&row| row as usize).filter(|&row| index.is_plain(row));
            found.extend(plain.filter_map(|row| index.part(row)));
            left > 0
        };
        let batches = self.0.iter().filter(within);
        if last {
            // The latest batch first: put in order at the end.
            let _ = batches.rev().all(|index| add(index));
            found[known..].sort_by_key(|part| part.number);
        } else {
            let _ = batches.into_iter().all(|index| add(index));
        }
    }
}
