//! The tables of packets: what is known of each, its numbers turned round where its sender has the other byte order, its
//! fields, and its counters continued.
#![forbid(unsafe_code)]

use super::number::{number, Linear, Number};
use super::unwrap::Unwrapper;
use super::{bits, bytes, carried, cells, Decoder};
use crate::bits::spans;
use crate::packets::cut::Cut;
use crate::plan::{Kind, Node};
use crate::unpack::column::{Bitmap, Column, Data};
use crate::unpack::{unpack, Rows};

/// `reason` in words, by its number.
const REASONS: [&str; 3] = ["no header", "unknown frame id", "truncated"];
/// The byte order of a sender as a part of its counters: node IDs leave this bit free.
const TURNED: u32 = 1 << 7;

/// A counter that wraps: its field, and the byte of a packet that says whose it is.
#[derive(Clone, Debug, PartialEq)]
pub struct Wrap {
    pub field: usize,
    pub bits: u32,
    pub unit_at: usize,
    pub physical: Option<Linear>,
}

/// Which packets are to be read big-endian, and of which that is decided; a byte a row.
#[derive(Clone, Copy, Debug)]
pub struct Order<'a> {
    pub big: &'a [u8],
    pub decided: &'a [u8],
}

/// What stands in front of the fields: transfer, t, bus, src, trusted, offset, `packet_ok`, `header_ok`, `length_ok`,
/// complete, `checksum_ok`, `checksum_end`, `count_step`, `count_step_id`; of bytes that are no packet reason and data
/// behind offset.
pub fn context(cut: &Cut) -> Vec<Column> {
    let mut out = carried(&cut.messages(), cut.first);
    out.push(cells(&cut.found.offset, |offset| offset.to_le_bytes()));
    if cut.known.is_none() {
        let reasons = cut
            .found
            .reason
            .iter()
            .map(|&reason| REASONS.get(usize::from(reason)).copied());
        let words: Vec<&str> = reasons.map(Option::unwrap_or_default).collect();
        let ends = words.iter().scan(0, |end, word| {
            *end += word.len() as i32;
            Some(*end)
        });
        let offsets = std::iter::once(0).chain(ends).collect();
        out.push(text(offsets, words.concat().into_bytes()));
        out.push(text(cut.bounds.clone(), cut.data.clone()));
        return out;
    }
    let (found, steps) = (&cut.found, &cut.steps);
    for flags in [
        &cut.ok(),
        &found.header_ok,
        &found.length_ok,
        &found.complete,
        &found.checksum_ok,
    ] {
        out.push(bits(flags, |flag| flag != 0));
    }
    out.push(masked(&found.checksum_end, &found.checksum_end));
    out.push(masked(&steps.step, &steps.step_valid));
    out.push(masked(&steps.step_id, &steps.step_id_valid));
    out
}

fn text(offsets: Vec<i32>, bytes: Vec<u8>) -> Column {
    Column::filled(offsets.len() - 1, None, Data::Text { offsets, bytes })
}

/// Cells that are null where `valid` is 0.
fn masked(values: &[u8], valid: &[u8]) -> Column {
    let validity = valid.contains(&0).then(|| Bitmap::map(valid, |&valid| valid != 0));
    Column::filled(values.len(), validity, bytes(values.to_vec()).data)
}

impl Decoder {
    /// The table of packets; `counters` has an entry for each counter that wraps.
    pub fn packets(&self, cut: &Cut, order: Option<Order<'_>>, counters: &mut Vec<Unwrapper>) -> Vec<Column> {
        let mut out = context(cut);
        if let Some(order) = order {
            out.extend([order.big, order.decided].map(|flags| bits(flags, |flag| flag != 0)));
        }
        let big = order.map_or(&[][..], |order| order.big);
        let turned = big
            .contains(&1)
            .then(|| self.turned(cut, |row| big.get(row) == Some(&1)));
        let data = turned.as_deref().unwrap_or(&cut.data);
        let spans = spans(&cut.bounds, None);
        let found = unpack(
            &self.plan,
            Rows {
                spans: &spans,
                layouts: &[],
            },
            data,
        );
        counters.resize_with(self.wraps.len(), Unwrapper::default);
        let continued: Vec<Column> = self
            .wraps
            .iter()
            .zip(counters)
            .filter_map(|(wrap, counter)| {
                let (Kind::Struct(fields), Data::Struct(columns)) = (&self.plan.root.kind, &found.root.data) else {
                    return None;
                };
                let (node, column) = (fields.get(wrap.field)?, columns.get(wrap.field)?);
                Some(wrap.column(cut, big, (node, &column.data), counter))
            })
            .collect();
        out.extend(self.columns(found));
        out.extend(continued);
        out
    }

    /// The columns of fields alone, all packets read in one byte order.
    pub fn packet_fields(&self, cut: &Cut, big: bool) -> Vec<Column> {
        let spans = spans(&cut.bounds, None);
        let data = if big {
            self.turned(cut, |_| true)
        } else {
            cut.data.clone()
        };
        self.rows(&spans, &[], &data)
    }

    /// The bytes of packets with every number turned round; one that a packet is too short for stays as it is.
    fn turned(&self, cut: &Cut, turns: impl Fn(usize) -> bool) -> Vec<u8> {
        let mut data = cut.data.clone();
        let spans = spans(&cut.bounds, None);
        for span in spans
            .iter()
            .enumerate()
            .filter_map(|(row, span)| turns(row).then_some(span))
        {
            let packet = &mut data[span.start..span.end];
            for &(first, size) in &self.numbers {
                if let Some(number) = packet.get_mut(first..first + size) {
                    number.reverse();
                }
            }
        }
        data
    }
}

impl Wrap {
    /// The field continued per node, unit and byte order; null for a packet that cannot be relied on.
    fn column(&self, cut: &Cut, big: &[u8], field: (&Node, &Data), counter: &mut Unwrapper) -> Column {
        let (sound, senders) = (cut.sound(), cut.messages().senders());
        let good: Vec<usize> = (0..cut.len()).filter(|&row| sound[row] != 0).collect();
        let whose = |&row: &usize| {
            let unit = cut.data.get(cut.bounds[row].unsigned_abs() as usize + self.unit_at);
            let turned = if big.get(row) == Some(&1) { TURNED } else { 0 };
            (u32::from(senders[row]) | turned) << 8 | u32::from(unit.copied().unwrap_or(0))
        };
        let raw = |&row: &usize| match number(field.0, field.1, row) {
            Some(Number::Whole(value)) => value as u64,
            _ => 0,
        };
        let (counters, values): (Vec<u32>, Vec<u64>) = good.iter().map(|row| (whose(row), raw(row))).unzip();
        let mut total = vec![0; cut.len()];
        for (&row, value) in good.iter().zip(counter.follow(self.bits, &counters, &values)) {
            total[row] = value;
        }
        let sums = cells(&total, |value| value.to_le_bytes());
        let validity = sound.contains(&0).then(|| Bitmap::map(&sound, |&sound| sound != 0));
        let data = match self.physical {
            None => sums.data,
            Some(linear) => {
                let values = super::number::floats(&Node::unsigned(64), &sums.data, |raw| linear.of(raw));
                Data::Scalar {
                    width: 8,
                    values: values.unwrap_or_default(),
                }
            }
        };
        Column::filled(cut.len(), validity, data)
    }
}
