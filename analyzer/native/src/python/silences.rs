//! What came last before a silence, for Python.

use pyo3::buffer::PyBuffer;
use pyo3::prelude::*;

use super::buffer::Cells;
use super::unfit;
use crate::silences;

/// Of frames that came more than `silence` ns behind the one before them, by their places among times: the place of the
/// latest of the `mixed` before each that is not later than the one before it by a silence, i64.
#[pyfunction]
#[allow(clippy::needless_pass_by_value)] // arguments from Python arrive by value
pub fn last_before(
    py: Python<'_>,
    t: PyBuffer<i64>,
    late: PyBuffer<i64>,
    silence: f64,
    mixed: usize,
) -> PyResult<Bound<'_, Cells>> {
    let found = silences::last_before(&t.to_vec(py)?, &late.to_vec(py)?, silence, mixed);
    Cells::own(py, found.ok_or_else(unfit)?)
}
