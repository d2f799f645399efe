//! One session: the transfers of one (bus, kind, type, source, destination), one slot a transfer ID.
#![forbid(unsafe_code)]

use std::collections::HashMap;
use std::sync::Arc;

use crate::seeded::Seeded;
use crate::slot::Slot;
use crate::transfers::{anomaly, when, NO_GAP, NO_STEP};
use crate::wire::Id;

/// Periods after which a transfer ID that stands where it stood has come around: half of all transfer IDs. Too few, and
/// an ID that is repeated after a pause counts as 31 lost transfers (8 does so in a test); too many, and a round of which
/// the recorder saw little counts as an ID that stands still (24 does).
const MANY: i64 = 16;
/// Data type IDs of 16 bits, of services and of messages.
const TYPES: usize = 2 << 16;

/// What the core knows of a data type.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Known {
    /// Position among the known types.
    pub index: u16,
    /// CRC start value, which is the CRC of the signature.
    pub crc_start: u16,
}

/// The types that share a data type ID, the preferred one first; only a CRC can tell them apart.
pub type Candidates = Arc<[Known]>;

/// The data types that somebody was asked for: what is known of each, by (is a service, data type ID).
pub struct Resolved {
    known: HashMap<usize, Candidates, Seeded>,
    /// A bit each for those of which nothing is known, as of most in noise.
    unknown: Vec<u64>,
    nothing: Candidates,
}

impl Default for Resolved {
    fn default() -> Self {
        Resolved {
            known: HashMap::default(),
            unknown: vec![0; TYPES / 64],
            nothing: Candidates::default(),
        }
    }
}

impl Resolved {
    /// None for one that nobody was asked for.
    pub fn get(&self, service: bool, type_id: u16) -> Option<Candidates> {
        let at = place(service, type_id);
        if self.unknown[at / 64] & 1 << (at % 64) != 0 {
            return Some(Arc::clone(&self.nothing));
        }
        self.known.get(&at).cloned()
    }

    pub fn insert(&mut self, service: bool, type_id: u16, known: Vec<Known>) -> Candidates {
        let at = place(service, type_id);
        if known.is_empty() {
            self.unknown[at / 64] |= 1 << (at % 64);
            return Arc::clone(&self.nothing);
        }
        let known = Candidates::from(known);
        self.known.insert(at, Arc::clone(&known));
        known
    }
}

fn place(service: bool, type_id: u16) -> usize {
    usize::from(service) << 16 | usize::from(type_id)
}

#[derive(Debug)]
pub struct Session {
    pub id: Id,
    pub bus: u8,
    pub known: Candidates,
    pub(crate) hot: Slot,
    /// Slots of other transfer IDs that are under way at the same time: nearly always none.
    pub(crate) others: Vec<Slot>,
    /// Transfer ID and time of the latest start.
    pub(crate) previous: Option<(u8, i64)>,
    /// Whether `hot` still holds the payload of the latest complete transfer.
    pub(crate) holds_last: bool,
    /// That payload, when a transfer with the same transfer ID is under way.
    pub(crate) repeated: Option<Vec<u8>>,
    /// The time between the latest two starts with consecutive IDs, 0 before there were any.
    pub(crate) period: i64,
    /// Bits that every transfer of this session carries.
    pub(crate) constant: u32,
    /// Somebody asks for its transfers: otherwise they are only counted.
    pub(crate) asked: bool,
}

impl Session {
    pub fn new(id: Id, bus: u8, known: Candidates) -> Self {
        let service = id.kind.is_service();
        Session {
            id,
            bus,
            known,
            hot: Slot::default(),
            others: vec![],
            previous: None,
            holds_last: false,
            repeated: None,
            period: 0,
            asked: true,
            constant: when(service && id.dst == 0, anomaly::DESTINATION_ZERO)
                | when(service && id.src == 0, anomaly::SOURCE_ZERO)
                | when(service && id.src == id.dst, anomaly::ADDRESSED_TO_ITSELF),
        }
    }

    /// As a new one, with the room of this one.
    pub fn renew(&mut self, id: Id, bus: u8, known: Candidates) {
        let (mut hot, mut others) = (std::mem::take(&mut self.hot), std::mem::take(&mut self.others));
        hot.renew();
        others.clear();
        *self = Session {
            hot,
            others,
            ..Session::new(id, bus, known)
        };
    }

    pub fn is_known(&self) -> bool {
        !self.known.is_empty()
    }

    /// False for the service identifiers that no node may send (clause 4.1.2).
    pub fn legal_id(&self) -> bool {
        self.constant == 0
    }

    /// Makes the active slot of `transfer_id` the hot one; false when there is none.
    pub(crate) fn select(&mut self, transfer_id: u8) -> bool {
        if self.hot.active() && self.hot.transfer_id == transfer_id {
            return true;
        }
        let Some(at) = self.others.iter().position(|slot| slot.transfer_id == transfer_id) else {
            return false;
        };
        let slot = self.others.swap_remove(at);
        let was = std::mem::replace(&mut self.hot, slot);
        self.holds_last = false;
        if was.active() {
            self.others.push(was);
        }
        true
    }

    /// Distance from the previous start, and what the previous payload was if the ID is the same.
    pub(crate) fn measure(&mut self, transfer_id: u8, t: i64) -> (u8, i64) {
        self.repeated = None;
        let before = self.previous.replace((transfer_id, t));
        let Some((id, at)) = before else {
            return (NO_STEP, NO_GAP);
        };
        let timed = at != crate::frames::NO_TIME && t != crate::frames::NO_TIME;
        let gap = if timed { t.saturating_sub(at) } else { NO_GAP };
        let step = transfer_id.wrapping_sub(id) & 31;
        if step == 1 && gap != NO_GAP {
            self.period = gap;
        }
        (step, gap)
    }
}

/// Whether so much time is enough for a transfer ID to come back by itself.
pub(crate) fn come_around(gap: i64, period: i64) -> bool {
    period > 0 && gap / period >= MANY
}
