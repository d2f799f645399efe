//! Rests of transfers for Python: columns of orphans in, which of them belong together out.

use pyo3::buffer::PyBuffer;
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;

use super::buffer::Cells;
use crate::remainders::{self, Frame, Limits};

type Column<'py> = Bound<'py, Cells>;

/// Puts orphans together.
#[pyclass]
#[derive(Clone)]
pub struct Remainders {
    rests: remainders::Remainders,
    /// The serial number of each frame of those that are open.
    of: Vec<i64>,
}

#[pymethods]
impl Remainders {
    /// So many are `open` at most, and so many frames of each `named`; `timeout` in ns.
    #[new]
    fn new(open: usize, named: u32, timeout: i64) -> Self {
        Remainders {
            rests: remainders::Remainders::new(Limits { open, named, timeout }),
            of: vec![],
        }
    }

    /// Adds frames: sessions, times, tail bytes, and all bytes of each; if they are the `last` ones, all are closed.
    ///
    /// Frames are counted from the first of those that were left before. The places of the frames of remainders that are
    /// closed, where those of each begin (one more than remainders), the bytes of each before tail bytes, and the places
    /// of frames that are left, i64.
    #[allow(clippy::needless_pass_by_value)] // arguments from Python arrive by value
    fn add<'py>(
        &mut self,
        py: Python<'py>,
        session: PyBuffer<i64>,
        t: PyBuffer<i64>,
        tail: PyBuffer<i64>,
        size: PyBuffer<i64>,
        last: bool,
    ) -> PyResult<(Column<'py>, Column<'py>, Column<'py>, Column<'py>)> {
        let (session, t) = (session.to_vec(py)?, t.to_vec(py)?);
        let (tail, size) = (tail.to_vec(py)?, size.to_vec(py)?);
        if [t.len(), tail.len(), size.len()] != [session.len(); 3] {
            return Err(PyValueError::new_err("columns that do not fit together"));
        }
        let rows = session.into_iter().zip(t).zip(tail.into_iter().zip(size));
        let frame = |((session, t), (tail, size))| {
            let (tail, size) = (tail as u8, size - 1);
            Frame { session, t, tail, size }
        };
        let made = self.rests.put(&mut self.of, rows.map(frame), last);
        let mut begins = vec![0];
        begins.extend(made.lists.iter().scan(0, |end, list| {
            *end += list.len() as i64;
            Some(*end)
        }));
        Ok((
            Cells::own(py, made.lists.concat())?,
            Cells::own(py, begins)?,
            Cells::own(py, made.received)?,
            Cells::own(py, made.left)?,
        ))
    }

    /// Another one that grows apart from this.
    fn __deepcopy__(&self, _memo: &Bound<'_, PyAny>) -> Self {
        self.clone()
    }
}
