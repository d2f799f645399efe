//! What every reader of a capture format does alike: bytes in, rows out, and a sum that accounts for each record.
#![forbid(unsafe_code)]

use crate::buses::MAX_BUSES;
use crate::events::{Event, EventKind};
use crate::frames::NO_TIME;
use crate::line::describe_error;
pub use crate::piece::Piece;
use crate::stamp::Stamps;

/// What became of the lines or records so far: `lines` is the sum of all the others but `dropped`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Counts {
    pub lines: u64,
    pub frames: u64,
    pub error_frames: u64,
    /// Lines that state a drop count.
    pub drops: u64,
    pub comments: u64,
    pub blank: u64,
    pub unreadable: u64,
    /// Sound records that have nothing to do with CAN.
    pub other: u64,
    /// Frames that another capture of the same bus holds too.
    pub repeated: u64,
    /// Frames that the drop counts report as lost.
    pub dropped: u64,
}

impl Counts {
    /// Adds what became of further records.
    pub fn add(&mut self, more: &Counts) {
        self.lines += more.lines;
        self.frames += more.frames;
        self.error_frames += more.error_frames;
        self.drops += more.drops;
        self.comments += more.comments;
        self.blank += more.blank;
        self.unreadable += more.unreadable;
        self.other += more.other;
        self.repeated += more.repeated;
        self.dropped += more.dropped;
    }

    /// What came on top of `earlier` counts of the same capture.
    #[must_use]
    pub fn since(&self, earlier: &Counts) -> Counts {
        Counts {
            lines: self.lines - earlier.lines,
            frames: self.frames - earlier.frames,
            error_frames: self.error_frames - earlier.error_frames,
            drops: self.drops - earlier.drops,
            comments: self.comments - earlier.comments,
            blank: self.blank - earlier.blank,
            unreadable: self.unreadable - earlier.unreadable,
            other: self.other - earlier.other,
            repeated: self.repeated - earlier.repeated,
            dropped: self.dropped - earlier.dropped,
        }
    }
}

/// Why a reader cannot go on, and in front of which byte of its input.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Damage {
    pub at: u64,
    pub reason: String,
}

/// A push parser of one capture format, fed in chunks of any size, with the same rows for each way to cut.
pub trait Reader: Send + Sync {
    /// Takes the next bytes.
    fn feed(&mut self, bytes: &[u8], rows: &mut Rows);
    /// The input ends here.
    fn finish(&mut self, rows: &mut Rows);
    /// What ended the reading early; all input behind it is ignored.
    fn damage(&self) -> Option<&Damage> {
        None
    }
}

/// Rows under way: one call a record, which numbers and counts it.
#[derive(Debug, Default)]
pub struct Rows {
    piece: Piece,
    /// Records before this piece.
    before: u64,
}

impl Rows {
    /// Everything since the last call. Record numbers and bus indexes go on.
    pub fn take(&mut self) -> Piece {
        self.before += self.piece.counts.lines;
        let next = Piece {
            buses: self.piece.buses.clone(),
            ..Piece::default()
        };
        std::mem::replace(&mut self.piece, next)
    }

    /// Rows that wait for `take`.
    pub fn waiting(&self) -> usize {
        self.piece.frames.len() + self.piece.events.len()
    }

    /// For a reader that numbers its lines itself.
    pub(crate) fn piece_mut(&mut self) -> &mut Piece {
        &mut self.piece
    }

    /// The index of an interface; `None` when there are more than [`MAX_BUSES`].
    pub fn bus(&mut self, name: &[u8]) -> Option<u8> {
        self.piece.buses.index(name).map(|(index, _)| index)
    }

    pub fn stamp(&mut self, kind: Stamps) {
        self.piece.stamps.insert(kind);
    }

    /// A frame: identifier alone, flag bits of [`crate::frames`], at most 64 bytes of data.
    pub fn frame(&mut self, t: i64, bus: u8, id: u32, flags: u16, data: &[u8]) {
        let line = self.next();
        self.piece.counts.frames += 1;
        if t == NO_TIME {
            self.piece.stamps.insert(Stamps::NONE);
        }
        self.piece.frames.push(t, bus, id, flags, line, data);
    }

    /// An error frame: the class bits of `linux/can/error.h`, whether it was sent or received (flag bits of
    /// [`crate::frames`], the others are ignored), and up to 8 bytes of data.
    pub fn error_frame(&mut self, t: i64, bus: u8, class: u32, flags: u16, data: &[u8]) {
        let (text, counters) = describe_error(class, data);
        self.piece.counts.error_frames += 1;
        if t == NO_TIME {
            self.piece.stamps.insert(Stamps::NONE);
        }
        let (line, kind) = (self.next(), EventKind::ErrorFrame);
        let bus = Some(bus);
        self.piece.events.push(&Event {
            t,
            bus,
            line,
            kind,
            class,
            flags,
            counters,
            data,
            text: &text,
        });
    }

    /// A record that states how many frames were lost.
    pub fn drops(&mut self, t: i64, bus: Option<u8>, frames: u32, text: &str) {
        self.piece.counts.drops += 1;
        self.piece.counts.dropped += u64::from(frames);
        self.event(t, bus, EventKind::Drop, frames, text);
    }

    /// A record that is damaged, and why; `text` is short and printable.
    pub fn unreadable(&mut self, t: i64, bus: Option<u8>, text: &str) {
        self.piece.counts.unreadable += 1;
        self.event(t, bus, EventKind::Unreadable, 0, text);
    }

    /// A comment of the capture; `text` is short and printable.
    pub fn comment(&mut self, t: i64, text: &str) {
        self.piece.counts.comments += 1;
        self.event(t, None, EventKind::Comment, 0, text);
    }

    /// Sound records that have nothing to do with CAN.
    pub fn other(&mut self, count: u64) {
        self.piece.counts.other += count;
        self.piece.counts.lines += count;
    }

    /// Empty lines.
    pub fn blank(&mut self, count: u64) {
        self.piece.counts.blank += count;
        self.piece.counts.lines += count;
    }

    /// The reason to give for a record of one interface too many.
    pub fn too_many_buses() -> String {
        format!("more than {MAX_BUSES} interfaces")
    }

    fn event(&mut self, t: i64, bus: Option<u8>, kind: EventKind, class: u32, text: &str) {
        let line = self.next();
        self.piece.events.push(&Event {
            bus,
            class,
            ..Event::remark(t, line, kind, text)
        });
    }

    fn next(&mut self) -> u64 {
        self.piece.counts.lines += 1;
        self.before + self.piece.counts.lines
    }
}
