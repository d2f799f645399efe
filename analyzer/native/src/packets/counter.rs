//! Frame counts of packets: how far each went from the one before it.
#![forbid(unsafe_code)]

use super::{Family, Found};
use crate::seeded::Seeded;
use std::collections::HashMap;

/// What brought the bytes of a row: the message's bus, source node and data type.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Carrier {
    pub bus: u8,
    pub src: u8,
    pub type_id: u16,
}

/// The id is there for the count of one packet type, none for the count over all of them.
#[derive(PartialEq, Eq, Hash)]
struct Key {
    carrier: Carrier,
    unit: u8,
    id: Option<u8>,
}

/// Last counts by carrier and unit, and by packet id below that: the document does not say which of them counts.
#[derive(Default)]
pub struct Counter {
    last: HashMap<Key, u8, Seeded>,
}

/// Columns beside [`Found`]; a cell holds only where its `*_valid` is 1.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Steps {
    /// Count minus the previous one of (carrier, unit), mod 256.
    pub step: Vec<u8>,
    pub step_valid: Vec<u8>,
    /// The same of (carrier, unit, packet id).
    pub step_id: Vec<u8>,
    pub step_id_valid: Vec<u8>,
}

impl Steps {
    /// The rows at some places.
    #[must_use]
    pub fn pick(&self, at: &[usize]) -> Steps {
        let some = |column: &[u8]| at.iter().map(|&at| column[at]).collect();
        Steps {
            step: some(&self.step),
            step_valid: some(&self.step_valid),
            step_id: some(&self.step_id),
            step_id_valid: some(&self.step_id_valid),
        }
    }
}

impl Counter {
    /// Counts remembered; a key above that number has no step, ever.
    pub const MAX_KEYS: usize = 65_536;

    /// Steps over all packets of the unit, and over those of this id; none for the first.
    pub fn step(&mut self, carrier: Carrier, unit: u8, id: u8, count: u8) -> (Option<u8>, Option<u8>) {
        let mut step = |id| self.advance(Key { carrier, unit, id }, count);
        (step(None), step(Some(id)))
    }

    fn advance(&mut self, key: Key, count: u8) -> Option<u8> {
        if let Some(last) = self.last.get_mut(&key) {
            let step = count.wrapping_sub(*last);
            *last = count;
            return Some(step);
        }
        if self.last.len() < Self::MAX_KEYS {
            self.last.insert(key, count);
        }
        None
    }

    /// The steps of all packets of known type, in order. `carriers` has one entry for each span that `found` was made
    /// from; a packet whose row has none, or that ends before its count or unit, has no step and is not remembered.
    pub fn steps(&mut self, families: &[Family], found: &Found, carriers: &[Carrier], bytes: &[u8]) -> Steps {
        let mut out = Steps::default();
        for at in 0..found.len() {
            let (step, step_id) = self.step_at(families, found, carriers, bytes, at).unwrap_or_default();
            out.step.push(step.unwrap_or(0));
            out.step_valid.push(u8::from(step.is_some()));
            out.step_id.push(step_id.unwrap_or(0));
            out.step_id_valid.push(u8::from(step_id.is_some()));
        }
        out
    }

    fn step_at(
        &mut self,
        families: &[Family],
        found: &Found,
        carriers: &[Carrier],
        bytes: &[u8],
        at: usize,
    ) -> Option<(Option<u8>, Option<u8>)> {
        let carrier = *carriers.get(found.row[at] as usize)?;
        let family = families.get(usize::from(found.family[at]))?;
        let spec = family.packets.get(usize::try_from(found.spec[at]).ok()?)?;
        let start = usize::try_from(found.start[at]).ok()?;
        let packet = bytes.get(start..start + usize::try_from(found.len[at]).ok()?)?;
        let (unit, count) = (*packet.get(family.unit_at)?, *packet.get(family.count_at)?);
        Some(self.step(carrier, unit, spec.id, count))
    }
}
