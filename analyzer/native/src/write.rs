//! Rows back to the bytes of a capture, frames and events in the order of their records.
//!
//! What a format cannot hold is counted, in words ([`Account`]), and never passed over in silence.
#![forbid(unsafe_code)]

pub mod candump;
pub mod mcap;
pub mod pcapng;
pub mod recorded;
pub mod records;

use std::collections::HashMap;

use crate::events::{EventKind, Events};
use crate::frame_batch::FrameBatch;
use crate::frames::{EXTENDED, FD, MAX_STANDARD, NO_TIME, REMOTE};

/// A format that is written row by row.
pub trait Writer: Send + Sync {
    /// Appends what stands before all rows.
    fn start(&self, _out: &mut Vec<u8>) {}
    /// Looks at a batch before its rows are written; returns the bytes of a row without its data, about.
    fn look_ahead(&mut self, batch: &FrameBatch) -> usize;
    /// Appends a frame.
    fn frame(&mut self, batch: &FrameBatch, row: usize, out: &mut Vec<u8>);
    /// Appends an event.
    fn event(&mut self, batch: &FrameBatch, row: usize, out: &mut Vec<u8>);
    /// Takes what somebody has said of the frame that is written next.
    fn comment(&mut self, text: &str);
    /// Appends the rows of a batch, with `comments` on its frames by row.
    fn write(&mut self, batch: &FrameBatch, comments: &HashMap<usize, String>, out: &mut Vec<u8>) {
        out.reserve(self.look_ahead(batch) * batch.frames.len() + batch.frames.data.len());
        for row in InOrder::new(batch) {
            match row {
                Row::Frame(row) => {
                    if let Some(text) = comments.get(&row) {
                        self.comment(text);
                    }
                    self.frame(batch, row, out);
                }
                Row::Event(row) => self.event(batch, row, out),
            }
        }
    }
    /// What was written so far, and what could not be.
    fn account(&self) -> &Account;
}

/// What a format may be unable to hold. Unreadable records are nobody's to write.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(usize)]
pub enum Loss {
    LongFrame,
    LongError,
    EarlyTime,
    RawCode,
    DropBus,
    Name,
    WideId,
    FdRemote,
    Comment,
}

const WORDS: [&str; 9] = [
    "classic frames of more than 8 bytes",
    "error frames of more than 8 bytes",
    "times before 1970",
    "raw length codes",
    "interfaces of drop counts",
    "interface names, changed to fit",
    "11-bit identifiers that need more bits, written as 29-bit ones",
    "remote frames of CAN FD, written as data frames",
    "comments on frames",
];

/// How many frames are written, and how often which loss occurred.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Account {
    pub frames: u64,
    lost: [u64; WORDS.len()],
}

impl Account {
    pub fn add(&mut self, what: Loss) {
        self.lost[what as usize] += 1;
    }

    /// Whether a frame is written with a 29-bit identifier. No bus carries what is counted here, some formats hold it.
    fn takes(&mut self, id: u32, flags: u16) -> bool {
        let wide = flags & EXTENDED == 0 && id > MAX_STANDARD;
        if wide {
            self.add(Loss::WideId);
        }
        if flags & (FD | REMOTE) == FD | REMOTE {
            self.add(Loss::FdRemote);
        }
        wide || flags & EXTENDED != 0
    }

    /// Words and counts of what was lost at all.
    pub fn lost(&self) -> impl Iterator<Item = (&'static str, u64)> + '_ {
        WORDS.into_iter().zip(self.lost).filter(|(_, count)| *count > 0)
    }
}

/// Stamps for formats in which every record has one, and none is before 1970. A record whose time is missing or earlier
/// is marked as one without, and gets the stamp of the one before it: other programs see a file that begins and ends when
/// its capture did.
#[derive(Default)]
struct Stamper {
    last: Option<u64>,
}

impl Stamper {
    /// Whether the stamp of a row is its time.
    fn holds(t: i64) -> bool {
        t >= 0
    }

    /// In front of the first time that one is used, if the batch has any.
    fn look_ahead(&mut self, batch: &FrameBatch) {
        if self.last.is_none() {
            let mut times = batch.frames.t.iter().chain(&batch.events.t);
            self.last = times.find_map(|&t| u64::try_from(t).ok());
        }
    }

    /// The last time so far, for a count that has none; [`NO_TIME`] if there was none at all.
    fn last(&self) -> i64 {
        self.last.map_or(NO_TIME, |stamp| stamp as i64)
    }

    fn stamp(&mut self, t: i64, account: &mut Account) -> u64 {
        if let Ok(stamp) = u64::try_from(t) {
            self.last = Some(stamp);
            return stamp;
        }
        if t != NO_TIME {
            account.add(Loss::EarlyTime);
        }
        self.last.unwrap_or(0)
    }
}

/// A row number in one of the two tables of a batch.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Row {
    Frame(usize),
    Event(usize),
}

/// Walks the rows of a batch in the order of their records.
pub struct InOrder<'a> {
    batch: &'a FrameBatch,
    frame: usize,
    event: usize,
}

impl<'a> InOrder<'a> {
    pub fn new(batch: &'a FrameBatch) -> Self {
        InOrder {
            batch,
            frame: 0,
            event: 0,
        }
    }
}

impl Iterator for InOrder<'_> {
    type Item = Row;

    fn next(&mut self) -> Option<Row> {
        let frame = self.batch.frames.line.get(self.frame);
        let event_first = match (self.batch.events.line.get(self.event), frame) {
            (None, None) => return None,
            (None, Some(_)) => false,
            (Some(_), None) => true,
            (Some(event), Some(frame)) => event <= frame, // a comment on a frame stands in front of it
        };
        let row = if event_first {
            self.event += 1;
            Row::Event(self.event - 1)
        } else {
            self.frame += 1;
            Row::Frame(self.frame - 1)
        };
        Some(row)
    }
}

/// The name by the index in a `bus` column.
fn name(batch: &FrameBatch, bus: u8) -> &str {
    batch.buses.names().get(usize::from(bus)).map_or("", String::as_str)
}

/// The interface of an event, if it has one.
fn bus_of(events: &Events, row: usize) -> Option<u8> {
    (events.bus_valid[row] != 0).then_some(events.bus[row])
}

/// What an event is; a gap reads as a comment.
fn kind_of(events: &Events, row: usize) -> EventKind {
    [
        EventKind::ErrorFrame,
        EventKind::Drop,
        EventKind::Unreadable,
        EventKind::FrameComment,
    ]
    .into_iter()
    .find(|kind| *kind as u8 == events.kind[row])
    .unwrap_or(EventKind::Comment)
}
