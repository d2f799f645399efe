//! Candump's log form (`candump -L`), in the dialect that [`crate::line`] reads back.
#![forbid(unsafe_code)]

use super::{bus_of, kind_of, Account, Loss, Writer};
use crate::events::EventKind;
use crate::frame_batch::FrameBatch;
use crate::frames::{BRS, DLC_SHIFT, ESI, FD, MAX_CLASSIC, NO_TIME, REMOTE, RX, TX, WORD_ERROR};
use crate::line::{self, escape, Line, MAX_NAME};

const SECOND: i64 = 1_000_000_000;
const MICROSECOND: i64 = 1_000;
/// Seconds are filled up to this many digits.
const SECOND_DIGITS: usize = 10;
/// What drop counts call all interfaces together, and what ends a name in them.
const ANY: &[u8] = b"any";
const QUOTING: &[u8] = b"',";
const DIGITS: &[u8; 16] = b"0123456789ABCDEF";
/// Both digits of each byte.
const HEX: [[u8; 2]; 256] = {
    let mut pairs = [[0; 2]; 256];
    let mut byte = 0;
    while byte < 256 {
        pairs[byte] = [DIGITS[byte >> 4], DIGITS[byte & 15]];
        byte += 1;
    }
    pairs
};

/// Lines of text; fractions have 6 digits, and 9 from the first batch on that needs them.
#[derive(Default)]
pub struct Candump {
    /// Names as they are written, by bus.
    pub(super) names: Vec<Vec<u8>>,
    fine: bool,
    /// Names fit drop counts, too.
    strict: bool,
    /// Frames that the drop counts report as lost.
    dropped: u64,
    pub(super) account: Account,
}

impl Writer for Candump {
    fn look_ahead(&mut self, batch: &FrameBatch) -> usize {
        self.learn(batch.buses.names());
        let mut times = batch.frames.t.iter().chain(&batch.events.t);
        self.fine = self.fine || times.any(|&t| t != NO_TIME && t % MICROSECOND != 0);
        56
    }

    fn frame(&mut self, batch: &FrameBatch, row: usize, out: &mut Vec<u8>) {
        let (frames, data) = (&batch.frames, batch.frames.data_of(row));
        let (id, flags) = (frames.id[row], frames.flags[row]);
        let code = (flags >> DLC_SHIFT) as u8 & 15;
        self.account.frames += 1;
        self.start(frames.t[row], frames.bus[row], out);
        if self.account.takes(id, flags) {
            hex(&id.to_be_bytes(), out);
        } else {
            out.extend([
                DIGITS[id as usize >> 8 & 15],
                DIGITS[id as usize >> 4 & 15],
                DIGITS[id as usize & 15],
            ]);
        }
        out.push(b'#');
        if flags & FD != 0 {
            let marks = usize::from(flags & BRS != 0) | usize::from(flags & ESI != 0) << 1;
            out.extend([b'#', DIGITS[marks]]);
            hex(data, out);
        } else if flags & REMOTE != 0 {
            out.push(b'R');
            match code {
                0 => {}
                1..=8 => out.push(DIGITS[usize::from(code)]),
                _ => out.extend([b'8', b'_', DIGITS[usize::from(code)]]),
            }
        } else {
            hex(data, out);
            match code {
                0..=8 => {}
                _ if data.len() == MAX_CLASSIC => out.extend([b'_', DIGITS[usize::from(code)]]),
                _ => self.account.add(Loss::RawCode),
            }
        }
        end(flags, out);
    }

    fn event(&mut self, batch: &FrameBatch, row: usize, out: &mut Vec<u8>) {
        let events = &batch.events;
        match kind_of(events, row) {
            EventKind::ErrorFrame => {
                self.start(events.t[row], events.bus[row], out);
                hex(&(events.class[row] | WORD_ERROR).to_be_bytes(), out);
                out.push(b'#');
                hex(events.data_of(row), out);
                end(events.flags[row], out);
            }
            EventKind::Unreadable => {}
            EventKind::Drop => {
                self.drop_count(batch, row, out);
            }
            EventKind::Comment | EventKind::FrameComment | EventKind::Gap => {
                self.comment(events.t[row], &events.text_of(row), out);
            }
        }
    }

    fn comment(&mut self, _: &str) {
        self.account.add(Loss::Comment);
    }

    fn account(&self) -> &Account {
        &self.account
    }
}

impl Candump {
    /// A writer for recordings of a live bus: all fractions have 9 digits, so that no line depends on those before it,
    /// and every name can stand in a drop count.
    #[must_use]
    pub fn recording() -> Self {
        Candump {
            fine: true,
            strict: true,
            ..Candump::default()
        }
    }

    pub(super) fn learn(&mut self, names: &[String]) {
        for name in &names[self.names.len().min(names.len())..] {
            let mut fit = fitting(name.as_bytes(), self.strict);
            for number in 2_u32.. {
                if !self.names.contains(&fit) {
                    break;
                }
                let end = format!("_{number}");
                fit.truncate(fit.len().min(MAX_NAME - end.len()));
                fit.extend_from_slice(end.as_bytes());
            }
            if fit != name.as_bytes() {
                self.account.add(Loss::Name);
            }
            self.names.push(fit);
        }
    }

    /// The capture's own line if it was one, else one with the sum so far; the bus that it names.
    pub(super) fn drop_count(&mut self, batch: &FrameBatch, row: usize, out: &mut Vec<u8>) -> Option<u8> {
        let (events, frames) = (&batch.events, batch.events.class[row]);
        self.dropped += u64::from(frames);
        let known = bus_of(events, row).filter(|&bus| usize::from(bus) < self.names.len());
        let plain = |name: &[u8]| *name != *ANY && !name.iter().any(|b| QUOTING.contains(b));
        let named = known.filter(|&bus| plain(&self.names[usize::from(bus)]));
        let name = named.map_or(ANY, |bus| self.names[usize::from(bus)].as_slice());
        if known.is_some() && name == ANY {
            self.account.add(Loss::DropBus);
        }
        let says_the_same = |text: &[u8]| match line::read(text) {
            Ok(Line::Drop(drop)) => {
                (drop.frames, drop.name.unwrap_or(ANY), drop.t.unwrap_or(NO_TIME)) == (frames, name, events.t[row])
            }
            _ => false,
        };
        let text = events.text_of(row);
        if says_the_same(text.as_bytes()) {
            out.extend(text.as_bytes());
        } else {
            out.extend(b"DROPCOUNT: dropped ");
            number(frames.into(), 1, out);
            out.extend(if frames == 1 {
                &b" CAN frame on '"[..]
            } else {
                b" CAN frames on '"
            });
            out.extend(name);
            out.extend(b"' socket (total drops ");
            number(self.dropped, 1, out);
            out.push(b')');
            self.time(events.t[row], out);
        }
        out.push(b'\n');
        named
    }

    /// A time stands behind the mark of a comment.
    pub(super) fn comment(&mut self, t: i64, text: &str, out: &mut Vec<u8>) {
        let text = escape(text.as_bytes(), usize::MAX);
        let marked = text.starts_with(['#', ';']);
        let (mark, rest) = text.split_at(usize::from(marked));
        out.extend(if marked { mark } else { "#" }.as_bytes());
        self.time(t, out);
        if !marked {
            out.push(b' ');
        }
        out.extend(rest.as_bytes());
        out.push(b'\n');
    }

    /// The time of a comment or a drop count, if it has one, as [`line::remark`] finds it.
    fn time(&mut self, t: i64, out: &mut Vec<u8>) {
        if t >= 0 {
            out.push(b' ');
            self.stamp(t, out);
        } else if t != NO_TIME {
            self.account.add(Loss::EarlyTime);
        }
    }

    /// Stamp and interface. A line without a stamp is one without a time.
    fn start(&mut self, t: i64, bus: u8, out: &mut Vec<u8>) {
        if t >= 0 {
            self.stamp(t, out);
            out.push(b' ');
        } else if t != NO_TIME {
            self.account.add(Loss::EarlyTime);
        }
        out.extend(self.names.get(usize::from(bus)).map_or(&b"can"[..], Vec::as_slice));
        out.push(b' ');
    }

    fn stamp(&self, t: i64, out: &mut Vec<u8>) {
        out.push(b'(');
        number((t / SECOND) as u64, SECOND_DIGITS, out);
        out.push(b'.');
        if self.fine {
            number((t % SECOND) as u64, 9, out);
        } else {
            number((t % SECOND / MICROSECOND) as u64, 6, out);
        }
        out.push(b')');
    }
}

/// The direction, if it is known, and the end of the line.
fn end(flags: u16, out: &mut Vec<u8>) {
    if flags & TX != 0 {
        out.extend(b" T");
    } else if flags & RX != 0 {
        out.extend(b" R");
    }
    out.push(b'\n');
}

/// A name that is one word of a line, and not the start of another kind of line; `strict` also asks that a drop count can
/// quote it.
fn fitting(name: &[u8], strict: bool) -> Vec<u8> {
    let good = |b: u8| b.is_ascii_graphic() && b != b'#' && !(strict && QUOTING.contains(&b));
    let kept = name.iter().take(MAX_NAME).map(|&b| if good(b) { b } else { b'_' });
    let mut fit: Vec<u8> = kept.collect();
    match fit.as_mut_slice() {
        [] => fit.extend(b"can"),
        any if strict && *any == *ANY => fit.push(b'_'),
        [first @ (b'(' | b';'), ..] => *first = b'_',
        [b'D', b'R', b'O', b'P', b'C', b'O', b'U', b'N', b'T', colon @ b':', ..] => *colon = b'_',
        _ => {}
    }
    fit
}

fn hex(data: &[u8], out: &mut Vec<u8>) {
    for &byte in data {
        out.extend(HEX[usize::from(byte)]);
    }
}

/// Decimal digits, filled up with zeros to `width`.
fn number(mut value: u64, width: usize, out: &mut Vec<u8>) {
    let mut digits = [b'0'; 20];
    let mut at = digits.len();
    while value > 0 || digits.len() - at < width {
        at -= 1;
        digits[at] = b'0' + (value % 10) as u8;
        value /= 10;
    }
    out.extend_from_slice(&digits[at..]);
}
