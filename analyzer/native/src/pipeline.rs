//! Candump text or the rows of any reader in, tables out: reading and reassembly behind one door, without any I/O.
#![forbid(unsafe_code)]

use crate::candump::Candump;
use crate::counts::Counts;
use crate::events::{Event, EventKind, Events};
use crate::frame_batch::FrameBatch;
use crate::frames::{Frames, NO_TIME};
use crate::reassembly::{Reassembler, Resolve, Results};
use crate::stamp::Stamps;

/// All interfaces silent for longer than this is a gap in the capture.
const GAP_NS: i64 = 1_000_000_000;
/// A sum of time differences, added by `or`, that is below this has no part above it, and none that is negative.
const NO_GAP: u64 = 1 << 29;
/// Text is worked through in parts that stay in the cache between the two passes.
const TEXT: usize = 128 << 10;

/// What a capture is fed in: all of it in one form.
#[derive(Clone, Copy, Debug)]
pub enum Input<'a> {
    /// Candump text; a line that is not finished waits for more.
    Text(&'a [u8]),
    /// Rows of a reader, records in ascending order, the same buses in each batch.
    Rows(&'a FrameBatch),
}

/// One slice of every table.
#[derive(Debug, Default)]
pub struct Batch {
    pub frames: Frames,
    pub events: Events,
    pub results: Results,
}

pub struct Pipeline {
    pub reassembler: Reassembler,
    candump: Candump,
    /// The frames since the last [`Pipeline::take`], the events of this moment, and what holds for all of the capture.
    read: FrameBatch,
    /// The events since then, gaps among them.
    events: Events,
    latest: i64,
}

impl Pipeline {
    pub fn new(resolve: Resolve) -> Self {
        Pipeline {
            reassembler: Reassembler::new(resolve),
            candump: Candump::new(),
            read: FrameBatch::default(),
            events: Events::default(),
            latest: NO_TIME,
        }
    }

    /// Rows waiting to be taken: frames and events.
    pub fn waiting(&self) -> usize {
        self.read.frames.len() + self.events.len()
    }

    /// Takes what comes next, whatever it is.
    pub fn feed(&mut self, input: Input<'_>) {
        match input {
            // Straight into the columns, which a batch in between would copy.
            Input::Text(text) => text
                .chunks(TEXT)
                .for_each(|part| self.run(|pipeline| pipeline.candump.read(part, &mut pipeline.read))),
            Input::Rows(batch) => self.run(|pipeline| pipeline.read.append(batch)),
        }
    }

    /// What became of every line and record so far.
    pub fn counts(&self) -> &Counts {
        &self.read.counts
    }

    /// The kinds of time stamps seen so far.
    pub fn stamps(&self) -> Stamps {
        self.read.stamps
    }

    /// Interface names by the index in the `bus` columns.
    pub fn buses(&self) -> &[String] {
        self.read.buses.names()
    }

    /// End of capture: the unfinished line and every open transfer are closed.
    pub fn finish(&mut self) {
        self.run(|pipeline| pipeline.candump.close(&mut pipeline.read));
        self.reassembler.finish();
    }

    /// Hands over all rows so far. Frame numbers go on counting.
    pub fn take(&mut self) -> Batch {
        let frames = self.read.frames.like();
        Batch {
            frames: std::mem::replace(&mut self.read.frames, frames),
            events: std::mem::take(&mut self.events),
            results: self.reassembler.take(),
        }
    }

    /// Works through the rows that `read` appends.
    fn run(&mut self, read: impl FnOnce(&mut Pipeline)) {
        let first = self.read.frames.len();
        read(self);
        let events = std::mem::take(&mut self.read.events);
        self.add_events(first, &events);
        self.reassembler.feed(&self.read.frames, first);
    }

    /// Follows the time over frames from `first` on if it runs steadily from each to the next, as it nearly always does.
    fn follow(&mut self, first: usize) -> bool {
        let times = &self.read.frames.t[first..];
        let (Some(&start), Some(&end)) = (times.first(), times.last()) else {
            return true;
        };
        let steps = times.iter().zip(&times[1..]).map(|(a, b)| b.wrapping_sub(*a) as u64);
        let steady = steps.fold(start.wrapping_sub(self.latest) as u64, |all, step| all | step) < NO_GAP;
        if steady {
            self.latest = end;
        }
        steady
    }

    /// Adds the events, and the gaps in front of frames, in the order of their lines.
    fn add_events(&mut self, first: usize, events: &Events) {
        if self.follow(first) {
            self.events.extend(events, 0..events.len());
            return;
        }
        let mut added = 0;
        for row in first..self.read.frames.len() {
            let (t, line) = (self.read.frames.t[row], self.read.frames.line[row]);
            if t == NO_TIME {
                continue;
            }
            let silence = t.saturating_sub(self.latest);
            if silence > GAP_NS && self.latest != NO_TIME {
                let before = added + events.line[added..].partition_point(|&other| other < line);
                self.events.extend(events, added..before);
                added = before;
                let text = format!(
                    "silent for {}.{:03} s",
                    silence / 1_000_000_000,
                    silence / 1_000_000 % 1000
                );
                let gap = Event::remark(self.latest, line.into(), EventKind::Gap, &text);
                self.events.push(&gap);
            }
            // A stamp far ahead of all others makes one gap, it does not hide those to come.
            let back = t < self.latest.saturating_sub(GAP_NS);
            self.latest = if back { t } else { self.latest.max(t) };
        }
        self.events.extend(events, added..events.len());
    }
}
