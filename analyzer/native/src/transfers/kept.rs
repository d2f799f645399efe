//! Transfers that wait until somebody has decided whether they are any, one by one: most sessions have one or two.
#![forbid(unsafe_code)]

use super::{Row, Sink};

/// A row with frames and payload of its own.
#[derive(Clone, Debug)]
pub struct KeptRow {
    row: Row<'static>,
    frames: Box<[u64]>,
    payload: Box<[u8]>,
}

impl KeptRow {
    pub fn of(row: &Row<'_>) -> Self {
        KeptRow {
            row: row.with(&[], &[]),
            frames: row.frames.into(),
            payload: row.payload.into(),
        }
    }

    pub fn row(&self) -> Row<'_> {
        self.row.with(&self.frames, &self.payload)
    }
}

impl Row<'_> {
    /// The same with other frames and another payload.
    fn with<'a>(&self, frames: &'a [u64], payload: &'a [u8]) -> Row<'a> {
        let &Row {
            id,
            bus,
            t,
            t_end,
            priority,
            transfer_id,
            status,
            crc_wire,
            crc_here,
            step,
            gap,
            anomaly,
            fd,
            known,
            asked,
            ..
        } = self;
        Row {
            id,
            bus,
            t,
            t_end,
            priority,
            transfer_id,
            status,
            crc_wire,
            crc_here,
            step,
            gap,
            anomaly,
            fd,
            known,
            asked,
            frames,
            payload,
        }
    }
}

impl Sink for Vec<KeptRow> {
    fn push(&mut self, row: &Row<'_>) {
        if self.len() == self.capacity() {
            self.reserve_exact(self.len().max(1));
        }
        self.push(KeptRow::of(row));
    }
}
