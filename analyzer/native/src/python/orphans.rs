//! Frames that belong to no transfer, for Python: columns in.

use pyo3::buffer::PyBuffer;
use pyo3::prelude::*;

use super::unfit;
use crate::orphans::{Frame, Orphans};

/// Remembers frames of sessions that belong to no transfer.
#[pyclass]
#[derive(Clone)]
pub struct OrphanIndex(pub Orphans);

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

    /// Another one that grows apart from this.
    fn __deepcopy__(&self, _memo: &Bound<'_, PyAny>) -> Self {
        self.clone()
    }
}
