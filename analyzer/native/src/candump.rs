//! Candump text to rows: a push parser without I/O, fed in chunks of any size, with the same rows for each way to cut.
//!
//! Every line is one row of `frames`, one row of `events`, or blank. The readable path ([`line::read`]) knows every
//! dialect; the fast one ([`simd::scan`]) takes the plain log lines of classic frames and leaves it the rest.
#![forbid(unsafe_code)]

mod held;
mod reader;

use held::Held;

use crate::buses::{Buses, MAX_BUSES};
use crate::counts::Counts;
use crate::events::{Event, EventKind, Events};
use crate::frames::{Frames, ERROR, NO_TIME};
use crate::line::{self, DropCount, Frame, Line, Reason};
use crate::simd::{self, Block, Template};
use crate::stamp::{Kind, Stamps};

/// A longer line is skipped to its end and counted as unreadable.
pub const MAX_LINE: usize = 65_536;
/// Characters of an unreadable line that are quoted.
const EXCERPT: usize = 80;
/// What is kept of a line that is too long: enough to see that the excerpt is cut.
const START: usize = EXCERPT + 1;
/// Characters of a comment or drop line that are kept.
pub(crate) const REMARK: usize = 200;
const OUT_OF_RANGE: &str = "time stamp out of range";

pub struct Candump {
    /// `None`: only the readable path.
    fast: Option<Box<Block>>,
    template: Template,
    buses: Buses,
    counts: Counts,
    stamps: Stamps,
    held: Held,
    /// The unfinished last line; of a line that is too long only its start.
    rest: Vec<u8>,
    too_long: bool,
    /// The line before was an error frame or a part of its explanation.
    explaining: bool,
}

impl Default for Candump {
    fn default() -> Self {
        Candump {
            fast: Some(Box::default()),
            ..Candump::readable()
        }
    }
}

impl Candump {
    pub fn new() -> Self {
        Candump::default()
    }

    /// The same parser without the fast path: slower, and the reference for it.
    pub fn readable() -> Self {
        Candump {
            fast: None,
            template: Template::default(),
            buses: Buses::default(),
            counts: Counts::default(),
            stamps: Stamps::default(),
            held: Held::new(),
            rest: vec![],
            too_long: false,
            explaining: false,
        }
    }

    /// Appends a row for each complete line. Up to 32 rows with relative stamps wait inside until it is known what
    /// their stamps count from.
    pub fn feed(&mut self, chunk: &[u8], frames: &mut Frames, events: &mut Events) {
        let mut text = chunk;
        if self.too_long || !self.rest.is_empty() {
            let Some(end) = newline(text) else {
                return self.keep(text);
            };
            self.keep(&text[..end]);
            text = &text[end + 1..];
            self.finish_line(frames, events);
        }
        loop {
            text = self.fast_lines(text, frames);
            let Some(end) = newline(text) else {
                return self.keep(text);
            };
            self.too_long = end > MAX_LINE;
            self.line(&text[..end], frames, events);
            text = &text[end + 1..];
        }
    }

    /// The input ends here: a line without its end is cut, and nothing waits any longer.
    pub fn finish(&mut self, frames: &mut Frames, events: &mut Events) {
        if self.too_long {
            self.finish_line(frames, events);
        } else if !self.rest.is_empty() {
            self.counts.lines += 1;
            let rest = std::mem::take(&mut self.rest);
            self.unreadable(&cut_short(), &rest, frames, events);
        }
        self.settle(frames, events, true);
    }

    /// Interface names by the index in the `bus` columns, unprintable bytes escaped.
    pub fn buses(&self) -> &[String] {
        self.buses.names()
    }

    pub fn counts(&self) -> Counts {
        self.counts
    }

    pub fn stamps(&self) -> Stamps {
        self.stamps
    }

    fn keep(&mut self, text: &[u8]) {
        self.too_long |= self.rest.len() + text.len() > MAX_LINE;
        let room = if self.too_long {
            START.saturating_sub(self.rest.len())
        } else {
            text.len()
        };
        self.rest.extend_from_slice(&text[..room.min(text.len())]);
        if self.too_long {
            self.rest.truncate(START);
        }
    }

    fn finish_line(&mut self, frames: &mut Frames, events: &mut Events) {
        let mut rest = std::mem::take(&mut self.rest);
        self.line(&rest, frames, events);
        rest.clear();
        self.rest = rest;
    }

    /// Takes the plain log lines that `text` starts with; returns what follows them.
    fn fast_lines<'a>(&mut self, mut text: &'a [u8], frames: &mut Frames) -> &'a [u8] {
        let Some(block) = self.fast.as_mut().filter(|_| !self.held.is_waiting()) else {
            return text;
        };
        loop {
            let used = simd::scan(text, &mut self.template, block);
            if used == 0 {
                return text;
            }
            text = &text[used..];
            block.append_to(frames, self.counts.lines + 1);
            self.counts.lines += block.len() as u64;
            self.counts.frames += block.len() as u64;
            self.stamps.insert(Stamps::ABSOLUTE);
            self.stamps.insert(Stamps::resolution(block.digits()));
            self.explaining = false;
        }
    }

    fn line(&mut self, line: &[u8], frames: &mut Frames, events: &mut Events) {
        self.counts.lines += 1;
        let explaining = std::mem::take(&mut self.explaining);
        let too_long = std::mem::take(&mut self.too_long);
        let line = if too_long { &line[..START] } else { line };
        let plain = line::plain(line);
        let read = if too_long {
            Err(beyond_limit())
        } else {
            line::read(&plain)
        };
        let done = match read {
            Ok(Line::Blank) => {
                self.counts.blank += 1;
                Ok(())
            }
            Ok(Line::Comment) => {
                self.remark(&plain, frames, events);
                Ok(())
            }
            Ok(Line::Drop(drop)) => {
                self.drop_count(&drop, &plain, frames, events);
                Ok(())
            }
            Ok(Line::Frame(frame)) => self.frame(&frame, frames, events),
            Err(_) if explaining && !too_long && plain.starts_with(b"\t") => {
                self.explaining = true;
                self.remark(&plain, frames, events);
                Ok(())
            }
            Err(reason) => Err(reason),
        };
        if let Err(reason) = done {
            self.unreadable(&reason, line, frames, events);
        }
        self.settle(frames, events, false);
    }

    fn unreadable(&mut self, reason: &Reason, line: &[u8], frames: &mut Frames, events: &mut Events) {
        self.counts.unreadable += 1;
        let text = excerpt(reason, line);
        self.event(NO_TIME, EventKind::Unreadable, &text, frames, events);
    }

    fn frame(&mut self, frame: &Frame<'_>, frames: &mut Frames, events: &mut Events) -> Result<(), Reason> {
        let bus = self.bus(frame.name)?;
        let is_error = frame.flags & ERROR != 0;
        let t = match frame.stamp {
            None => NO_TIME,
            Some(stamp) if frame.relative => self.held.time(stamp.ns).ok_or(OUT_OF_RANGE)?,
            Some(stamp) => stamp.ns,
        };
        self.stamps.insert(match frame.stamp {
            None => Stamps::NONE,
            Some(stamp) => Stamps::resolution(stamp.digits),
        });
        match frame.stamp {
            Some(stamp) if frame.relative => self.held.mark(bus, is_error, stamp.ns),
            Some(stamp) if stamp.kind == Kind::Date => self.stamps.insert(Stamps::DATE),
            Some(_) => self.stamps.insert(Stamps::ABSOLUTE),
            None => {}
        }
        let line = self.counts.lines;
        let (frames, events) = self.held.tables(frames, events);
        if is_error {
            let (text, counters) = line::describe_error(frame.id, frame.data());
            let (kind, bus, class) = (EventKind::ErrorFrame, Some(bus), frame.id);
            events.push(&Event {
                t,
                bus,
                line,
                kind,
                class,
                flags: frame.flags,
                counters,
                data: frame.data(),
                text: &text,
            });
            self.counts.error_frames += 1;
            self.explaining = true;
        } else {
            frames.push(t, bus, frame.id, frame.flags, line, frame.data());
            self.counts.frames += 1;
        }
        Ok(())
    }

    fn drop_count(&mut self, drop: &DropCount<'_>, line: &[u8], frames: &mut Frames, events: &mut Events) {
        self.counts.drops += 1;
        self.counts.dropped += u64::from(drop.frames);
        let text = line::escape(line.trim_ascii(), REMARK);
        let event = Event {
            bus: drop.name.and_then(|name| self.bus(name).ok()),
            class: drop.frames,
            ..Event::remark(drop.t.unwrap_or(NO_TIME), self.counts.lines, EventKind::Drop, &text)
        };
        self.held.tables(frames, events).1.push(&event);
    }

    fn remark(&mut self, line: &[u8], frames: &mut Frames, events: &mut Events) {
        self.counts.comments += 1;
        let (t, text) = line::remark::time_in_front(line.trim_ascii());
        let text = line::escape(&text, REMARK);
        self.event(t.unwrap_or(NO_TIME), EventKind::Comment, &text, frames, events);
    }

    fn event(&mut self, t: i64, kind: EventKind, text: &str, frames: &mut Frames, events: &mut Events) {
        let line = self.counts.lines;
        let event = Event::remark(t, line, kind, text);
        self.held.tables(frames, events).1.push(&event);
    }

    fn settle(&mut self, frames: &mut Frames, events: &mut Events, at_end: bool) {
        self.stamps.insert(self.held.settle(frames, events, at_end));
    }

    /// The index of an interface; a new name gets the next one.
    fn bus(&mut self, name: &[u8]) -> Result<u8, Reason> {
        let (bus, new) = self
            .buses
            .index(name)
            .ok_or_else(|| format!("more than {MAX_BUSES} interfaces"))?;
        if new {
            self.template.learn(name, bus);
        }
        Ok(bus)
    }
}

/// Why a line of more than [`MAX_LINE`] bytes is not read.
pub(crate) fn beyond_limit() -> Reason {
    format!("line longer than {MAX_LINE} bytes").into()
}

/// Why the last line of a text is not read when it has no end: what there is of it may look whole and is not.
pub(crate) fn cut_short() -> Reason {
    "the capture ends in the middle of this line".into()
}

/// Why a line is not read, and how it begins.
pub(crate) fn excerpt(reason: &Reason, line: &[u8]) -> String {
    let start = &line[..line.len().min(START)];
    let line = if line.len() > MAX_LINE { start } else { line };
    format!("{reason}: {}", line::escape(line.trim_ascii_end(), EXCERPT))
}

/// Where the first line ends. Looking at eight bytes at a time is what makes the readable path bearable.
fn newline(text: &[u8]) -> Option<usize> {
    const ONES: u64 = 0x0101_0101_0101_0101;
    let mut words = text.chunks_exact(8);
    let before = words.by_ref().take_while(|word| {
        let differs = u64::from_le_bytes((*word).try_into().unwrap_or_default()) ^ (ONES * u64::from(b'\n'));
        differs.wrapping_sub(ONES) & !differs & (ONES << 7) == 0
    });
    let from = 8 * before.count();
    text[from..].iter().position(|&b| b == b'\n').map(|at| from + at)
}
