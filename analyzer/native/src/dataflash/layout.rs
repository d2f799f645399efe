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
    /// Kept as it is, in the table of this number.
    Kept(usize),
    Other,
    /// Named as one that is wanted, but its columns cannot be understood.
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

/// What a log says of a type of its records.
pub struct Description<'a> {
    pub of: u8,
    /// Bytes with the header.
    pub length: usize,
    pub name: &'a [u8],
    pub format: &'a [u8],
    /// Names, with commas between them.
    pub columns: &'a [u8],
}

impl<'a> Description<'a> {
    /// Reads the 86 bytes of a description behind its header.
    pub fn read(body: &'a [u8]) -> Self {
        Description {
            of: body[0],
            length: usize::from(body[1]),
            name: text(&body[NAME]),
            format: text(&body[FORMAT]),
            columns: text(&body[COLUMNS]),
        }
    }

    /// Whether records of this type hold frames, and where.
    pub fn frame(&self) -> Kind {
        let fd = match self.name {
            b"CANF" => false,
            b"CAFD" => true,
            _ => return Kind::Other,
        };
        match self.frame_fields(fd) {
            Some(fields) => Kind::Frame(fields),
            None => Kind::Unclear("columns of a CAN record not understood".into()),
        }
    }

    /// The names of the columns and where they stand in a record; `None` unless that is all of it.
    pub fn fields(&self) -> Option<Vec<(&'a [u8], Range<usize>)>> {
        let mut fields = vec![];
        let mut end = HEADER;
        for (name, character) in self.columns.split(|byte| *byte == b',').zip(self.format) {
            let start = end;
            end += width(*character)?;
            fields.push((name, start..end));
        }
        (end == self.length && fields.len() == self.format.len()).then_some(fields)
    }

    fn frame_fields(&self, fd: bool) -> Option<Fields> {
        let columns = self.fields()?;
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
            fd,
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
