//! Rows in the form in which a recording gives them back, without the way through its text.
//!
//! No format holds every row just as it came: buses are numbered as they appear, names are made to fit, texts are bounded,
//! flags that mean nothing beside others are gone. What candump text keeps goes through MCAP and pcapng unchanged, so this
//! is the form in which a live session decodes and judges: its findings are those of its recording. Only drop counts and
//! comments are text by nature, and are worded and read by those who write and read them in a file.
#![forbid(unsafe_code)]

use super::candump::Candump;
use super::{kind_of, Account, InOrder, Loss, Row};
use crate::candump::{beyond_limit, excerpt, MAX_LINE, REMARK};
use crate::events::EventKind;
use crate::frame_batch::FrameBatch;
use crate::frames::{BRS, DLC_SHIFT, ESI, EXTENDED, FD, ID_MASK, MAX_CLASSIC, NO_TIME, REMOTE, RX, TX};
use crate::line::{escape, remark};
use crate::reader::Rows;
use crate::stamp::Stamps;

/// One recording under way: numbers of buses and records go on from batch to batch.
pub struct Recorded {
    text: Candump,
    rows: Rows,
    stamps: Stamps,
}

impl Default for Recorded {
    fn default() -> Self {
        Recorded {
            text: Candump::recording(),
            rows: Rows::default(),
            stamps: Stamps::default(),
        }
    }
}

impl Recorded {
    /// The rows of the next batch. What is unreadable is left out.
    pub fn apply(&mut self, batch: &FrameBatch) -> FrameBatch {
        self.text.learn(batch.buses.names());
        for row in InOrder::new(batch) {
            match row {
                Row::Frame(row) => self.frame(batch, row),
                Row::Event(row) => self.event(batch, row),
            }
        }
        let mut out = self.rows.take();
        self.stamps.insert(out.stamps);
        if out.counts.lines > 0 {
            out.stamps = self.stamps;
        }
        out
    }

    /// What a recording cannot hold.
    pub fn account(&self) -> &Account {
        &self.text.account
    }

    fn frame(&mut self, batch: &FrameBatch, row: usize) {
        let (frames, data) = (&batch.frames, batch.frames.data_of(row));
        let flags = frames.flags[row];
        let code = flags >> DLC_SHIFT & 15;
        let (kept, data) = if flags & FD != 0 {
            (flags & (FD | BRS | ESI), data)
        } else if flags & REMOTE != 0 {
            (REMOTE | code << DLC_SHIFT, &[][..])
        } else if code > MAX_CLASSIC as u16 && data.len() == MAX_CLASSIC {
            (code << DLC_SHIFT, data)
        } else {
            if code > MAX_CLASSIC as u16 {
                self.text.account.add(Loss::RawCode);
            }
            (0, data)
        };
        let extended = if self.text.account.takes(frames.id[row], flags) {
            EXTENDED
        } else {
            0
        };
        let (t, bus) = (self.stamp(frames.t[row]), self.bus(frames.bus[row]));
        let kept = extended | kept | direction(flags);
        self.rows.frame(t, bus, frames.id[row] & ID_MASK, kept, data);
    }

    fn event(&mut self, batch: &FrameBatch, row: usize) {
        let events = &batch.events;
        match kind_of(events, row) {
            EventKind::ErrorFrame => {
                let (t, bus) = (self.stamp(events.t[row]), self.bus(events.bus[row]));
                let (class, flags) = (events.class[row] & ID_MASK, direction(events.flags[row]));
                self.rows.error_frame(t, bus, class, flags, events.data_of(row));
            }
            EventKind::Unreadable => {}
            EventKind::Drop => {
                let mut line = vec![];
                let bus = self.text.drop_count(batch, row, &mut line);
                let bus = bus.and_then(|bus| self.rows.bus(&self.text.names[usize::from(bus)]));
                let t = if events.t[row] < 0 { NO_TIME } else { events.t[row] };
                let text = escape(line.trim_ascii(), REMARK);
                self.rows.drops(t, bus, events.class[row], &text);
            }
            EventKind::Comment | EventKind::FrameComment | EventKind::Gap => {
                let mut line = vec![];
                self.text.comment(events.t[row], &events.text_of(row), &mut line);
                let line = line.trim_ascii_end();
                if line.len() > MAX_LINE {
                    let text = excerpt(&beyond_limit(), line);
                    return self.rows.unreadable(NO_TIME, None, &text);
                }
                let (t, text) = remark::time_in_front(line);
                self.rows.comment(t.unwrap_or(NO_TIME), &escape(&text, REMARK));
            }
        }
    }

    fn bus(&mut self, bus: u8) -> u8 {
        let name = self.text.names.get(usize::from(bus)).map_or(&b"can"[..], Vec::as_slice);
        self.rows.bus(name).unwrap_or(u8::MAX)
    }

    /// The time of a frame or an error frame, and what it says of the clock.
    fn stamp(&mut self, t: i64) -> i64 {
        if t >= 0 {
            self.rows.stamp(Stamps::ABSOLUTE);
            self.rows.stamp(Stamps::NANOSECONDS);
            return t;
        }
        if t != NO_TIME {
            self.text.account.add(Loss::EarlyTime);
        }
        NO_TIME
    }
}

/// One direction at most.
fn direction(flags: u16) -> u16 {
    if flags & TX != 0 {
        TX
    } else {
        flags & RX
    }
}
