//! The packets of one kind, cut out of the messages that carried them, with what is known of each but its fields.
#![forbid(unsafe_code)]

use std::collections::BTreeMap;
use std::sync::Arc;

use super::{Found, Steps, NO_FAMILY};
use crate::groups::Group;

/// Of which table packets are: family and packet of it, or none that the profile knows.
pub type Known = Option<(u8, i16)>;

/// Rows of one table of packets.
#[derive(Clone, Debug)]
pub struct Cut {
    pub known: Known,
    /// The messages that carried them, and the number of the first transfer of their batch.
    pub carriers: Arc<Group>,
    pub first: u64,
    /// What was found, of each packet; `row` counts those of `carriers`.
    pub found: Found,
    pub steps: Steps,
    /// Where each begins in `data`, and where the last ends.
    pub bounds: Vec<i32>,
    pub data: Vec<u8>,
}

/// The packets of each table, in the order of families and their packets, and the bytes that are none.
pub fn cut(found: &Found, steps: &Steps, data: &[u8], carriers: &Arc<Group>, first: u64) -> Vec<Cut> {
    let mut tables: BTreeMap<(bool, Known), Vec<usize>> = BTreeMap::new();
    for (at, (&family, &spec)) in found.family.iter().zip(&found.spec).enumerate() {
        let known = (spec >= 0 && family != NO_FAMILY).then_some((family, spec));
        tables.entry((known.is_none(), known)).or_default().push(at);
    }
    let rows = |((_, known), at): ((bool, Known), Vec<usize>)| Cut::of(known, &at, found, steps, data, carriers, first);
    tables.into_iter().map(rows).collect()
}

impl Cut {
    fn of(
        known: Known,
        at: &[usize],
        found: &Found,
        steps: &Steps,
        data: &[u8],
        carriers: &Arc<Group>,
        first: u64,
    ) -> Cut {
        let (mut bounds, mut bytes) = (Vec::with_capacity(at.len() + 1), vec![]);
        bounds.push(0);
        for &at in at {
            let start = found.start[at].unsigned_abs() as usize;
            bytes.extend_from_slice(&data[start..start + found.len[at].unsigned_abs() as usize]);
            bounds.push(bytes.len() as i32);
        }
        Cut {
            known,
            carriers: Arc::clone(carriers),
            first,
            found: found.pick(at),
            steps: steps.pick(at),
            bounds,
            data: bytes,
        }
    }

    pub fn len(&self) -> usize {
        self.found.row.len()
    }

    pub fn is_empty(&self) -> bool {
        self.found.row.is_empty()
    }

    /// The messages that carried them, one a packet.
    pub fn messages(&self) -> Group {
        self.carriers.pick(&self.found.row)
    }

    /// 1 for a packet that is whole, with the right length and checksum.
    pub fn ok(&self) -> Vec<u8> {
        let found = &self.found;
        let both = found.length_ok.iter().zip(&found.complete).zip(&found.checksum_ok);
        both.map(|((length, complete), checksum)| length & complete & checksum)
            .collect()
    }

    /// 1 for a packet that can be relied on: [`Cut::ok`], in a transfer whose CRC is right.
    pub fn sound(&self) -> Vec<u8> {
        let trusted = self.messages().trusted();
        self.ok()
            .iter()
            .zip(trusted)
            .map(|(ok, trusted)| ok & trusted)
            .collect()
    }

    /// Places in the order of sending, through the whole capture: transfer, then byte in the array.
    pub fn positions(&self) -> Vec<u64> {
        let messages = self.messages();
        let place = |(&row, &offset): (&u32, &u32)| (self.first + u64::from(row)) << 16 | u64::from(offset);
        messages.rows.iter().zip(&self.found.offset).map(place).collect()
    }

    /// Those at some places.
    #[must_use]
    pub fn pick(&self, places: &[u32]) -> Cut {
        let at: Vec<usize> = places
            .iter()
            .map(|&at| at as usize)
            .filter(|&at| at < self.len())
            .collect();
        let mut found = self.found.clone();
        found.start.copy_from_slice(&self.bounds[..self.len()]);
        Cut::of(
            self.known,
            &at,
            &found,
            &self.steps,
            &self.data,
            &self.carriers,
            self.first,
        )
    }
}
