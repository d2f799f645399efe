//! Where the fields of a record stand, by the names that the log itself gives its columns.
#![forbid(unsafe_code)]

use std::ops::Range;

use crate::frames::MAX_DATA;
use crate::line::Reason;

/// Bytes of a record before its first field.
const HEADER: usize = 3;
/// Fields of a description: type, length, name, format characters, column names.
const NAME: Range<usize> = 2..6;
const FORMAT: Range<usize> = 6..22;
const COLUMNS: Range<usize> = 22..86;

/// One type of record.
#[derive(Clone, Debug)]
pub struct Layout {
    /// Bytes with the header.
    pub length: usize,
    pub kind: Kind,
}

#[derive(Clone, Debug)]
pub enum Kind {
    Frame(Fields),
    Other,
    /// Named as one with a frame, but its columns cannot be understood.
    Unclear(Reason),
}

/// Offsets in a record with a frame.
#[derive(Clone, Debug)]
pub struct Fields {
    pub time: usize,
    pub bus: usize,
    pub id: usize,
    pub code: usize,
    /// The data columns in their order, 64 bytes at most.
    pub data: Vec<Range<usize>>,
    pub fd: bool,
}

impl Layout {
    /// Reads the 86 bytes of a description behind its header: the type, and what it looks like.
    pub fn read(body: &[u8]) -> (u8, Layout) {
        let length = usize::from(body[1]);
        let kind = match text(&body[NAME]) {
            name @ (b"CANF" | b"CAFD") => {
                let fields = Fields::read(text(&body[FORMAT]), text(&body[COLUMNS]), length);
                match fields {
                    Some(fields) => Kind::Frame(Fields {
                        fd: name == b"CAFD",
                        ..fields
                    }),
                    None => Kind::Unclear("columns of a CAN record not understood".into()),
                }
            }
            _ => Kind::Other,
        };
        (body[0], Layout { length, kind })
    }
}

impl Fields {
    fn read(format: &[u8], names: &[u8], length: usize) -> Option<Fields> {
        let mut columns: Vec<(&[u8], Range<usize>)> = vec![];
        let mut end = HEADER;
        for (name, character) in names.split(|byte| *byte == b',').zip(format) {
            let start = end;
            end += width(*character)?;
            columns.push((name, start..end));
        }
        if end != length || columns.len() != format.len() {
            return None;
        }
        let find = |wanted: &[u8]| columns.iter().find(|(name, _)| *name == wanted).map(|(_, range)| range);
        let field = |wanted: &[u8], width| {
            find(wanted)
                .filter(|range| range.len() == width)
                .map(|range| range.start)
        };
        let data: Vec<Range<usize>> = (b'0'..=b'9')
            .map_while(|digit| find(&[b'B', digit]).or_else(|| find(&[b'D', digit])).cloned())
            .collect();
        let held: usize = data.iter().map(Range::len).sum();
        Some(Fields {
            time: field(b"TimeUS", 8)?,
            bus: field(b"Bus", 1)?,
            id: field(b"Id", 4)?,
            code: field(b"DLC", 1)?,
            data: (1..=MAX_DATA).contains(&held).then_some(data)?,
            fd: false,
        })
    }
}

/// Bytes of a field by its format character.
fn width(character: u8) -> Option<usize> {
    Some(match character {
        b'b' | b'B' | b'M' => 1,
        b'h' | b'H' | b'c' | b'C' | b'g' => 2,
        b'i' | b'I' | b'e' | b'E' | b'f' | b'L' | b'n' => 4,
        b'q' | b'Q' | b'd' => 8,
        b'N' => 16,
        b'a' | b'Z' => 64,
        _ => return None,
    })
}

/// Characters up to the first zero byte.
fn text(bytes: &[u8]) -> &[u8] {
    let end = bytes.iter().position(|byte| *byte == 0).unwrap_or(bytes.len());
    &bytes[..end]
}
