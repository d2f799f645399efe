//! Frames that belong to no transfer, for Python: columns in, a byte a row out.

use pyo3::buffer::PyBuffer;
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;

use super::buffer::Cells;
use crate::orphans::{Frame, Orphans, Stretch};

type Column<'py> = Bound<'py, Cells>;

/// Sessions, times, and the numbers of the first frame and of the one behind the last: a stretch each.
#[derive(FromPyObject)]
pub struct Asked {
    #[pyo3(item(0))]
    session: PyBuffer<i64>,
    #[pyo3(item(1))]
    since: PyBuffer<i64>,
    #[pyo3(item(2))]
    low: PyBuffer<i64>,
    #[pyo3(item(3))]
    high: PyBuffer<i64>,
}

impl Asked {
    fn stretches(&self, py: Python<'_>) -> PyResult<Vec<Stretch>> {
        let (session, since) = (self.session.to_vec(py)?, self.since.to_vec(py)?);
        let (low, high) = (self.low.to_vec(py)?, self.high.to_vec(py)?);
        if [since.len(), low.len(), high.len()] != [session.len(); 3] {
            return Err(unfit());
        }
        let rows = session.into_iter().zip(since).zip(low.into_iter().zip(high));
        let stretch = |((session, since), (low, high))| Stretch {
            session,
            since,
            numbers: low..high,
        };
        Ok(rows.map(stretch).collect())
    }
}

/// Remembers frames of sessions that belong to no transfer.
#[pyclass]
#[derive(Clone)]
pub struct OrphanIndex(Orphans);

#[pymethods]
impl OrphanIndex {
    #[new]
    fn new() -> Self {
        OrphanIndex(Orphans::default())
    }

    /// Adds frames: the session, the number, the time and the transfer ID of each.
    #[allow(clippy::needless_pass_by_value)] // arguments from Python arrive by value
    fn add(
        &mut self,
        py: Python<'_>,
        session: PyBuffer<i64>,
        number: PyBuffer<i64>,
        t: PyBuffer<i64>,
        id: PyBuffer<u8>,
    ) -> PyResult<()> {
        let (session, number) = (session.to_vec(py)?, number.to_vec(py)?);
        let (t, id) = (t.to_vec(py)?, id.to_vec(py)?);
        if [number.len(), t.len(), id.len()] != [session.len(); 3] {
            return Err(unfit());
        }
        for (session, (number, (t, id))) in session.into_iter().zip(number.into_iter().zip(t.into_iter().zip(id))) {
            self.0.add(session, Frame { number, t, id });
        }
        Ok(())
    }

    /// Whether any frame came in each stretch.
    #[allow(clippy::needless_pass_by_value)] // arguments from Python arrive by value
    fn any<'py>(&self, py: Python<'py>, asked: Asked) -> PyResult<Column<'py>> {
        let stretches = asked.stretches(py)?;
        let found = stretches.iter().map(|one| u8::from(self.0.any(one))).collect();
        Cells::own(py, found)
    }

    /// Whether frames with each of `count` transfer IDs from `first` on came in each stretch.
    #[allow(clippy::needless_pass_by_value)] // arguments from Python arrive by value
    fn all<'py>(
        &self,
        py: Python<'py>,
        asked: Asked,
        first: PyBuffer<u8>,
        count: PyBuffer<u8>,
    ) -> PyResult<Column<'py>> {
        let (first, count) = (first.to_vec(py)?, count.to_vec(py)?);
        let stretches = asked.stretches(py)?;
        if [first.len(), count.len()] != [stretches.len(); 2] {
            return Err(unfit());
        }
        let rows = stretches.iter().zip(first.into_iter().zip(count));
        let found = rows.map(|(one, (first, count))| u8::from(self.0.all(one, first, count)));
        Cells::own(py, found.collect())
    }

    /// Another one that grows apart from this.
    fn __deepcopy__(&self, _memo: &Bound<'_, PyAny>) -> Self {
        self.clone()
    }
}

fn unfit() -> PyErr {
    PyValueError::new_err("columns that do not fit together")
}
