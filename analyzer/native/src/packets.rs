//! Packets inside a byte array that a message carries: where each lies, and whether header, length and checksum hold.
#![forbid(unsafe_code)]

mod counter;
pub mod cut;

use crate::bits::{inside, Span};
pub use counter::{Carrier, Counter, Steps};

/// One kind of packet.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Spec {
    pub id: u8,
    /// All bytes, header and checksum counted. The last is the checksum.
    pub length: u16,
    /// The checksum is the low byte of the sum of bytes 1 to one of these; the preferred first. None: no checksum.
    pub checksum_ends: Vec<u16>,
}

/// Packets that begin with the same bytes. Places are bytes of the packet, from 0.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Family {
    /// An empty header is never found.
    pub header: Vec<u8>,
    pub id_at: usize,
    pub count_at: usize,
    pub unit_at: usize,
    /// The length field counts the whole packet.
    pub length_at: usize,
    pub packets: Vec<Spec>,
}

/// `family`: no header of any family.
pub const NO_FAMILY: u8 = u8::MAX;
/// `spec`: no packet that the family knows.
pub const NO_SPEC: i16 = -1;
/// `reason`: a whole packet that its family knows.
pub const RECOGNIZED: u8 = u8::MAX;
/// `reason`: bytes without a header.
pub const NO_HEADER: u8 = 0;
/// `reason`: a header with an id that its family does not know.
pub const UNKNOWN_ID: u8 = 1;
/// `reason`: the data ends inside the packet. Its `spec` is known when the id is still there.
pub const TRUNCATED: u8 = 2;

/// Columns; every byte of the data belongs to exactly one row, rows are in order. `*_ok` and `complete` hold 0 or 1.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Found {
    /// Index of the span.
    pub row: Vec<u32>,
    /// First byte, from the start of the span.
    pub offset: Vec<u32>,
    /// First byte, from the start of the arena.
    pub start: Vec<i32>,
    pub len: Vec<i32>,
    pub family: Vec<u8>,
    pub spec: Vec<i16>,
    /// The header is that of the own family.
    pub header_ok: Vec<u8>,
    /// The length field holds the length of the spec.
    pub length_ok: Vec<u8>,
    pub complete: Vec<u8>,
    pub checksum_ok: Vec<u8>,
    /// Last byte (from 1) of the first sum that agrees, 0 if none does.
    pub checksum_end: Vec<u8>,
    pub reason: Vec<u8>,
}

/// What begins at one place.
struct Piece {
    len: usize,
    family: u8,
    spec: i16,
    length_ok: bool,
    /// The last byte of the sum that agrees, 0 for a packet without checksum.
    checksum: Option<u8>,
    reason: u8,
}

impl Found {
    pub fn len(&self) -> usize {
        self.row.len()
    }

    pub fn is_empty(&self) -> bool {
        self.row.is_empty()
    }

    /// The rows at some places.
    #[must_use]
    pub fn pick(&self, at: &[usize]) -> Found {
        fn some<T: Copy>(column: &[T], at: &[usize]) -> Vec<T> {
            at.iter().map(|&at| column[at]).collect()
        }
        Found {
            row: some(&self.row, at),
            offset: some(&self.offset, at),
            start: some(&self.start, at),
            len: some(&self.len, at),
            family: some(&self.family, at),
            spec: some(&self.spec, at),
            header_ok: some(&self.header_ok, at),
            length_ok: some(&self.length_ok, at),
            complete: some(&self.complete, at),
            checksum_ok: some(&self.checksum_ok, at),
            checksum_end: some(&self.checksum_end, at),
            reason: some(&self.reason, at),
        }
    }

    fn push(&mut self, row: usize, span: Span, offset: usize, own: usize, piece: &Piece) {
        self.row.push(row as u32);
        self.offset.push(offset as u32);
        self.start.push((span.start + offset) as i32);
        self.len.push(piece.len as i32);
        self.family.push(piece.family);
        self.spec.push(piece.spec);
        self.header_ok
            .push(u8::from(piece.family != NO_FAMILY && usize::from(piece.family) == own));
        self.length_ok.push(u8::from(piece.length_ok));
        self.complete.push(u8::from(piece.reason == RECOGNIZED));
        self.checksum_ok.push(u8::from(piece.checksum.is_some()));
        self.checksum_end.push(piece.checksum.unwrap_or(0));
        self.reason.push(piece.reason);
    }
}

/// Cuts the bytes of every span into packets and what is none. `own` is the family that the carrying message should
/// hold; it is tried first. Bytes without a header reach to the next header; so does a packet of unknown id, whose
/// length field proves nothing. Only the first 255 families and 32767 packets of each are looked at; the arena is
/// that of an Arrow binary column, below 2^31 bytes.
pub fn find(families: &[Family], own: usize, spans: &[Span], bytes: &[u8]) -> Found {
    let mut found = Found::default();
    for (row, &span) in inside(spans, bytes.len()).iter().enumerate() {
        let data = &bytes[span.start..span.end];
        let mut at = 0;
        while at < data.len() {
            let piece = piece(families, own, &data[at..]);
            found.push(row, span, at, own, &piece);
            at += piece.len;
        }
    }
    found
}

fn piece(families: &[Family], own: usize, data: &[u8]) -> Piece {
    let Some(index) = family_at(families, own, data) else {
        return Piece::unknown(to_next_header(families, own, data), NO_FAMILY, NO_HEADER);
    };
    let (family, number) = (&families[index], index as u8);
    let Some(&id) = data.get(family.id_at) else {
        return Piece::unknown(data.len(), number, TRUNCATED);
    };
    let known = (0..i16::MAX).zip(&family.packets).find(|(_, spec)| spec.id == id);
    let Some((spec_number, spec)) = known else {
        return Piece::unknown(to_next_header(families, own, data), number, UNKNOWN_ID);
    };
    let length = usize::from(spec.length).max(family.header.len());
    let complete = length <= data.len();
    Piece {
        len: length.min(data.len()),
        family: number,
        spec: spec_number,
        length_ok: data
            .get(family.length_at)
            .is_some_and(|&field| u16::from(field) == spec.length),
        checksum: data.get(..length).and_then(|packet| checksum(spec, packet)),
        reason: if complete { RECOGNIZED } else { TRUNCATED },
    }
}

impl Piece {
    fn unknown(len: usize, family: u8, reason: u8) -> Piece {
        Piece {
            len,
            family,
            spec: NO_SPEC,
            length_ok: false,
            checksum: None,
            reason,
        }
    }
}

fn family_at(families: &[Family], own: usize, data: &[u8]) -> Option<usize> {
    let starts = |family: &Family| !family.header.is_empty() && data.starts_with(&family.header);
    let seen = &families[..families.len().min(usize::from(NO_FAMILY))];
    match seen.get(own) {
        Some(family) if starts(family) => Some(own),
        _ => seen.iter().position(starts),
    }
}

/// Bytes from the start of `data` to the first header behind its first byte, or to the end.
fn to_next_header(families: &[Family], own: usize, data: &[u8]) -> usize {
    let next = (1..data.len()).find(|&at| family_at(families, own, &data[at..]).is_some());
    next.unwrap_or(data.len())
}

fn checksum(spec: &Spec, packet: &[u8]) -> Option<u8> {
    let agrees = |&&end: &&u16| {
        let summed = packet.get(..usize::from(end));
        let sum = summed.map(|bytes| bytes.iter().fold(0_u8, |sum, byte| sum.wrapping_add(*byte)));
        sum.is_some() && sum == packet.last().copied()
    };
    match spec.checksum_ends.iter().find(agrees) {
        Some(&end) => Some(u8::try_from(end).unwrap_or(u8::MAX)),
        None => spec.checksum_ends.is_empty().then_some(0),
    }
}
