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
            row: row.alone(),
            frames: row.frames.into(),
            payload: row.payload.into(),
        }
    }

    pub fn row(&self) -> Row<'_> {
        Row {
            frames: &self.frames,
            payload: &self.payload,
            ..self.row
        }
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

impl Sink for Vec<KeptRow> {
    fn push(&mut self, row: &Row<'_>) {
        if self.len() == self.capacity() {
            self.reserve_exact(self.len().max(1));
        }
        self.push(KeptRow::of(row));
    }
}
