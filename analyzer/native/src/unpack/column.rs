//! Columns that grow a row at a time and end as Arrow buffers.
#![forbid(unsafe_code)]

use crate::plan::{Kind, Node};

/// Bits in Arrow's order: the first is the lowest of byte 0.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Bitmap {
    len: usize,
    bytes: Vec<u8>,
}

impl Bitmap {
    /// One bit a row.
    pub fn of(len: usize, bit: impl Fn(usize) -> bool) -> Bitmap {
        let byte = |from: usize| (0..8).fold(0, |bits, at| bits | u8::from(from + at < len && bit(from + at)) << at);
        let bytes = (0..len).step_by(8).map(byte).collect();
        Bitmap { len, bytes }
    }

    /// One bit a cell.
    pub fn map<T>(cells: &[T], bit: impl Fn(&T) -> bool) -> Bitmap {
        // Eight at a time, so that no bit asks whether there is a next one.
        let (eights, rest) = cells.as_chunks::<8>();
        let byte = |some: &[T; 8]| (0..8).fold(0, |bits, at| bits | u8::from(bit(&some[at])) << at);
        let mut bytes = Vec::with_capacity(cells.len().div_ceil(8));
        bytes.extend(eights.iter().map(byte));
        if !rest.is_empty() {
            bytes.push(
                (0..)
                    .zip(rest)
                    .fold(0, |bits, (at, cell)| bits | u8::from(bit(cell)) << at),
            );
        }
        Bitmap {
            len: cells.len(),
            bytes,
        }
    }

    pub fn len(&self) -> usize {
        self.len
    }

    pub fn is_empty(&self) -> bool {
        self.len == 0
    }

    /// Clear for a bit that is not there.
    #[inline]
    pub fn get(&self, at: usize) -> bool {
        self.bytes.get(at / 8).is_some_and(|byte| byte >> (at % 8) & 1 != 0)
    }

    fn ones(len: usize) -> Bitmap {
        let mut bitmap = Bitmap {
            len,
            bytes: vec![0xFF; len.div_ceil(8)],
        };
        bitmap.truncate(len);
        bitmap
    }

    #[inline]
    pub fn push(&mut self, bit: bool) {
        let bit = u8::from(bit);
        match self.bytes.last_mut() {
            Some(last) if !self.len.is_multiple_of(8) => *last |= bit << (self.len % 8),
            _ => self.bytes.push(bit),
        }
        self.len += 1;
    }

    fn truncate(&mut self, len: usize) {
        self.len = len;
        self.bytes.truncate(len.div_ceil(8));
        if let (Some(last), over @ 1..) = (self.bytes.last_mut(), len % 8) {
            *last &= !(0xFF << over);
        }
    }
}

/// One node of a plan over all rows. Its cells exist also below a null parent, as Arrow wants it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Column {
    len: usize,
    /// Only once a cell is null.
    validity: Option<Bitmap>,
    pub data: Data,
}

#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Data {
    /// A void: no column.
    Void,
    Bool(Bitmap),
    /// Little-endian cells of `width` bytes.
    Scalar {
        width: usize,
        values: Vec<u8>,
    },
    /// Array or list. Row `i` owns the child's `offsets[i]..offsets[i + 1]`.
    List {
        offsets: Vec<i32>,
        child: Box<Column>,
    },
    /// Struct or union: one child a field, voids included.
    Struct(Vec<Column>),
    /// Texts, one behind the other. Row `i` is `bytes[offsets[i]..offsets[i + 1]]`. No plan has any.
    Text {
        offsets: Vec<i32>,
        bytes: Vec<u8>,
    },
}

/// A column's own buffers; those of its children follow.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Flat {
    pub len: usize,
    /// Arrow bitmap, when some cell is null.
    pub validity: Option<Vec<u8>>,
    /// Values, value bitmap or offsets (i32), little-endian; none for a struct or union.
    pub buffer: Option<Vec<u8>>,
    /// The letters of texts, of which `buffer` then has the offsets.
    pub letters: Option<Vec<u8>>,
}

impl Column {
    /// An empty column for `node`, with room for `rows` where that can be known.
    pub fn new(node: &Node, rows: usize) -> Column {
        let many = |nodes: &[Node]| Data::Struct(nodes.iter().map(|n| Column::new(n, rows)).collect());
        let data = match &node.kind {
            Kind::Void { .. } => Data::Void,
            Kind::Bool => Data::Bool(Bitmap::default()),
            Kind::Scalar { .. } => Data::Scalar {
                width: node.width(),
                values: Vec::with_capacity(node.width() * rows),
            },
            Kind::Array { element, .. } | Kind::List { element, .. } => {
                let mut offsets = Vec::with_capacity(rows + 1);
                offsets.push(0);
                let child = Box::new(Column::new(element, 0));
                Data::List { offsets, child }
            }
            Kind::Struct(fields) => many(fields),
            Kind::Union { members, .. } => many(members),
        };
        Column {
            len: 0,
            validity: None,
            data,
        }
    }

    /// A column whose cells are there already.
    pub fn filled(len: usize, validity: Option<Bitmap>, data: Data) -> Column {
        Column { len, validity, data }
    }

    pub fn validity(&self) -> Option<&Bitmap> {
        self.validity.as_ref()
    }

    #[inline]
    pub fn is_valid(&self, row: usize) -> bool {
        self.validity.as_ref().is_none_or(|valid| valid.get(row))
    }

    pub fn len(&self) -> usize {
        self.len
    }

    /// The length as the end of a list's row; whoever fills a list keeps it below the limit.
    pub fn end(&self) -> i32 {
        i32::try_from(self.len).unwrap_or(i32::MAX)
    }

    pub fn is_empty(&self) -> bool {
        self.len == 0
    }

    /// Counts a row whose cell the caller has written or writes next.
    #[inline]
    pub fn mark(&mut self, valid: bool) {
        if !valid && self.validity.is_none() {
            self.validity = Some(Bitmap::ones(self.len));
        }
        if let Some(validity) = &mut self.validity {
            validity.push(valid);
        }
        self.len += 1;
    }

    /// Counts `rows` valid rows whose cells the caller has written.
    pub fn mark_all(&mut self, rows: usize) {
        match self.validity {
            Some(_) => (0..rows).for_each(|_| self.mark(true)),
            None => self.len += rows,
        }
    }

    /// Appends a null, here and below.
    pub fn null(&mut self) {
        match &mut self.data {
            Data::Void => return,
            Data::Bool(bits) => bits.push(false),
            Data::Scalar { width, values } => values.resize(values.len() + *width, 0),
            Data::List { offsets, child } => offsets.push(child.end()),
            Data::Struct(children) => children.iter_mut().for_each(Column::null),
            Data::Text { offsets, .. } => offsets.extend(offsets.last().copied()),
        }
        self.mark(false);
    }

    /// Forgets the rows from `len` on.
    pub fn truncate(&mut self, len: usize) {
        if len >= self.len {
            return;
        }
        self.len = len;
        if let Some(validity) = &mut self.validity {
            validity.truncate(len);
        }
        match &mut self.data {
            Data::Void => {}
            Data::Bool(bits) => bits.truncate(len),
            Data::Scalar { width, values } => values.truncate(*width * len),
            Data::List { offsets, child } => {
                offsets.truncate(len + 1);
                child.truncate(offsets.last().map_or(0, |&end| end.unsigned_abs() as usize));
            }
            Data::Struct(children) => children.iter_mut().for_each(|c| c.truncate(len)),
            Data::Text { offsets, bytes } => {
                offsets.truncate(len + 1);
                bytes.truncate(offsets.last().map_or(0, |&end| end.unsigned_abs() as usize));
            }
        }
    }

    /// The buffers in the order of the plan's tokens, voids left out.
    pub fn flatten(self) -> Vec<Flat> {
        let mut out = vec![];
        self.flatten_into(&mut out);
        out
    }

    fn flatten_into(self, out: &mut Vec<Flat>) {
        let (len, all) = (self.len, Bitmap::ones(self.len));
        // A null that was taken back leaves a bitmap without a null.
        let validity = self.validity.filter(|v| *v != all).map(|v| v.bytes);
        let mut letters = None;
        let (buffer, children) = match self.data {
            Data::Void => return,
            Data::Bool(bits) => (Some(bits.bytes), vec![]),
            Data::Scalar { values, .. } => (Some(values), vec![]),
            Data::List { offsets, child } => (Some(little_endian(&offsets)), vec![*child]),
            Data::Struct(children) => (None, children),
            Data::Text { offsets, bytes } => {
                letters = Some(bytes);
                (Some(little_endian(&offsets)), vec![])
            }
        };
        out.push(Flat {
            len,
            validity,
            buffer,
            letters,
        });
        for child in children {
            child.flatten_into(out);
        }
    }
}

fn little_endian(offsets: &[i32]) -> Vec<u8> {
    let mut out = vec![0; offsets.len() * 4];
    for (to, from) in out.as_chunks_mut().0.iter_mut().zip(offsets) {
        *to = from.to_le_bytes();
    }
    out
}
