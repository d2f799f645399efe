//! Rests of transfers for Python: columns of orphans in, which of them belong together out.

use pyo3::buffer::PyBuffer;
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;

use super::buffer::Cells;
use crate::remainders::{self, Closed, Frame, Limits};

type Column<'py> = Bound<'py, Cells>;

/// Puts orphans together.
#[pyclass]
#[derive(Clone)]
pub struct Remainders(remainders::Remainders);

#[pymethods]
impl Remainders {
    /// So many are `open` at most, and so many frames of each `named`; `timeout` in ns.
    #[new]
    fn new(open: usize, named: u32, timeout: i64) -> Self {
        Remainders(remainders::Remainders::new(Limits { open, named, timeout }))
    }

    /// Adds frames: sessions, times, tail bytes, and bytes before these. The serial number of the remainder of each, or
    /// -1 if it is not named; the serial numbers of those that are closed, as they are, and the bytes of each, i64.
    #[allow(clippy::needless_pass_by_value)] // arguments from Python arrive by value
    fn add<'py>(
        &mut self,
        py: Python<'py>,
        session: PyBuffer<i64>,
        t: PyBuffer<i64>,
        tail: PyBuffer<i64>,
        size: PyBuffer<i64>,
    ) -> PyResult<(Column<'py>, Column<'py>, Column<'py>)> {
        let (session, t) = (session.to_vec(py)?, t.to_vec(py)?);
        let (tail, size) = (tail.to_vec(py)?, size.to_vec(py)?);
        if [t.len(), tail.len(), size.len()] != [session.len(); 3] {
            return Err(PyValueError::new_err("columns that do not fit together"));
        }
        let mut closed = vec![];
        let rows = session.into_iter().zip(t).zip(tail.into_iter().zip(size));
        let put = |((session, t), (tail, size))| {
            let tail = tail as u8;
            let frame = Frame { session, t, tail, size };
            self.0.add(frame, &mut closed).unwrap_or(-1)
        };
        let serials: Vec<i64> = rows.map(put).collect();
        let (closed, received) = columns(py, &closed)?;
        Ok((Cells::own(py, serials)?, closed, received))
    }

    /// Closes all: their serial numbers, and the bytes of each.
    fn close<'py>(&mut self, py: Python<'py>) -> PyResult<(Column<'py>, Column<'py>)> {
        let mut closed = vec![];
        self.0.close_all(&mut closed);
        columns(py, &closed)
    }

    /// Another one that grows apart from this.
    fn __deepcopy__(&self, _memo: &Bound<'_, PyAny>) -> Self {
        self.clone()
    }
}

fn columns<'py>(py: Python<'py>, closed: &[Closed]) -> PyResult<(Column<'py>, Column<'py>)> {
    let serials = closed.iter().map(|one| one.serial).collect();
    let received = closed.iter().map(|one| one.received).collect();
    Ok((Cells::own(py, serials)?, Cells::own(py, received)?))
}
