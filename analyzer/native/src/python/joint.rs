//! Stretches in which several senders lack frames, for Python.

use pyo3::buffer::PyBuffer;
use pyo3::prelude::*;

use super::buffer::Cells;
use super::unfit;
use crate::joint::{Near, Stretches};

type Column<'py> = Bound<'py, Cells>;

/// Stretches by column.
#[derive(FromPyObject)]
pub struct Given {
    #[pyo3(item(0))]
    since: PyBuffer<i64>,
    #[pyo3(item(1))]
    until: PyBuffer<i64>,
    #[pyo3(item(2))]
    first: PyBuffer<i64>,
    #[pyo3(item(3))]
    last: PyBuffer<i64>,
    #[pyo3(item(4))]
    window: PyBuffer<i64>,
    #[pyo3(item(5))]
    node: PyBuffer<u8>,
}

/// Which stretch each row of the others is about, how many senders lack frames there, since when and until when: i64.
///
/// Joint ones are at most `apart` frames from each other, or `nearby` in ns. An error if columns do not fit together.
#[pyfunction]
#[allow(clippy::needless_pass_by_value)] // arguments from Python arrive by value
pub fn joint(
    py: Python<'_>,
    given: Given,
    apart: i64,
    nearby: i64,
) -> PyResult<(Column<'_>, Column<'_>, Column<'_>, Column<'_>)> {
    let (since, until) = (given.since.to_vec(py)?, given.until.to_vec(py)?);
    let (first, last) = (given.first.to_vec(py)?, given.last.to_vec(py)?);
    let (window, node) = (given.window.to_vec(py)?, given.node.to_vec(py)?);
    let stretches = Stretches {
        since: &since,
        until: &until,
        first: &first,
        last: &last,
        window: &window,
        node: &node,
    };
    let found = py
        .detach(|| stretches.joint(Near { apart, nearby }))
        .ok_or_else(unfit)?;
    Ok((
        Cells::own(py, found.iter().map(|&(k, _)| k as i64).collect())?,
        Cells::own(py, found.iter().map(|(_, one)| i64::from(one.senders)).collect())?,
        Cells::own(py, found.iter().map(|(_, one)| one.since).collect())?,
        Cells::own(py, found.iter().map(|(_, one)| one.until).collect())?,
    ))
}
