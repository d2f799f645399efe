//! Sessions that are known to be DroneCAN's, and no other protocol's: some of their transfers are complete, and of a type
//! that is defined.
#![forbid(unsafe_code)]

use std::collections::{BTreeMap, HashMap, HashSet};

use crate::frames::NO_TIME;
use crate::groups::{MESSAGE, REQUEST, RESPONSE};
use crate::seeded::Seeded;
use crate::session_code::{bus_of, is_service, node_of, of_message, of_service};
use crate::transfers::Status;

/// Transfers that prove a session.
const ENOUGH: u32 = 2;
/// Sessions that are known, or may become so: every node may ask every other one for every service.
const MOST: usize = 1 << 16;
/// Types of which it is remembered whether they are defined.
const MOST_TYPES: usize = 1 << 12;

/// The transfers of a batch in columns.
#[derive(Debug)]
pub struct Ended<'a> {
    pub kind: &'a [u8],
    pub status: &'a [u8],
    pub bus: &'a [u8],
    pub src: &'a [u8],
    pub dst: &'a [u8],
    pub type_id: &'a [u16],
    pub variant: &'a [u8],
    pub t_end: &'a [i64],
}

impl Ended<'_> {
    fn fits(&self) -> bool {
        let others = [self.status, self.bus, self.src, self.dst, self.variant];
        let (many, numbers) = (self.kind.len(), self.type_id.len());
        others.iter().all(|column| column.len() == many) && numbers == many && self.t_end.len() == many
    }

    /// The session of a row as one number; none for what is in none.
    fn session(&self, row: usize) -> Option<i64> {
        let (bus, src, type_id) = (self.bus[row], self.src[row], i64::from(self.type_id[row]));
        let service = |asks| Some(of_service(bus, src, type_id, asks, self.dst[row]));
        match self.kind[row] {
            MESSAGE => Some(of_message(bus, src, type_id)),
            REQUEST => service(true),
            RESPONSE => service(false),
            _ => None,
        }
    }

    /// The type of a row as one number.
    fn code(&self, row: usize) -> i64 {
        i64::from(self.variant[row]) << 24 | i64::from(self.kind[row]) << 16 | i64::from(self.type_id[row])
    }
}

/// Sessions by their numbers.
#[derive(Clone, Debug, Default)]
pub struct Known {
    since: HashMap<i64, i64, Seeded>,
    /// Sessions of which one transfer is not enough to be known.
    complete: HashSet<i64, Seeded>,
    defined: HashMap<i64, bool, Seeded>,
    nodes: HashMap<u8, BTreeMap<u32, i64>>,
}

impl Known {
    pub fn has(&self, code: i64) -> bool {
        self.since.contains_key(&code)
    }

    /// Since when a session is known; the last time there is if it is not.
    pub fn since(&self, code: i64) -> i64 {
        self.since.get(&code).copied().unwrap_or(i64::MAX)
    }

    /// When each node of a bus that sends messages became known, in the order of these times.
    pub fn nodes(&self, bus: u8) -> Vec<i64> {
        let mut times: Vec<i64> = self
            .nodes
            .get(&bus)
            .into_iter()
            .flat_map(BTreeMap::values)
            .copied()
            .collect();
        times.sort_unstable();
        times
    }

    /// Adds the transfers of a batch; `defined` says whether a type is, by its number. None if columns do not fit
    /// together. Types that have no definition come out late, and prove nothing.
    ///
    /// # Errors
    /// Those of `defined`.
    pub fn prove<E>(
        &mut self,
        ended: &Ended<'_>,
        mut defined: impl FnMut(i64) -> Result<bool, E>,
    ) -> Result<Option<()>, E> {
        if !ended.fits() {
            return Ok(None);
        }
        let mut seen: HashMap<i64, u32, Seeded> = HashMap::default();
        for row in 0..ended.kind.len() {
            let good = ended.status[row] == Status::Ok as u8 && ended.t_end[row] != NO_TIME;
            let Some(session) = ended.session(row).filter(|session| good && !self.has(*session)) else {
                continue;
            };
            let many = seen.entry(session).or_default();
            *many += 1;
            let proves = *many <= ENOUGH && self.is_defined(ended.code(row), &mut defined)?;
            if proves && self.note(session, ended.t_end[row]) {
                *many = ENOUGH;
            }
        }
        Ok(Some(()))
    }

    fn is_defined<E>(&mut self, code: i64, defined: &mut impl FnMut(i64) -> Result<bool, E>) -> Result<bool, E> {
        if let Some(&known) = self.defined.get(&code) {
            return Ok(known);
        }
        if self.defined.len() >= MOST_TYPES {
            self.defined.clear();
        }
        let found = defined(code)?;
        self.defined.insert(code, found);
        Ok(found)
    }

    /// Notes a transfer; true if that makes its session known.
    fn note(&mut self, session: i64, t: i64) -> bool {
        if !self.complete.remove(&session) {
            if self.complete.len() < MOST {
                self.complete.insert(session);
            }
            return false;
        }
        if self.since.len() < MOST {
            self.since.insert(session, t);
        }
        if !is_service(session) {
            let nodes = self.nodes.entry(bus_of(session)).or_default();
            let at = nodes.entry(node_of(session)).or_insert(t);
            *at = t.min(*at);
        }
        true
    }
}
