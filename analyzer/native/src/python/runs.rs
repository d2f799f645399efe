//! Occurrences by what they are of, for Python.

use pyo3::buffer::PyBuffer;
use pyo3::prelude::*;

use super::unfit;
use crate::runs::{About, Apart, Groups};

/// What the rows of a group are all of: noted and doubtful; bus, node, type and key; its first row.
type Group = ((bool, bool), (i64, i64, i64, i64), u32);

/// Rows of occurrences of one rule by group.
#[pyclass]
pub struct OccurrenceGroups(pub Groups);

#[pymethods]
impl OccurrenceGroups {
    /// Columns of i64: time, frame, bus, node and type; `key`, and masks of those that are noted or doubtful, if there are
    /// such. A piece ends with a longer pause than `pause`, or where `piece` does unless it is 0: in ns.
    #[new]
    #[allow(clippy::needless_pass_by_value)] // arguments from Python arrive by value
    fn new(
        py: Python<'_>,
        columns: [PyBuffer<i64>; 5],
        key: Option<PyBuffer<i64>>,
        masks: [Option<PyBuffer<u8>>; 2],
        apart: (i64, i64),
    ) -> PyResult<Self> {
        let [t, frame, bus, node, types] = columns.each_ref().map(|column| column.to_vec(py));
        let (t, frame, bus, node, types) = (t?, frame?, bus?, node?, types?);
        let key = key.map(|key| key.to_vec(py)).transpose()?;
        let [noted, doubtful] = masks.map(|mask| mask.map(|mask| mask.to_vec(py)).transpose());
        let (noted, doubtful) = (noted?, doubtful?);
        let long = [&frame, &bus, &node, &types].into_iter().chain(&key);
        let fit = long.map(Vec::len).chain(noted.iter().chain(&doubtful).map(Vec::len));
        if fit.into_iter().any(|len| len != t.len()) {
            return Err(unfit());
        }
        let set = |mask: &Option<Vec<u8>>, row: usize| mask.as_ref().is_some_and(|mask| mask[row] != 0);
        let about = (0..t.len()).map(|row| About {
            bus: bus[row],
            node: node[row],
            type_: types[row],
            noted: set(&noted, row),
            doubtful: set(&doubtful, row),
            key: key.as_ref().map_or(0, |key| key[row]),
        });
        let about: Vec<About> = about.collect();
        let (pause, piece) = apart;
        let place = t.into_iter().zip(frame).collect();
        Ok(OccurrenceGroups(Groups::of(&about, place, Apart { pause, piece })))
    }

    /// A group, by its place among all, in the order of bus, node, type, the masks, and key.
    fn group(&self, group: usize) -> PyResult<Group> {
        let (about, row) = self.0.group(group).ok_or_else(unfit)?;
        let About {
            bus,
            node,
            type_,
            noted,
            doubtful,
            key,
        } = about;
        Ok(((noted, doubtful), (bus, node, type_, key), row))
    }

    /// The rows from one place in the order to before another one.
    fn rows(&self, begin: usize, end: usize) -> Vec<u32> {
        self.0.rows(begin, end).to_vec()
    }
}
