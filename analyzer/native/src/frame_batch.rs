//! A part of a capture, as its reader hands it over.
#![forbid(unsafe_code)]

use crate::buses::Buses;
use crate::counts::Counts;
use crate::events::{EventKind, Events};
use crate::frames::Frames;
use crate::stamp::Stamps;

/// Rows in the order of their records, and what became of each record.
#[derive(Clone, Debug, Default)]
pub struct FrameBatch {
    pub frames: Frames,
    pub events: Events,
    pub counts: Counts,
    pub stamps: Stamps,
    /// All names so far, by the index in the `bus` columns.
    pub buses: Buses,
}

impl FrameBatch {
    /// Rows that came out of batches before; `None` when their columns do not fit together.
    #[must_use]
    pub fn of(frames: Frames, events: Events, names: Vec<String>) -> Option<FrameBatch> {
        let known = |&bus: &u8| usize::from(bus) < names.len();
        let sound = frames.fits() && events.fits() && frames.bus.iter().all(known);
        let buses = events.bus.iter().zip(&events.bus_valid);
        if !sound || !buses.filter(|(_, &valid)| valid != 0).all(|(bus, _)| known(bus)) {
            return None;
        }
        let mut out = FrameBatch {
            frames,
            buses: Buses::of(names),
            ..FrameBatch::default()
        };
        out.counts.frames = out.frames.len() as u64;
        out.counts.lines = out.counts.frames;
        let from = FrameBatch {
            events,
            ..FrameBatch::default()
        };
        (0..from.events.len()).for_each(|row| out.count_event(&from, row));
        out.events = from.events;
        Some(out)
    }

    /// Appends the rows of the batch that follows, which numbers the same buses.
    pub fn append(&mut self, next: &FrameBatch) {
        self.frames.extend(&next.frames);
        self.events.extend(&next.events, 0..next.events.len());
        self.counts.add(&next.counts);
        self.stamps.insert(next.stamps);
        self.buses.clone_from(&next.buses);
    }

    /// Some rows of it, with counts of these alone. Row numbers that do not exist are left out.
    #[must_use]
    pub fn pick(&self, frames: &[u32], events: &[u32]) -> FrameBatch {
        let mut out = FrameBatch {
            stamps: self.stamps,
            buses: self.buses.clone(),
            ..FrameBatch::default()
        };
        for row in below(frames, self.frames.len()) {
            out.add_frame(
                self,
                row,
                self.frames.t[row],
                self.frames.bus[row],
                self.frames.line[row],
            );
        }
        for row in below(events, self.events.len()) {
            out.count_event(self, row);
            out.events.extend(&self.events, row..row + 1);
        }
        out
    }

    /// Appends a frame of `from` with another time, bus and record number.
    pub(crate) fn add_frame(&mut self, from: &FrameBatch, row: usize, t: i64, bus: u8, line: u32) {
        let frames = &from.frames;
        let line = u64::from(line);
        self.frames
            .push(t, bus, frames.id[row], frames.flags[row], line, frames.data_of(row));
        self.counts.lines += 1;
        self.counts.frames += 1;
    }

    /// Counts an event of `from` as one of its own.
    pub(crate) fn count_event(&mut self, from: &FrameBatch, row: usize) {
        let kind = from.events.kind[row];
        if kind == EventKind::FrameComment as u8 {
            return; // its record is counted as the frame's
        }
        let counts = &mut self.counts;
        let term = if kind == EventKind::ErrorFrame as u8 {
            &mut counts.error_frames
        } else if kind == EventKind::Drop as u8 {
            counts.dropped += u64::from(from.events.class[row]);
            &mut counts.drops
        } else if kind == EventKind::Comment as u8 {
            &mut counts.comments
        } else {
            &mut counts.unreadable
        };
        *term += 1;
        counts.lines += 1;
    }
}

fn below(rows: &[u32], len: usize) -> impl Iterator<Item = usize> + '_ {
    rows.iter().map(|&row| row as usize).filter(move |&row| row < len)
}
