//! The tables of a batch joined: each transfer with its message and its packets.

#![forbid(unsafe_code)]

pub mod node;

use std::ops::Range;
use std::sync::Arc;

use super::column::Column;
use node::{At, Node};

/// What is written of a row of a table: a template for each place that asks for one.
pub type Template = Vec<Option<Node>>;

/// Rows of one message or packet table. Its first column says of which transfer they are, by number; the second one of
/// packets where they begin.
pub struct Part {
    pub template: Arc<Template>,
    pub table: Column,
    pub packets: bool,
}

/// A row of a part.
#[derive(Clone, Copy)]
struct Row {
    part: u32,
    row: u32,
}

/// The transfers of a batch, what they carry, and the words of this batch.
pub struct Sheet {
    pub transfers: Column,
    pub words: Vec<Vec<Vec<u8>>>,
    parts: Vec<Part>,
    messages: Vec<Option<Row>>,
    /// Packets in the order of their bytes, those of a transfer from one end to the next.
    packets: Vec<Row>,
    ends: Vec<u32>,
}

impl Sheet {
    /// Joins the tables; `first` is the number of the first transfer.
    pub fn new(transfers: Column, parts: Vec<Part>, words: Vec<Vec<Vec<u8>>>, first: u64) -> Sheet {
        let mut messages = vec![None; transfers.len];
        let mut found: Vec<(usize, i128, Row)> = vec![];
        for (part, number) in parts.iter().zip(0..) {
            let Some(of) = part.table.children.first() else {
                continue;
            };
            let offsets = part.table.children.get(1);
            for row in 0..part.table.len {
                let transfer = usize::try_from(of.whole(row) - i128::from(first)).unwrap_or(usize::MAX);
                let at = Row {
                    part: number,
                    row: row as u32,
                };
                if part.packets {
                    found.push((transfer, offsets.map_or(0, |offsets| offsets.whole(row)), at));
                } else if let Some(message) = messages.get_mut(transfer) {
                    *message = Some(at);
                }
            }
        }
        found.sort_by_key(|&(transfer, offset, _)| (transfer, offset));
        let mut ends = vec![0; transfers.len + 1];
        for (transfer, _, _) in &found {
            if let Some(end) = ends.get_mut(transfer + 1) {
                *end += 1;
            }
        }
        for k in 1..ends.len() {
            ends[k] += ends[k - 1];
        }
        let packets = found.into_iter().map(|(_, _, at)| at).collect();
        Sheet {
            transfers,
            words,
            parts,
            messages,
            packets,
            ends,
        }
    }

    /// Writes a template of a transfer; nothing for one that is not there.
    pub fn write(&self, out: &mut Vec<u8>, template: &Node, row: usize) {
        if row < self.transfers.len {
            template.write(out, &At::of(self, row, &self.transfers, row));
        }
    }

    /// The message of a transfer, and its template for a place.
    pub(super) fn message<'a>(&'a self, at: &At<'a>, slot: usize) -> Option<(&'a Node, At<'a>)> {
        self.found(at.transfer, self.messages[at.transfer]?, slot)
    }

    /// The packets of a transfer that have a template for a place.
    pub(super) fn packets<'a>(&'a self, at: &At<'a>, slot: usize) -> impl Iterator<Item = (&'a Node, At<'a>)> {
        let transfer = at.transfer;
        self.packets[self.span(transfer)]
            .iter()
            .filter_map(move |&row| self.found(transfer, row, slot))
    }

    fn found(&self, transfer: usize, Row { part, row }: Row, slot: usize) -> Option<(&Node, At<'_>)> {
        let part = &self.parts[part as usize];
        let node = part.template.get(slot)?.as_ref()?;
        Some((node, At::of(self, transfer, &part.table, row as usize)))
    }

    fn span(&self, transfer: usize) -> Range<usize> {
        self.ends[transfer] as usize..self.ends[transfer + 1] as usize
    }
}
