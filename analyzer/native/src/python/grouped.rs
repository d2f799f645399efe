//! Rows by key for Python.

use pyo3::buffer::PyBuffer;
use pyo3::prelude::*;

use super::buffer::Cells;
use crate::grouped;

type Column<'py> = Bound<'py, Cells>;

/// Keys of rows: u32, or i64 of which none is negative.
#[derive(FromPyObject)]
pub enum Keys {
    Short(PyBuffer<u32>),
    Long(PyBuffer<i64>),
}

/// The rows in the order of their keys, those of one key in order, and where in that each key begins, i64.
#[pyfunction(name = "grouped")]
#[allow(clippy::needless_pass_by_value)] // arguments from Python arrive by value
pub fn rows(py: Python<'_>, keys: Keys) -> PyResult<(Column<'_>, Column<'_>)> {
    let (order, begins) = match keys {
        Keys::Short(keys) => {
            let keys = keys.to_vec(py)?;
            py.detach(|| grouped::grouped(&keys))
        }
        Keys::Long(keys) => {
            let keys = keys.to_vec(py)?;
            py.detach(|| grouped::grouped(&keys))
        }
    };
    Ok((Cells::own(py, order)?, Cells::own(py, begins)?))
}
