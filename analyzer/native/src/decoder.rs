//! The table of a type, whole: payloads unpacked by a plan, and what the profile makes of their fields, as a description
//! that was compiled once.
#![forbid(unsafe_code)]

pub mod length;
pub mod make;
pub mod number;
pub mod packet;
pub mod unwrap;
mod words;

use crate::bits::{Span, BAD_TAG, DIRTY};
use crate::frames::NO_TIME;
use crate::groups::{Group, REQUEST};
use crate::plan::{Kind, Plan};
use crate::unpack::column::{Bitmap, Column, Data};
use crate::unpack::{unpack, Rows, Unpacked};
use length::Length;
use make::Make;
use packet::Wrap;

/// A type or packet with its meaning.
#[derive(Clone, Debug)]
pub struct Decoder {
    pub plan: Plan,
    pub length: Length,
    pub makes: Vec<Make>,
    /// Of a packet: the places of its numbers of several bytes (first byte, bytes), and its counters that wrap.
    pub numbers: Vec<(usize, usize)>,
    pub wraps: Vec<Wrap>,
}

impl Decoder {
    pub fn new(plan: Plan) -> Decoder {
        Decoder {
            plan,
            length: Length::Never,
            makes: vec![],
            numbers: vec![],
            wraps: vec![],
        }
    }

    /// The table of a group of transfers; the batch begins with transfer `first` of the capture. In front of the columns
    /// of [`Decoder::rows`]: transfer, t, bus, src, dst of a service, trusted, `bits_left`, `pad_nonzero`, `bad_tag`,
    /// layout.
    pub fn table(&self, group: &Group, first: u64) -> Vec<Column> {
        let fd: Vec<u8> = group.gather(&group.transfers.fd);
        let (codes, found) = self
            .length
            .unpack(&self.plan, &group.spans(), &fd, &group.transfers.payload);
        let mut out = context(group, first);
        let flagged = |flag: u8| bits(&found.dirty, |flags| flags & flag != 0);
        out.push(cells(&found.left, |left| left.to_le_bytes()));
        out.extend([flagged(DIRTY), flagged(BAD_TAG), bytes(codes)]);
        out.extend(self.columns(found));
        out
    }

    /// What is made of bytes at `spans`, by a layout code each; see [`Rows`].
    pub fn rows(&self, spans: &[Span], layouts: &[u8], payload: &[u8]) -> Vec<Column> {
        self.columns(unpack(&self.plan, Rows { spans, layouts }, payload))
    }

    fn columns(&self, found: Unpacked) -> Vec<Column> {
        let Data::Struct(mut columns) = found.root.data else {
            return vec![];
        };
        let (Kind::Struct(fields) | Kind::Union { members: fields, .. }) = &self.plan.root.kind else {
            return vec![];
        };
        let mut out = Vec::with_capacity(self.makes.len());
        let mut places = Vec::with_capacity(self.makes.len());
        for make in &self.makes {
            places.push(out.len());
            make.run(fields, &columns, &mut out);
        }
        for (make, place) in self.makes.iter().zip(places) {
            if let Some(column) = make.show(fields, &mut columns) {
                out[place] = Some(column);
            }
        }
        out.into_iter().flatten().collect()
    }
}

/// What stands in front of the fields of a message.
fn context(group: &Group, first: u64) -> Vec<Column> {
    let mut out = carried(group, first);
    if group.kind >= REQUEST {
        out.insert(out.len() - 1, bytes(group.gather(&group.transfers.dst)));
    }
    out
}

/// What is repeated of it for every packet: transfer, t, bus, src, trusted.
fn carried(group: &Group, first: u64) -> Vec<Column> {
    let of = &group.transfers;
    let number = |&row: &u32| (first + u64::from(row)).to_le_bytes();
    let t = group.gather(&of.t);
    let validity = t.contains(&NO_TIME).then(|| Bitmap::map(&t, |&t| t != NO_TIME));
    let starts = cells(&t, |t| t.to_le_bytes());
    vec![
        cells(&group.rows, number),
        Column::filled(t.len(), validity, starts.data),
        bytes(group.gather(&of.bus)),
        bytes(group.gather(&of.src)),
        bits(&group.trusted(), |ok| ok != 0),
    ]
}

fn cells<T, const W: usize>(cells: &[T], bytes: impl Fn(&T) -> [u8; W]) -> Column {
    let values = cells.iter().map(bytes).collect::<Vec<_>>().into_flattened();
    Column::filled(cells.len(), None, Data::Scalar { width: W, values })
}

fn bytes(values: Vec<u8>) -> Column {
    Column::filled(values.len(), None, Data::Scalar { width: 1, values })
}

fn bits(cells: &[u8], bit: impl Fn(u8) -> bool) -> Column {
    Column::filled(cells.len(), None, Data::Bool(Bitmap::map(cells, |&cell| bit(cell))))
}
