//! What every reader of a capture format does alike: bytes in, rows out.
#![forbid(unsafe_code)]

use crate::buses::MAX_BUSES;
use crate::candump::{cut_short, excerpt};
use crate::events::{Event, EventKind};
use crate::frame_batch::FrameBatch;
use crate::frames::NO_TIME;
use crate::line::describe_error;
use crate::stamp::Stamps;

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
    batch: FrameBatch,
    /// Records before this batch.
    before: u64,
}

impl Rows {
    /// Everything since the last call. Record numbers and bus indexes go on, and there is room for as many frames.
    pub fn take(&mut self) -> FrameBatch {
        self.before += self.batch.counts.lines;
        let next = FrameBatch {
            frames: self.batch.frames.like(),
            buses: self.batch.buses.clone(),
            ..FrameBatch::default()
        };
        std::mem::replace(&mut self.batch, next)
    }

    /// Rows that wait for `take`.
    pub fn waiting(&self) -> usize {
        self.batch.frames.len() + self.batch.events.len()
    }

    /// For a reader that numbers its lines itself.
    pub(crate) fn batch_mut(&mut self) -> &mut FrameBatch {
        &mut self.batch
    }

    /// The index of an interface; `None` when there are more than [`MAX_BUSES`].
    pub fn bus(&mut self, name: &[u8]) -> Option<u8> {
        self.batch.buses.index(name).map(|(index, _)| index)
    }

    pub fn stamp(&mut self, kind: Stamps) {
        self.batch.stamps.insert(kind);
    }

    /// A frame: identifier alone, flag bits of [`crate::frames`], at most 64 bytes of data.
    pub fn frame(&mut self, t: i64, bus: u8, id: u32, flags: u16, data: &[u8]) {
        let line = self.next();
        self.batch.counts.frames += 1;
        if t == NO_TIME {
            self.batch.stamps.insert(Stamps::NONE);
        }
        self.batch.frames.push(t, bus, id, flags, line, data);
    }

    /// An error frame: the class bits of `linux/can/error.h`, whether it was sent or received (flag bits of
    /// [`crate::frames`], the others are ignored), and up to 8 bytes of data.
    pub fn error_frame(&mut self, t: i64, bus: u8, class: u32, flags: u16, data: &[u8]) {
        let (text, counters) = describe_error(class, data);
        self.batch.counts.error_frames += 1;
        if t == NO_TIME {
            self.batch.stamps.insert(Stamps::NONE);
        }
        let (line, kind) = (self.next(), EventKind::ErrorFrame);
        let bus = Some(bus);
        self.batch.events.push(&Event {
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
        self.batch.counts.drops += 1;
        self.batch.counts.dropped += u64::from(frames);
        self.event(t, bus, EventKind::Drop, frames, text);
    }

    /// A record that is damaged, and why; `text` is short and printable.
    pub fn unreadable(&mut self, t: i64, bus: Option<u8>, text: &str) {
        self.batch.counts.unreadable += 1;
        self.event(t, bus, EventKind::Unreadable, 0, text);
    }

    /// The last line of a text that ends without ending the line.
    pub fn cut_short(&mut self, line: &[u8]) {
        self.unreadable(NO_TIME, None, &excerpt(&cut_short(), line));
    }

    /// A comment of the capture; `text` is short and printable.
    pub fn comment(&mut self, t: i64, text: &str) {
        self.batch.counts.comments += 1;
        self.event(t, None, EventKind::Comment, 0, text);
    }

    /// A comment on the frame or error frame that is next, whose record holds it; `text` is short.
    pub fn frame_comment(&mut self, t: i64, bus: u8, text: &str) {
        let line = self.before + self.batch.counts.lines + 1;
        self.batch.events.push(&Event {
            bus: Some(bus),
            ..Event::remark(t, line, EventKind::FrameComment, text)
        });
    }

    /// Sound records that have nothing to do with CAN.
    pub fn other(&mut self, count: u64) {
        self.batch.counts.other += count;
        self.batch.counts.lines += count;
    }

    /// Empty lines.
    pub fn blank(&mut self, count: u64) {
        self.batch.counts.blank += count;
        self.batch.counts.lines += count;
    }

    /// The reason to give for a record of one interface too many.
    pub fn too_many_buses() -> String {
        format!("more than {MAX_BUSES} interfaces")
    }

    fn event(&mut self, t: i64, bus: Option<u8>, kind: EventKind, class: u32, text: &str) {
        let line = self.next();
        self.batch.events.push(&Event {
            bus,
            class,
            ..Event::remark(t, line, kind, text)
        });
    }

    fn next(&mut self) -> u64 {
        self.batch.counts.lines += 1;
        self.before + self.batch.counts.lines
    }
}
