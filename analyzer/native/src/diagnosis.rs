//! Why a transfer is broken, measured on the bytes around it: which frames would have to be different for its CRC to be
//! right, or which are missing. Rules give it words, and judge.
//!
//! An answer by CRC is wrong once in 65536 attempts, so attempts are few. [`index`] finds the frames of a session,
//! [`neighbours`] what is around a transfer, [`proofs`], [`tail_bits`], [`losses`] and [`misnumbered`] are the
//! causes, [`questions`] what rules ask; [`starts`] shows how a session counted, and [`counters`] whether several senders
//! did: by turns ([`interleaved`]), or one between what another one sends ([`resumed`]). [`budgets`] bounds the searches,
//! [`mistakes`] spares some.
#![forbid(unsafe_code)]

use crate::wire::crc;

pub mod budgets;
pub mod counters;
pub mod index;
pub mod interleaved;
pub mod losses;
pub mod misnumbered;
pub mod mistakes;
pub mod neighbours;
pub mod proofs;
pub mod questions;
pub mod resumed;
pub mod starts;
pub mod tail_bits;

const START: u8 = 0x80;
const END: u8 = 0x40;
const TOGGLE: u8 = 0x20;
const ID: u8 = 0x1F;
/// The bytes of a transfer's CRC, in front of its payload.
const CRC_BYTES: usize = 2;

/// What was found. Numbers that come with it are those of frames, from 0, or counts.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub enum Form {
    /// Nothing shows.
    Nothing,
    /// The surroundings are gone, or the frames too far apart.
    Gone,
    WrongBit,
    /// Two equal frames swapped, or their toggles wrong.
    Either,
    /// A frame with a wrong end bit.
    EndBit,
    StartBit,
    /// A frame with another transfer ID, or several of which nobody knows which one.
    OtherId,
    /// The frames in their right order.
    Swapped,
    /// The frames that are too many.
    Repeated,
    OtherSender,
    /// The frames that came before.
    LateCopy,
    EveryStart,
    EveryEnd,
    EveryId,
    /// Frames that came, and that the type has.
    TooMany,
    NoOrder,
    Unproven,
    /// The first place at which one is missing, from 1.
    SeveralFrom,
    /// At least so many, and the first place.
    SeveralAtLeast,
    /// The first place.
    OddFrom,
    /// So many, of so many, and the first place.
    SeveralOfFrom,
    /// The place, of so many.
    One,
    /// So many of so many.
    SeveralOf,
    SeveralFirstToo,
    /// The first place.
    LastsFrom,
    /// Of so many.
    Last,
    /// The first place, of so many.
    Lasts,
    First,
    Firsts,
    /// Of so many.
    FirstOf,
    /// So many of so many.
    FirstsOf,
    /// Bytes of a frame that should be full, tail byte included, and its number.
    Short,
    /// Inside another transfer, whose CRC is right without it.
    ForeignRight,
    Foreign,
    /// Inside another transfer, to which it belongs.
    Belongs,
    /// Inside another transfer, and nothing more is known.
    Inside,
}

/// A form and its numbers.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Cause {
    pub form: Form,
    pub numbers: Vec<u64>,
}

impl Cause {
    fn new(form: Form, numbers: &[u64]) -> Self {
        let numbers = numbers.to_vec();
        Cause { form, numbers }
    }
}

/// A frame of a session: its number, its tail byte, the bytes before that, and its time.
#[derive(Clone, Copy, Debug)]
pub struct Part<'a> {
    pub number: u64,
    pub tail: u8,
    pub body: &'a [u8],
    pub t: i64,
}

impl Part<'_> {
    fn start(&self) -> bool {
        self.tail & START != 0
    }

    fn end(&self) -> bool {
        self.tail & END != 0
    }

    fn toggle(&self) -> bool {
        self.tail & TOGGLE != 0
    }

    fn id(&self) -> u8 {
        self.tail & ID
    }

    /// The same frame, with the same tail byte: one may have been turned.
    fn is(&self, other: &Part<'_>) -> bool {
        self.number == other.number && self.tail == other.tail
    }

    /// The same bytes.
    fn like(&self, other: &Part<'_>) -> bool {
        self.tail == other.tail && self.body == other.body
    }
}

/// A type, as far as it is known: values that its CRC may start from, payload bytes if they never change.
#[derive(Clone, Debug, Default)]
pub struct Known {
    pub starts: Vec<u16>,
    pub size: Option<usize>,
}

/// That, and what the sender's transfers nearby are like: frames and bytes before the tail of the last one of the whole
/// ones, bytes before the tail of those in one frame.
#[derive(Clone, Debug)]
pub struct Expected<'k> {
    pub known: &'k Known,
    pub fd: bool,
    pub lengths: Vec<(usize, usize)>,
    pub singles: Vec<usize>,
}

impl Expected<'_> {
    /// Bytes before the tail of a full frame.
    fn room(&self) -> usize {
        if self.fd {
            63
        } else {
            7
        }
    }

    /// Frames that a transfer needs, if that never changes.
    fn frames(&self) -> Option<usize> {
        let size = self.known.size?;
        let single = size <= self.room();
        Some(if single {
            1
        } else {
            (size + CRC_BYTES).div_ceil(self.room())
        })
    }

    /// Whether these frames are a whole transfer with the right CRC, whatever their toggles.
    fn fits(&self, order: &[Part<'_>]) -> bool {
        let length: usize = order.iter().map(|part| part.body.len()).sum();
        if !order.last().is_some_and(Part::end) || length < CRC_BYTES + self.known.size.unwrap_or(0) {
            return false;
        }
        let wire = wire(order);
        self.known.starts.iter().any(|&start| ended(start, order) == wire)
    }

    fn fits_nothing(&self) -> bool {
        self.known.starts.is_empty()
    }
}

/// The CRC of a transfer as received.
fn wire(order: &[Part<'_>]) -> u16 {
    let mut bytes = order.iter().flat_map(|part| part.body).copied();
    let (low, high) = (bytes.next().unwrap_or(0), bytes.next().unwrap_or(0));
    u16::from_le_bytes([low, high])
}

/// The CRC of the payload of a transfer from a start value on.
fn ended(start: u16, order: &[Part<'_>]) -> u16 {
    let mut skip = CRC_BYTES;
    order.iter().fold(start, |value, part| {
        let front = skip.min(part.body.len());
        skip -= front;
        crc(value, &part.body[front..])
    })
}

/// Starts, ends and toggles where they belong.
fn tails_right(order: &[Part<'_>]) -> bool {
    alternate(order) && ends_right(order)
}

fn ends_right(order: &[Part<'_>]) -> bool {
    let last = order.len().saturating_sub(1);
    (0..)
        .zip(order)
        .all(|(k, part)| part.start() == (k == 0) && part.end() == (k == last))
}

/// Whether toggles begin with 0 and alternate.
fn alternate(order: &[Part<'_>]) -> bool {
    (0..).zip(order).all(|(k, part)| part.toggle() == (k & 1 == 1))
}

fn numbers(parts: &[Part<'_>]) -> Vec<u64> {
    parts.iter().map(|part| part.number).collect()
}
