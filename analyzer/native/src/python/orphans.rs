//! Frames that belong to no transfer, for Python: columns in, a byte a row out.

use pyo3::buffer::PyBuffer;
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;

use super::buffer::Cells;
use crate::orphans::{Frame, Orphans, Place};

type Column<'py> = Bound<'py, Cells>;

/// Sessions, times and numbers of frames: a place each.
#[derive(FromPyObject)]
pub struct Asked {
    #[pyo3(item(0))]
    session: PyBuffer<i64>,
    #[pyo3(item(1))]
    since: PyBuffer<i64>,
    #[pyo3(item(2))]
    number: PyBuffer<i64>,
}

impl Asked {
    fn places(&self, py: Python<'_>) -> PyResult<Vec<Place>> {
        let (session, since) = (self.session.to_vec(py)?, self.since.to_vec(py)?);
        let number = self.number.to_vec(py)?;
        if [since.len(), number.len()] != [session.len(); 2] {
            return Err(unfit());
        }
        let rows = session.into_iter().zip(since).zip(number);
        let place = |((session, since), number)| Place { session, since, number };
        Ok(rows.map(place).collect())
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

    /// Forgets what nobody looks for any more, before the next batch.
    fn forget(&mut self) {
        self.0.forget();
    }

    /// Whether any frame came since each time, before each frame.
    #[allow(clippy::needless_pass_by_value)] // arguments from Python arrive by value
    fn before<'py>(&self, py: Python<'py>, asked: Asked) -> PyResult<Column<'py>> {
        let found = asked
            .places(py)?
            .iter()
            .map(|one| u8::from(self.0.before(one)))
            .collect();
        Cells::own(py, found)
    }

    /// Whether any frame came since each time, behind each frame.
    #[allow(clippy::needless_pass_by_value)] // arguments from Python arrive by value
    fn behind<'py>(&self, py: Python<'py>, asked: Asked) -> PyResult<Column<'py>> {
        let found = asked
            .places(py)?
            .iter()
            .map(|one| u8::from(self.0.behind(one)))
            .collect();
        Cells::own(py, found)
    }

    /// Whether frames with all of `count` transfer IDs from `first` on came since each time, before each frame.
    #[allow(clippy::needless_pass_by_value)] // arguments from Python arrive by value
    fn cover<'py>(
        &self,
        py: Python<'py>,
        asked: Asked,
        first: PyBuffer<u8>,
        count: PyBuffer<u8>,
    ) -> PyResult<Column<'py>> {
        let (first, count) = (first.to_vec(py)?, count.to_vec(py)?);
        let places = asked.places(py)?;
        if [first.len(), count.len()] != [places.len(); 2] {
            return Err(unfit());
        }
        let rows = places.iter().zip(first.into_iter().zip(count));
        let found = rows.map(|(one, (first, count))| u8::from(self.0.cover(one, first, count)));
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
