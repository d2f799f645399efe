//! Candump text or the rows of any reader in, tables out: reading and reassembly behind one door, without any I/O.
#![forbid(unsafe_code)]

use crate::buses::Buses;
use crate::candump::Candump;
use crate::events::{Event, EventKind, Events};
use crate::frames::{Frames, NO_TIME};
use crate::reader::{Counts, Piece};
use crate::reassembly::{Reassembler, Resolve, Results};
use crate::stamp::Stamps;

/// All interfaces silent for longer than this is a gap in the capture.
const GAP_NS: i64 = 1_000_000_000;
/// Text is worked through in pieces that stay in the cache between the two passes.
const TEXT: usize = 128 << 10;

/// One slice of every table.
#[derive(Debug, Default)]
pub struct Batch {
    pub frames: Frames,
    pub events: Events,
    pub results: Results,
}

pub struct Pipeline {
    pub candump: Candump,
    pub reassembler: Reassembler,
    frames: Frames,
    events: Events,
    latest: i64,
    /// What came as rows instead of text.
    counts: Counts,
    stamps: Stamps,
    buses: Buses,
}

impl Pipeline {
    pub fn new(resolve: Resolve) -> Self {
        Pipeline {
            candump: Candump::new(),
            reassembler: Reassembler::new(resolve),
            frames: Frames::default(),
            events: Events::default(),
            latest: NO_TIME,
            counts: Counts::default(),
            stamps: Stamps::default(),
            buses: Buses::default(),
        }
    }

    /// Rows waiting to be taken: frames and events.
    pub fn waiting(&self) -> usize {
        self.frames.len() + self.events.len()
    }

    /// Takes candump text; a line that is not finished waits for more.
    pub fn feed_candump(&mut self, text: &[u8]) {
        for piece in text.chunks(TEXT) {
            let first = self.frames.len();
            let mut events = Events::default();
            self.candump.feed(piece, &mut self.frames, &mut events);
            self.run(first, &events);
        }
    }

    /// Takes the rows of a reader, records in ascending order. A capture is either text or rows.
    pub fn feed_rows(&mut self, piece: &Piece) {
        let first = self.frames.len();
        self.counts.add(&piece.counts);
        self.stamps.insert(piece.stamps);
        self.buses.clone_from(&piece.buses);
        self.frames.extend(&piece.frames);
        self.run(first, &piece.events);
    }

    /// What became of every line and record so far.
    pub fn counts(&self) -> Counts {
        let mut counts = self.candump.counts();
        counts.add(&self.counts);
        counts
    }

    /// The kinds of time stamps seen so far.
    pub fn stamps(&self) -> Stamps {
        let mut stamps = self.candump.stamps();
        stamps.insert(self.stamps);
        stamps
    }

    /// Interface names by the index in the `bus` columns.
    pub fn buses(&self) -> &[String] {
        if self.buses.names().is_empty() {
            self.candump.buses()
        } else {
            self.buses.names()
        }
    }

    /// End of capture: the unfinished line and every open transfer are closed.
    pub fn finish(&mut self) {
        let first = self.frames.len();
        let mut events = Events::default();
        self.candump.finish(&mut self.frames, &mut events);
        self.run(first, &events);
        self.reassembler.finish();
    }

    /// Hands over all rows so far. Frame numbers go on counting.
    pub fn take(&mut self) -> Batch {
        Batch {
            frames: std::mem::take(&mut self.frames),
            events: std::mem::take(&mut self.events),
            results: self.reassembler.take(),
        }
    }

    /// Works through the frames from `first` on and the `events` that came with them.
    fn run(&mut self, first: usize, events: &Events) {
        self.add_events(first, events);
        self.reassembler.feed(&self.frames, first);
    }

    /// Adds the events, and the gaps in front of frames, in the order of their lines.
    fn add_events(&mut self, first: usize, events: &Events) {
        let mut added = 0;
        for row in first..self.frames.len() {
            let (t, line) = (self.frames.t[row], self.frames.line[row]);
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
