//! What all readers of binary formats do alike: records cut anywhere between chunks, damaged ones, and the search for
//! the next sound one behind them.
#![forbid(unsafe_code)]

use crate::frames::NO_TIME;
use crate::line::Reason;
use crate::reader::{Damage, Reader, Rows};

/// How much is collected at once while a search has to look at bytes of several chunks.
const SEARCHED: usize = 65_536;
/// Why a record is passed over that the input ends in, when sound ones follow inside of it.
const CUT: &str = "record longer than the rest of the capture";

/// What the bytes in front are.
pub enum Step {
    /// A record of so many bytes; its rows are made.
    Used(usize),
    /// Undecided before so many bytes are there; always more than there are.
    Need(usize),
    /// No record that can be read; the next one has to be searched.
    Damaged(Reason),
    /// All that follows is unreadable.
    Stop(Reason),
}

/// Whether a record starts here, seen from amid damaged bytes.
pub enum Start {
    Here,
    Not,
    /// Undecided before so many bytes are there; always more than there are.
    Need(usize),
}

/// One format. Its answers depend on the bytes and on its own state, not on how many more bytes are already there.
pub trait Format: Default + Send + Sync {
    /// What the data is called when it ends early.
    const NAME: &'static str;
    /// Bytes that are all 0x00 or all 0xFF up to the end are no damage.
    const PADDED: bool = false;
    /// Looks at the record in front of `bytes`, which are not empty and, `at_end`, all that is left.
    fn record(&mut self, bytes: &[u8], at_end: bool, rows: &mut Rows) -> Step;
    /// Says whether a sound record starts in front of `bytes`.
    fn starts(&self, bytes: &[u8], at_end: bool) -> Start;
    /// Why a capture that was read to its end can have no frames, if so.
    fn lacks(&self) -> Option<String> {
        None
    }
}

/// The push parser of a format.
#[derive(Default)]
pub struct Binary<F> {
    format: F,
    /// Bytes of earlier chunks, of which the first `done` ones are done and behind them `needed` ones have to be there.
    kept: Vec<u8>,
    done: usize,
    needed: usize,
    /// Bytes of the input that are done.
    at: u64,
    lost: Option<Lost>,
    damage: Option<Damage>,
}

/// Bytes that cannot be read, up to the next record.
struct Lost {
    from: u64,
    reason: Reason,
    /// The input ended in the record here.
    cut: bool,
    /// The byte that all of them are.
    filler: Option<u8>,
}

impl<F: Format> Reader for Binary<F> {
    fn feed(&mut self, bytes: &[u8], rows: &mut Rows) {
        let mut chunk = bytes;
        while !self.kept.is_empty() && !chunk.is_empty() {
            let searched = if self.lost.is_some() { SEARCHED } else { 1 };
            let missing = (self.done + self.needed).saturating_sub(self.kept.len()).max(searched);
            let (taken, rest) = chunk.split_at(missing.min(chunk.len()));
            self.kept.extend_from_slice(taken);
            chunk = rest;
            if self.kept.len() >= self.done + self.needed {
                self.go_on(false, rows);
            }
        }
        if !chunk.is_empty() {
            let (used, needed) = self.take(chunk, false, rows);
            self.kept.extend_from_slice(&chunk[used..]);
            self.needed = needed;
        }
    }

    fn finish(&mut self, rows: &mut Rows) {
        self.go_on(true, rows);
        let Some(lost) = self.lost.take() else {
            let lacks = self.format.lacks().map(|reason| Damage { at: 0, reason });
            self.damage = self.damage.take().or(lacks);
            return;
        };
        if F::PADDED && matches!(lost.filler, Some(0x00 | 0xFF)) {
            return;
        }
        let reason = if lost.cut {
            format!("{} ends early", F::NAME)
        } else {
            report(&lost, self.at, rows);
            format!("no {} that can be read from here on", F::NAME)
        };
        self.damage = Some(Damage { at: lost.from, reason });
    }

    fn damage(&self) -> Option<&Damage> {
        self.damage.as_ref()
    }
}

impl<F: Format> Binary<F> {
    pub fn of(format: F) -> Self {
        Binary {
            format,
            ..Binary::default()
        }
    }

    pub fn format_mut(&mut self) -> &mut F {
        &mut self.format
    }

    fn go_on(&mut self, at_end: bool, rows: &mut Rows) {
        let mut kept = std::mem::take(&mut self.kept);
        let (used, needed) = self.take(&kept[self.done..], at_end, rows);
        (self.done, self.needed) = (self.done + used, needed);
        // Moving the rest to the front each time would cost the square of a long record's bytes.
        if self.done >= kept.len() / 2 {
            kept.drain(..self.done);
            self.done = 0;
        }
        self.kept = kept;
    }

    /// Takes what can be told of the front of `bytes`: how many of them are done, and how many the rest has to have.
    fn take(&mut self, bytes: &[u8], at_end: bool, rows: &mut Rows) -> (usize, usize) {
        let (start, mut used, mut needed) = (self.at, 0, 0);
        while used < bytes.len() && needed == 0 {
            let rest = &bytes[used..];
            self.at = start + used as u64;
            if self.damage.is_some() {
                used = bytes.len();
            } else if self.lost.is_some() {
                let passed;
                (passed, needed) = self.search(rest, at_end, rows);
                used += passed;
            } else {
                let reason = match self.format.record(rest, at_end, rows) {
                    Step::Used(length) => {
                        used += length;
                        continue;
                    }
                    Step::Need(length) if !at_end => {
                        needed = length;
                        continue;
                    }
                    Step::Need(_) => CUT.into(),
                    Step::Damaged(reason) => reason,
                    Step::Stop(reason) => {
                        let reason = reason.into_owned();
                        self.damage = Some(Damage { at: self.at, reason });
                        continue;
                    }
                };
                self.lost = Some(Lost {
                    from: self.at,
                    cut: reason == CUT,
                    reason,
                    filler: Some(rest[0]),
                });
                used += 1;
            }
        }
        self.at = start + used as u64;
        (used, needed)
    }

    /// Passes over bytes up to the next record: how many, and how many the rest has to have to go on.
    fn search(&mut self, bytes: &[u8], at_end: bool, rows: &mut Rows) -> (usize, usize) {
        for (passed, byte) in bytes.iter().enumerate() {
            match self.format.starts(&bytes[passed..], at_end) {
                Start::Here => {
                    if let Some(lost) = self.lost.take() {
                        report(&lost, self.at + passed as u64, rows);
                    }
                    return (passed, 0);
                }
                Start::Need(length) if !at_end => return (passed, length),
                Start::Not | Start::Need(_) => {
                    if let Some(lost) = &mut self.lost {
                        lost.filler = lost.filler.filter(|filler| filler == byte);
                    }
                }
            }
        }
        (bytes.len(), 0)
    }
}

/// One event for the bytes that could not be read.
fn report(lost: &Lost, end: u64, rows: &mut Rows) {
    let text = format!("{}; {} bytes passed over", lost.reason, end - lost.from);
    rows.unreadable(NO_TIME, None, &text);
}

/// The byte order of numbers.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Order {
    #[default]
    Little,
    Big,
}

impl Order {
    /// The number at an offset; bytes that are not there read as 0.
    pub fn u16(self, bytes: &[u8], at: usize) -> u16 {
        let word = array(bytes, at);
        match self {
            Order::Little => u16::from_le_bytes(word),
            Order::Big => u16::from_be_bytes(word),
        }
    }

    pub fn u32(self, bytes: &[u8], at: usize) -> u32 {
        let word = array(bytes, at);
        match self {
            Order::Little => u32::from_le_bytes(word),
            Order::Big => u32::from_be_bytes(word),
        }
    }

    pub fn u64(self, bytes: &[u8], at: usize) -> u64 {
        let word = array(bytes, at);
        match self {
            Order::Little => u64::from_le_bytes(word),
            Order::Big => u64::from_be_bytes(word),
        }
    }
}

fn array<const N: usize>(bytes: &[u8], at: usize) -> [u8; N] {
    let word = bytes.get(at..).and_then(<[u8]>::first_chunk);
    word.copied().unwrap_or([0; N])
}
