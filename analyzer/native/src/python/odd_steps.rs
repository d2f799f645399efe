//! Transfers whose ID does not follow, for Python: columns in, steps out.

use std::collections::hash_map::Entry;
use std::collections::HashMap;

use pyo3::buffer::PyBuffer;
use pyo3::prelude::*;

use super::unfit;
use crate::diagnosis::index::Frames;
use crate::diagnosis::misnumbered::{meant, meant_before};
use crate::diagnosis::Known;
use crate::id_nodes::odd::{Asked, Meant, Odd};
use crate::id_nodes::step::Step;
use crate::orphans::Orphans;

/// Messages and requests whose step is not 1, a column behind the other, i64: anomalies, kinds, buses, sources, destinations,
/// IDs, steps, type IDs, times, times since the transfer before (0 for none), since when frames have come without a gap,
/// types, first frames, rows.
pub struct OddRows(Vec<Odd>);

const COLUMNS: usize = 14;

/// What they are judged by: frames that belong to no transfer, those of the recent past, when each bus began, and a function
/// that gives the values from which the CRC of a type may start.
pub struct Given<'a, 'py> {
    pub orphans: &'a Orphans,
    pub frames: Frames<'a>,
    pub starts: HashMap<u8, i64>,
    pub types: Bound<'py, PyAny>,
}

impl OddRows {
    pub fn of(py: Python<'_>, cells: &PyBuffer<i64>) -> PyResult<Self> {
        let cells = cells.to_vec(py)?;
        if !cells.len().is_multiple_of(COLUMNS) {
            return Err(unfit());
        }
        let rows = cells.len() / COLUMNS;
        let odd = |row: usize| {
            let cell = |column: usize| cells[column * rows + row];
            Odd {
                anomaly: cell(0) as u32,
                kind: cell(1) as u8,
                bus: cell(2) as u8,
                src: cell(3) as u8,
                dst: cell(4) as u8,
                id: cell(5) as u8,
                step: cell(6) as u8,
                type_id: cell(7) as u16,
                t: cell(8),
                gap: cell(9),
                resumed: cell(10),
                code: cell(11),
                lead: cell(12),
                row: cell(13) as u32,
            }
        };
        Ok(OddRows((0..rows).map(odd).collect()))
    }

    /// The breaches among them, each with its bus and node.
    pub fn steps(&self, given: &Given<'_, '_>) -> PyResult<Vec<(u8, u8, Step)>> {
        let mut types: HashMap<i64, Known> = HashMap::new();
        let mut found = vec![];
        for odd in &self.0 {
            let start = given.starts.get(&odd.bus).copied().unwrap_or(0);
            let step = odd.step(given.orphans, start, |asked| given.meant(odd, asked, &mut types))?;
            found.extend(step.map(|step| (odd.bus, odd.src, step)));
        }
        Ok(found)
    }
}

impl Given<'_, '_> {
    fn meant(&self, odd: &Odd, asked: Asked, types: &mut HashMap<i64, Known>) -> PyResult<Meant> {
        let known = match types.entry(odd.code) {
            Entry::Occupied(known) => known.into_mut(),
            Entry::Vacant(room) => {
                let starts = self.types.call1((odd.code,))?.extract()?;
                room.insert(Known { starts, size: None })
            }
        };
        let number = odd.lead as u64;
        let own = asked.own.then(|| meant(self.frames, number, known)).flatten();
        let before = asked.before.then(|| meant_before(self.frames, number, known)).flatten();
        Ok((own, before))
    }
}
