//! Frames that are equal but for their tail bytes, for Python.

use pyo3::buffer::PyBuffer;
use pyo3::prelude::*;

use super::buffer::Cells;
use super::unfit;
use crate::alike::{self, Columns, Limits};

/// A number for each frame of a batch by all but its tail byte.
#[pyclass(frozen)]
pub struct Identities(alike::Identities);

#[pymethods]
impl Identities {
    #[new]
    #[allow(clippy::needless_pass_by_value)] // arguments from Python arrive by value
    fn new(
        py: Python<'_>,
        bus: PyBuffer<u8>,
        id: PyBuffer<u32>,
        offsets: PyBuffer<i32>,
        data: PyBuffer<u8>,
    ) -> PyResult<Self> {
        let (bus, id) = (bus.to_vec(py)?, id.to_vec(py)?);
        let (offsets, data) = (offsets.to_vec(py)?, data.to_vec(py)?);
        let columns = Columns {
            bus: &bus,
            id: &id,
            offsets: &offsets,
            data: &data,
        };
        py.detach(|| columns.identities()).map(Identities).ok_or_else(unfit)
    }
}

/// What the frames at some places are, i64 counted through batches that follow each other, by those of the `look` before
/// each with the same number: 0 none has its tail byte, 1 some have, 2 one has, of at most `few` whose transfer IDs follow
/// each other. A frame that is not there is 0.
#[pyfunction]
#[allow(clippy::needless_pass_by_value)] // arguments from Python arrive by value
pub fn repeats(
    py: Python<'_>,
    batches: Vec<Py<Identities>>,
    places: PyBuffer<i64>,
    look: u32,
    few: usize,
) -> PyResult<Bound<'_, Cells>> {
    let places = places.to_vec(py)?;
    let batches: Vec<&alike::Identities> = batches.iter().map(|one| &one.get().0).collect();
    let kinds = py.detach(|| alike::kinds(&batches, &places, Limits { look, few }));
    Cells::own(py, kinds.into_iter().map(|kind| kind as u8).collect())
}
