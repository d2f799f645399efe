//! MCAP message records around messages that are encoded already, in the order of their times.
#![forbid(unsafe_code)]

use super::mcap::{index_record, Chunk, MESSAGE};

/// Bytes of a record in front of the message itself, behind its kind and length: channel, sequence, both times.
const FIXED: u64 = 2 + 4 + 8 + 8;

/// Messages of one channel and type, encoded one behind the other.
pub struct Batch<'a> {
    /// Channel ID of each message.
    pub channels: &'a [u16],
    /// Nanoseconds, not negative.
    pub times: &'a [i64],
    /// End of each message in `data`.
    pub ends: &'a [u64],
    pub data: &'a [u8],
}

impl Batch<'_> {
    /// Whether its columns fit together.
    #[must_use]
    pub fn fits(&self) -> bool {
        let rows = self.channels.len();
        self.times.len() == rows
            && self.ends.len() == rows
            && self.ends.windows(2).all(|pair| pair[0] <= pair[1])
            && self.ends.last().is_none_or(|&end| end <= self.data.len() as u64)
            && self.times.iter().all(|&t| t >= 0)
    }

    fn message(&self, row: usize) -> &[u8] {
        let start = row.checked_sub(1).map_or(0, |before| self.ends[before]);
        &self.data[start as usize..self.ends[row] as usize]
    }
}

/// Message records of batches that fit, by time, as chunks of about `limit` bytes. The first one will stand behind
/// `before` further bytes in its chunk. Messages of equal times keep their order.
#[must_use]
pub fn merged(batches: &[Batch<'_>], before: u64, limit: usize) -> Vec<Chunk> {
    let mut order = vec![];
    for (at, batch) in batches.iter().enumerate() {
        order.extend((0..batch.channels.len()).map(|row| (batch.times[row] as u64, at, row)));
    }
    order.sort_by_key(|&(time, ..)| time);
    let (mut chunks, mut open) = (vec![], Open::default());
    for (time, at, row) in order {
        open.add(time, batches[at].channels[row], batches[at].message(row));
        if open.out.len() >= limit {
            chunks.extend(open.close(if chunks.is_empty() { before } else { 0 }));
        }
    }
    chunks.extend(open.close(if chunks.is_empty() { before } else { 0 }));
    chunks
}

/// The chunk under way.
#[derive(Default)]
struct Open {
    out: Vec<u8>,
    /// Time and place of each message, by channel ID.
    indexes: Vec<Vec<u8>>,
    span: Option<(u64, u64)>,
}

impl Open {
    fn add(&mut self, time: u64, channel: u16, message: &[u8]) {
        let of = usize::from(channel);
        if self.indexes.len() <= of {
            self.indexes.resize(of + 1, vec![]);
        }
        self.indexes[of].extend_from_slice(&time.to_le_bytes());
        self.indexes[of].extend_from_slice(&(self.out.len() as u64).to_le_bytes());
        self.out.push(MESSAGE);
        self.out
            .extend_from_slice(&(FIXED + message.len() as u64).to_le_bytes());
        self.out.extend_from_slice(&channel.to_le_bytes());
        self.out.extend_from_slice(&[0; 4]); // not numbered
        self.out.extend_from_slice(&time.to_le_bytes());
        self.out.extend_from_slice(&time.to_le_bytes());
        self.out.extend_from_slice(message);
        self.span = Some((self.span.map_or(time, |(first, _)| first), time));
    }

    fn close(&mut self, before: u64) -> Option<Chunk> {
        let span = self.span.take()?;
        let indexes = self
            .indexes
            .iter_mut()
            .enumerate()
            .filter(|(_, index)| !index.is_empty());
        let indexes = indexes.map(|(id, index)| {
            let count = index.len() as u64 / 16;
            (id as u16, index_record(id as u16, index, before), count)
        });
        let indexes = indexes.collect();
        Some(Chunk {
            messages: std::mem::take(&mut self.out),
            indexes,
            span,
        })
    }
}
