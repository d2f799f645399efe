//! Transfers that did not come, for Python.

use pyo3::buffer::PyBuffer;
use pyo3::prelude::*;

use super::buffer::Lent;
use super::unfit;
use crate::losses::{self, Columns};

/// Transfers by column: t, bus, src, dst, kind, type ID, transfer ID, step, anomaly.
type Given = (
    PyBuffer<i64>,
    PyBuffer<u8>,
    PyBuffer<u8>,
    PyBuffer<u8>,
    PyBuffer<u8>,
    PyBuffer<u16>,
    PyBuffer<u8>,
    PyBuffer<u8>,
    PyBuffer<u32>,
);

/// Adds up gaps in transfer IDs.
#[pyclass]
#[derive(Clone)]
pub struct Losses(losses::Losses);

#[pymethods]
impl Losses {
    #[new]
    fn new() -> Self {
        Losses(losses::Losses::default())
    }

    /// Takes the next batch.
    #[allow(clippy::needless_pass_by_value)] // arguments from Python arrive by value
    fn feed(&mut self, py: Python<'_>, given: Given) -> PyResult<()> {
        let columns = Columns {
            t: &Lent::of(py, given.0)?,
            bus: &Lent::of(py, given.1)?,
            src: &Lent::of(py, given.2)?,
            dst: &Lent::of(py, given.3)?,
            kind: &Lent::of(py, given.4)?,
            type_id: &Lent::of(py, given.5)?,
            transfer_id: &Lent::of(py, given.6)?,
            step: &Lent::of(py, given.7)?,
            anomaly: &Lent::of(py, given.8)?,
        };
        let fits = self.0.feed(&columns);
        fits.then_some(()).ok_or_else(unfit)
    }

    /// Of a node, bus << 8 | source: lost; lost if one counter serves all its types, and whether it does or not; gaps,
    /// those that return from one, sessions with gaps; what counters that fell to 0 left out.
    fn sums(&self, node: u16) -> [i64; 7] {
        let sums = self.0.sums(node);
        let zeroed = self.0.zeroed(node);
        [
            sums.lost,
            sums.common,
            sums.by_both,
            sums.gaps,
            sums.returns,
            sums.types,
            zeroed,
        ]
    }

    /// Another one that grows apart from this.
    fn __deepcopy__(&self, _memo: &Bound<'_, PyAny>) -> Self {
        self.clone()
    }
}
