//! Start values of CRCs for Python: CRCs and payloads in, a cell a row out.

use pyo3::buffer::PyBuffer;
use pyo3::prelude::*;

use super::buffer::Cells;
use super::unfit;
use crate::diagnosis::mistakes::Starts;
use crate::wire::crc_start_from;

type Column<'py> = Bound<'py, Cells>;

/// CRCs as received, where each payload begins (one more than rows), and all payloads.
#[derive(FromPyObject)]
pub struct Received(PyBuffer<i64>, PyBuffer<i64>, PyBuffer<u8>);

/// The same, where Rust may look at it.
struct Rows {
    wire: Vec<i64>,
    begins: Vec<i64>,
    data: Vec<u8>,
}

impl Received {
    fn rows(&self, py: Python<'_>) -> PyResult<Rows> {
        let (wire, begins, data) = (self.0.to_vec(py)?, self.1.to_vec(py)?, self.2.to_vec(py)?);
        let rows = Rows { wire, begins, data };
        (rows.begins.len() == rows.wire.len() + 1)
            .then_some(rows)
            .ok_or_else(unfit)
    }
}

impl Rows {
    /// The CRC and the payload of each; None where there are no such bytes.
    fn each(&self) -> impl Iterator<Item = Option<(u16, &[u8])>> {
        let payload = |ends: &[i64]| {
            let (begin, end) = (usize::try_from(ends[0]).ok()?, usize::try_from(ends[1]).ok()?);
            self.data.get(begin..end)
        };
        let rows = self.wire.iter().zip(self.begins.windows(2));
        rows.map(move |(&wire, ends)| Some((wire as u16, payload(ends)?)))
    }
}

/// From which value the CRC of each payload starts if it ends as received, i64.
#[pyfunction]
#[allow(clippy::needless_pass_by_value)] // arguments from Python arrive by value
pub fn crc_starts(py: Python<'_>, received: Received) -> PyResult<Column<'_>> {
    let rows = received.rows(py)?;
    let start = |(wire, payload)| i64::from(crc_start_from(wire, payload));
    let found: Option<Vec<i64>> = rows.each().map(|row| row.map(start)).collect();
    Cells::own(py, found.ok_or_else(unfit)?)
}

/// Which CRCs a usual mistake may give, a byte each. `types` are start values, right and mistaken ones, `which` is the
/// place of that of each row.
#[pyfunction]
#[allow(clippy::needless_pass_by_value)] // arguments from Python arrive by value
pub fn mistaken(
    py: Python<'_>,
    types: Vec<(Vec<u16>, Vec<u16>)>,
    which: PyBuffer<i64>,
    received: Received,
) -> PyResult<Column<'_>> {
    let (rows, which) = (received.rows(py)?, which.to_vec(py)?);
    let types: Vec<Starts> = types
        .into_iter()
        .map(|(right, mistaken)| Starts { right, mistaken })
        .collect();
    if which.len() != rows.wire.len() {
        return Err(unfit());
    }
    let known = |which: i64| types.get(usize::try_from(which).ok()?);
    let may = |(row, &which): (Option<(u16, &[u8])>, &i64)| {
        let (wire, payload) = row?;
        Some(u8::from(known(which)?.may_give(wire, payload)))
    };
    let found: Option<Vec<u8>> = rows.each().zip(&which).map(may).collect();
    Cells::own(py, found.ok_or_else(unfit)?)
}
