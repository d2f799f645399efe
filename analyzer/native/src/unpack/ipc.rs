//! Columns as one message of Arrow's IPC format, which Arrow reads in one call however many columns there are.
//!
//! A message is a prefix, a description in the layout of flatbuffers, and the buffers one behind the other, each at a
//! multiple of 8. The description has always the same tables in front of its two lists.
#![forbid(unsafe_code)]

use super::column::{Column, Flat};

const ALIGNED: usize = 8;
/// An entry of either list: two i64.
const ENTRY: usize = 16;
/// The prefix: a mark, and how long the description is.
const PREFIX: usize = 8;
/// Where the entries of the first list begin in the description, which a list of as many as there are follows.
const ENTRIES: usize = 80;
const LIST_HEAD: usize = 8;

/// The record batch of columns that are equally long.
pub fn record_batch(columns: Vec<Column>) -> Vec<u8> {
    let rows = columns.first().map_or(0, Column::len);
    let flat: Vec<Flat> = columns.into_iter().flat_map(Column::flatten).collect();
    let lens: Vec<usize> = flat.iter().flat_map(buffers).map(<[u8]>::len).collect();
    let body = lens.iter().copied().map(padded).sum();
    let described = ENTRIES + LIST_HEAD + ENTRY * (flat.len() + lens.len());
    let mut out = Vec::with_capacity(PREFIX + described + body);
    out.extend([0xFF; 4]);
    int32(&mut out, described);
    head(&mut out, rows, body, flat.len());
    for one in &flat {
        let nulls = one.validity.as_ref().map_or(0, |valid| one.len - ones(valid));
        int64(&mut out, one.len);
        int64(&mut out, nulls);
    }
    int32(&mut out, 0);
    int32(&mut out, lens.len());
    let mut at = 0;
    for len in lens {
        int64(&mut out, at);
        int64(&mut out, len);
        at += padded(len);
    }
    // A column goes as soon as it is written.
    for one in flat {
        for buffer in buffers(&one) {
            out.extend_from_slice(buffer);
            out.resize(out.len().next_multiple_of(ALIGNED), 0);
        }
    }
    out
}

/// The description up to the entries of its first list, one for each column: how long it is, and how many are null.
fn head(out: &mut Vec<u8>, rows: usize, body: usize, columns: usize) {
    const VERSION_5: u16 = 4;
    const RECORD_BATCH: u16 = 3;
    let short = |out: &mut Vec<u8>, some: &[u16]| some.iter().for_each(|one| out.extend(one.to_le_bytes()));
    int32(out, 16); // the message is at 16
    short(out, &[12, 24, 4, 6, 16, 8]); // where its fields are: version, kind, what it is, size of the body
    int32(out, 12); // how far back that stands
    short(out, &[VERSION_5, RECORD_BATCH]);
    int64(out, body);
    int32(out, 52 - 32); // the record batch is at 52
    int32(out, 0);
    short(out, &[10, 20, 4, 12, 16, 0]); // where its fields are: rows, columns, buffers
    int32(out, 12);
    int64(out, rows);
    int32(out, ENTRIES - 4 - 64); // the lists begin with their numbers of entries
    int32(out, ENTRIES + ENTRY * columns + 4 - 68);
    int32(out, 0);
    int32(out, columns);
}

/// The buffers of a column, as many as its type has.
fn buffers(of: &Flat) -> impl Iterator<Item = &[u8]> {
    let validity = of.validity.as_deref().unwrap_or_default();
    let more = [of.buffer.as_deref(), of.letters.as_deref()];
    std::iter::once(validity).chain(more.into_iter().flatten())
}

fn ones(bits: &[u8]) -> usize {
    bits.iter().map(|byte| byte.count_ones() as usize).sum()
}

fn padded(len: usize) -> usize {
    len.next_multiple_of(ALIGNED)
}

fn int32(out: &mut Vec<u8>, number: usize) {
    out.extend((number as u32).to_le_bytes());
}

fn int64(out: &mut Vec<u8>, number: usize) {
    out.extend((number as u64).to_le_bytes());
}
