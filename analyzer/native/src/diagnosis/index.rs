//! The frames of a batch by session, for those who ask for many.
#![forbid(unsafe_code)]

#[cfg(test)]
pub mod owned;

use std::collections::HashMap;
use std::fmt::Debug;
use std::ops::Range;
use std::sync::OnceLock;

use super::Part;
use crate::evidence::Frame;
use crate::seeded::Seeded;

/// Bits of an identifier that tell sessions apart: all but the priority.
pub const SESSION: u32 = 0xFF_FFFF;
/// Bits of `frames.flags`: a data frame of a session has the first alone.
const EXTENDED: u16 = 1;
const KINDS: u16 = 7;

/// Columns of a batch of frames.
#[derive(Clone, Copy, Debug)]
pub struct Columns<'a> {
    pub t: &'a [i64],
    pub bus: &'a [u8],
    pub id: &'a [u32],
    pub flags: &'a [u16],
    pub offsets: &'a [i32],
    pub data: &'a [u8],
}

/// What has them, and never changes.
pub trait Hold: Debug + Send + Sync {
    fn columns(&self) -> Columns<'_>;
}

/// All bytes of a frame, and its time.
#[derive(Clone, Copy, Debug)]
pub struct Whole<'a> {
    pub t: i64,
    pub bus: u8,
    pub id: u32,
    pub flags: u16,
    pub data: &'a [u8],
}

/// A batch of frames, and its rows in the order of sessions, once somebody asks.
#[derive(Debug)]
pub struct Index {
    first: u64,
    rows: usize,
    held: Box<dyn Hold>,
    sessions: OnceLock<Sessions>,
}

/// Rows in the order of sessions, and where each of these stands.
#[derive(Debug)]
struct Sessions {
    order: Vec<u32>,
    places: HashMap<u32, Range<u32>, Seeded>,
}

impl Index {
    /// Of a batch whose first frame has the number `first`; None if its columns do not fit together.
    pub fn new(first: u64, held: Box<dyn Hold>) -> Option<Self> {
        let columns = held.columns();
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
        Some(Index {
            first,
            rows,
            held,
            sessions: OnceLock::new(),
        })
    }

    /// The cells of a frame as a line of candump has them; None for one that is not there.
    pub fn frame<'a>(&'a self, number: u64, buses: &'a [String]) -> Option<Frame<'a>> {
        let row = usize::try_from(number.checked_sub(self.first)?).ok()?;
        let columns = self.held.columns();
        Some(Frame {
            t: *columns.t.get(row)?,
            bus: buses.get(usize::from(columns.bus[row]))?,
            id: columns.id[row],
            flags: columns.flags[row],
            data: &columns.data[columns.offsets[row] as usize..columns.offsets[row + 1] as usize],
        })
    }

    /// The numbers of its frames.
    pub fn range(&self) -> Range<u64> {
        self.first..self.first + self.rows as u64
    }

    /// Rows of a session, in order.
    fn rows(&self, key: u32) -> &[u32] {
        let sessions = self.sessions.get_or_init(|| Sessions::of(self.held.columns()));
        let place = sessions.places.get(&key);
        place.map_or(&[], |place| &sessions.order[place.start as usize..place.end as usize])
    }

    /// The data frames of a session from a number on.
    pub fn since(&self, key: u32, number: u64) -> impl Iterator<Item = Part<'_>> {
        let rows = self.between(key, &(number..u64::MAX)).iter().map(|&row| row as usize);
        let (columns, first) = (self.held.columns(), self.first);
        rows.filter(move |&row| columns.is_plain(row))
            .filter_map(move |row| columns.part(first, row))
    }

    /// Rows of a session with numbers in a range, whatever they are.
    pub fn between(&self, key: u32, range: &Range<u64>) -> &[u32] {
        let rows = self.rows(key);
        let begin = rows.partition_point(|&row| self.first + u64::from(row) < range.start);
        let end = rows.partition_point(|&row| self.first + u64::from(row) < range.end);
        &rows[begin..end.max(begin)]
    }

    /// Frames of a session with numbers in a range that have a tail byte, whatever they are.
    pub fn parts(&self, key: u32, range: &Range<u64>) -> impl DoubleEndedIterator<Item = Part<'_>> {
        let rows = self.between(key, range).iter();
        let (columns, first) = (self.held.columns(), self.first);
        rows.filter_map(move |&row| columns.part(first, row as usize))
    }

    fn key(&self, row: usize) -> u32 {
        let columns = self.held.columns();
        key(columns.bus[row], columns.id[row])
    }
}

impl<'a> Columns<'a> {
    fn whole(&self, row: usize) -> Whole<'a> {
        Whole {
            t: self.t[row],
            bus: self.bus[row],
            id: self.id[row],
            flags: self.flags[row],
            data: &self.data[self.offsets[row] as usize..self.offsets[row + 1] as usize],
        }
    }

    /// The frame in a row of a batch whose first one has the number `first`, None without a tail byte.
    fn part(&self, first: u64, row: usize) -> Option<Part<'a>> {
        let whole = self.whole(row);
        let (&tail, body) = whole.data.split_last()?;
        Some(Part {
            number: first + row as u64,
            tail,
            body,
            t: whole.t,
        })
    }

    fn is_plain(&self, row: usize) -> bool {
        self.flags[row] & KINDS == EXTENDED
    }
}

impl Sessions {
    fn of(columns: Columns<'_>) -> Self {
        let rows = columns.t.len();
        let mut groups: HashMap<u32, u32, Seeded> = HashMap::default();
        let mut counts: Vec<u32> = vec![];
        let mut group_of = Vec::with_capacity(rows);
        let mut last = (0, None);
        for row in 0..rows {
            let key = key(columns.bus[row], columns.id[row]);
            let group = match last {
                (same, Some(group)) if same == key => group,
                _ => *groups.entry(key).or_insert(counts.len() as u32),
            };
            last = (key, Some(group));
            if group as usize == counts.len() {
                counts.push(0);
            }
            counts[group as usize] += 1;
            group_of.push(group);
        }
        let mut begin = 0;
        let begins = counts.iter().map(|count| {
            begin += count;
            begin - count
        });
        let begins: Vec<u32> = begins.collect();
        let mut order = vec![0; rows];
        let mut ends = begins.clone();
        for (row, &group) in (0..).zip(&group_of) {
            let end = &mut ends[group as usize];
            order[*end as usize] = row;
            *end += 1;
        }
        let place = |(key, group)| (key, begins[group as usize]..ends[group as usize]);
        let places = groups.into_iter().map(place).collect();
        Sessions { order, places }
    }
}

/// What the frames of a session have in common.
pub fn key(bus: u8, id: u32) -> u32 {
    u32::from(bus) << 24 | id & SESSION
}

/// The batches of the recent past, in order.
#[derive(Clone, Copy, Debug)]
pub struct Frames<'a>(pub &'a [&'a Index]);

impl<'a> Frames<'a> {
    fn find(&self, number: u64) -> Option<(&'a Index, usize)> {
        let at = self.0.partition_point(|index| index.range().end <= number);
        let index = *self.0.get(at)?;
        let row = number.checked_sub(index.first)?;
        Some((index, row as usize))
    }

    /// A frame with a tail byte, and the key of its session.
    pub fn part(&self, number: u64) -> Option<Part<'a>> {
        self.find(number)
            .and_then(|(index, row)| index.held.columns().part(index.first, row))
    }

    /// A frame, whatever it is.
    pub fn whole(&self, number: u64) -> Option<Whole<'a>> {
        self.find(number).map(|(index, row)| index.held.columns().whole(row))
    }

    /// A frame as a line of candump has it; None for one that is not there.
    pub fn shown(&self, number: u64, buses: &'a [String]) -> Option<Frame<'a>> {
        self.find(number).and_then(|(index, _)| index.frame(number, buses))
    }

    /// Frames of a session among some, whatever they are, the last one first.
    pub fn latest(&self, key: u32, range: &'a Range<u64>) -> impl Iterator<Item = Whole<'a>> {
        let within = |index: &&&Index| index.range().start < range.end && range.start < index.range().end;
        let batches = self.0.iter().rev().filter(within);
        batches.flat_map(move |index| {
            let columns = index.held.columns();
            let rows = index.between(key, range).iter().rev();
            rows.map(move |&row| columns.whole(row as usize))
        })
    }

    /// The tail byte of the last frame of a session before one, among so many that came before it.
    pub fn tail_before(&self, key: u32, number: u64, look: u64) -> Option<u8> {
        let range = number.saturating_sub(look)..number;
        let mut tails = self.latest(key, &range).filter_map(|frame| frame.data.last().copied());
        tails.next()
    }

    pub fn session(&self, number: u64) -> Option<u32> {
        let (index, row) = self.find(number)?;
        Some(index.key(row))
    }

    /// Adds the data frames of a session among some frames to `found`: the first or the `last` of them, at most so many,
    /// those that are none counted, too.
    pub fn take(&self, key: u32, range: &Range<u64>, most: usize, last: bool, found: &mut Vec<Part<'a>>) {
        let known = found.len();
        let mut left = most;
        let within = |index: &&&Index| index.range().start < range.end && range.start < index.range().end;
        let mut add = |index: &'a Index| {
            let rows = index.between(key, range);
            let count = left.min(rows.len());
            left -= count;
            let some = if last {
                &rows[rows.len() - count..]
            } else {
                &rows[..count]
            };
            let columns = index.held.columns();
            let plain = some
                .iter()
                .map(|&row| row as usize)
                .filter(|&row| columns.is_plain(row));
            found.extend(plain.filter_map(|row| columns.part(index.first, row)));
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
