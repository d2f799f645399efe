//! Transfers that wait until somebody has decided whether they are any: most sessions have one or two.
#![forbid(unsafe_code)]

use super::{Row, Sink};

/// Rows, and the frames and payloads of all of them.
#[derive(Clone, Debug, Default)]
pub struct KeptRows {
    rows: Vec<Row<'static>>,
    /// Where the frames and the payload of each end.
    ends: Vec<(usize, usize)>,
    frames: Vec<u64>,
    payload: Vec<u8>,
}

impl KeptRows {
    pub fn len(&self) -> usize {
        self.rows.len()
    }

    pub fn is_empty(&self) -> bool {
        self.rows.is_empty()
    }

    /// Forgets all of them, and keeps the room.
    pub fn clear(&mut self) {
        self.rows.clear();
        self.ends.clear();
        self.frames.clear();
        self.payload.clear();
    }

    pub fn rows(&self) -> impl Iterator<Item = Row<'_>> {
        let mut from = (0, 0);
        self.rows.iter().zip(&self.ends).map(move |(row, &end)| {
            let begin = std::mem::replace(&mut from, end);
            Row {
                frames: &self.frames[begin.0..end.0],
                payload: &self.payload[begin.1..end.1],
                ..*row
            }
        })
    }
}

impl Row<'_> {
    /// The same without frames and payload, which are somebody else's.
    fn alone(&self) -> Row<'static> {
        Row {
            id: self.id,
            bus: self.bus,
            t: self.t,
            t_end: self.t_end,
            priority: self.priority,
            transfer_id: self.transfer_id,
            status: self.status,
            crc_wire: self.crc_wire,
            crc_here: self.crc_here,
            step: self.step,
            gap: self.gap,
            anomaly: self.anomaly,
            fd: self.fd,
            known: self.known,
            asked: self.asked,
            frames: &[],
            payload: &[],
        }
    }
}

impl Sink for KeptRows {
    fn push(&mut self, row: &Row<'_>) {
        if self.rows.len() == self.rows.capacity() {
            self.rows.reserve_exact(self.rows.len().max(1));
        }
        self.rows.push(row.alone());
        self.frames.extend_from_slice(row.frames);
        self.payload.extend_from_slice(row.payload);
        self.ends.push((self.frames.len(), self.payload.len()));
    }
}
