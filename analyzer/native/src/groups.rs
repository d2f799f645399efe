//! The transfers of one type and kind: what a table of messages is made from.
#![forbid(unsafe_code)]

use std::sync::Arc;

use crate::bits::{spans, Span};
use crate::transfers::{Status, Transfers};

/// Kinds of transfers, in the order of `KINDS` in `analyzer/tables.py`. An anonymous one is a message.
pub const MESSAGE: u8 = 0;
pub const REQUEST: u8 = 2;
pub const RESPONSE: u8 = 3;

/// Some rows of the transfers of a batch, in their order, all complete and of one type.
#[derive(Clone, Debug)]
pub struct Group {
    pub transfers: Arc<Transfers>,
    pub rows: Vec<u32>,
    pub kind: u8,
    pub type_id: u16,
    pub variant: u8,
}

impl Group {
    /// The groups of `rows`, which are of one type: requests and responses are two.
    pub fn of(transfers: &Arc<Transfers>, rows: Vec<u32>, (service, type_id, variant): (bool, u16, u8)) -> Vec<Group> {
        let group = |kind, rows| Group {
            transfers: Arc::clone(transfers),
            rows,
            kind,
            type_id,
            variant,
        };
        if !service {
            return vec![group(MESSAGE, rows)];
        }
        let asks = |&row: &u32| transfers.kind[row as usize] == REQUEST;
        let (requests, responses) = rows.into_iter().partition(asks);
        let both = [group(REQUEST, requests), group(RESPONSE, responses)];
        both.into_iter().filter(|group| !group.rows.is_empty()).collect()
    }

    /// The rows at these places; those that are not there are left out.
    #[must_use]
    pub fn pick(&self, places: &[u32]) -> Group {
        let rows = places
            .iter()
            .filter_map(|&place| self.rows.get(place as usize).copied());
        Group {
            rows: rows.collect(),
            ..self.clone()
        }
    }

    /// The cells of a column.
    pub fn gather<T: Copy>(&self, column: &[T]) -> Vec<T> {
        self.rows.iter().map(|&row| column[row as usize]).collect()
    }

    pub fn spans(&self) -> Vec<Span> {
        spans(&self.transfers.payload_offset, Some(&self.rows))
    }

    /// The sending nodes, bus << 8 | source.
    pub fn senders(&self) -> Vec<u16> {
        let (buses, sources) = (&self.transfers.bus, &self.transfers.src);
        let sender = |&row: &u32| u16::from(buses[row as usize]) << 8 | u16::from(sources[row as usize]);
        self.rows.iter().map(sender).collect()
    }

    /// 1 for a row whose CRC is right.
    pub fn trusted(&self) -> Vec<u8> {
        let status = &self.transfers.status;
        let ok = |&row: &u32| u8::from(status[row as usize] == Status::Ok as u8);
        self.rows.iter().map(ok).collect()
    }

    /// The nodes that have sent a row whose CRC is right, in ascending order.
    pub fn nodes(&self) -> Vec<u16> {
        let mut seen = vec![0_u64; 1 << 10];
        for (node, trusted) in self.senders().into_iter().zip(self.trusted()) {
            seen[usize::from(node >> 6)] |= u64::from(trusted) << (node & 63);
        }
        let bits = |(place, &word): (u16, &u64)| {
            (0..64)
                .filter(move |bit| word >> bit & 1 != 0)
                .map(move |bit| place << 6 | bit)
        };
        (0..).zip(&seen).filter(|(_, &word)| word != 0).flat_map(bits).collect()
    }
}
