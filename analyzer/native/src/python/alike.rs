//! Frames that are equal but for their tail bytes, for Python.

use pyo3::buffer::PyBuffer;
use pyo3::prelude::*;

use super::buffer::Cells;
use super::unfit;
use crate::alike::{self, Columns, Limits};

type Column<'py> = Bound<'py, Cells>;

/// A number for each frame by all but its tail byte, u64, and that byte, i16, -1 without one.
#[pyfunction]
#[allow(clippy::needless_pass_by_value)] // arguments from Python arrive by value
pub fn identities(
    py: Python<'_>,
    bus: PyBuffer<u8>,
    id: PyBuffer<u32>,
    offsets: PyBuffer<i32>,
    data: PyBuffer<u8>,
) -> PyResult<(Column<'_>, Column<'_>)> {
    let (bus, id) = (bus.to_vec(py)?, id.to_vec(py)?);
    let (offsets, data) = (offsets.to_vec(py)?, data.to_vec(py)?);
    let columns = Columns {
        bus: &bus,
        id: &id,
        offsets: &offsets,
        data: &data,
    };
    let (keys, tails) = py.detach(|| columns.identities()).ok_or_else(unfit)?;
    Ok((Cells::own(py, keys)?, Cells::own(py, tails)?))
}

/// What the frames at some places are, by those of the `look` before each with the same number: 0 none has its tail byte, 1
/// some have, 2 one has, of at most `few` whose transfer IDs follow each other.
#[pyfunction]
#[allow(clippy::needless_pass_by_value)] // arguments from Python arrive by value
pub fn repeats(
    py: Python<'_>,
    keys: PyBuffer<u64>,
    tails: PyBuffer<i16>,
    places: PyBuffer<u32>,
    look: u32,
    few: usize,
) -> PyResult<Column<'_>> {
    let (keys, tails, places) = (keys.to_vec(py)?, tails.to_vec(py)?, places.to_vec(py)?);
    let kinds = py.detach(|| alike::kinds(&keys, &tails, &places, Limits { look, few }));
    let kinds = kinds.ok_or_else(unfit)?;
    Cells::own(py, kinds.into_iter().map(|kind| kind as u8).collect())
}
