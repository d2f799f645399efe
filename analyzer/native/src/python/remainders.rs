//! Rests of transfers for Python: columns of orphans in, which of them belong together out.

use pyo3::buffer::PyBuffer;
use pyo3::prelude::*;

use super::buffer::Cells;
use super::unfit;
use crate::remainders::{self, Frame, Limits};

type Column<'py> = Bound<'py, Cells>;

/// Puts orphans together.
#[pyclass]
#[derive(Clone)]
pub struct Remainders(remainders::Remainders);

#[pymethods]
impl Remainders {
    /// So many are `open` at most, and so many frames of each `named`; `timeout` in ns.
    #[new]
    fn new(open: usize, named: usize, timeout: i64) -> Self {
        Remainders(remainders::Remainders::new(Limits { open, named, timeout }))
    }

    /// Adds frames: sessions, times, tail bytes, and all bytes of each; if they are the `last` ones, all are closed.
    ///
    /// The slot in which each frame has its place, or -1 if it is not named; the slots of remainders that are closed, as
    /// they are, where those of each begin (one more than remainders), the bytes of each before tail bytes, i64. Slots of
    /// those that were closed are used again by the next call.
    #[allow(clippy::needless_pass_by_value)] // arguments from Python arrive by value
    fn add<'py>(
        &mut self,
        py: Python<'py>,
        session: PyBuffer<i64>,
        t: PyBuffer<i64>,
        tail: PyBuffer<i32>,
        size: PyBuffer<i32>,
        last: bool,
    ) -> PyResult<(Column<'py>, Column<'py>, Column<'py>, Column<'py>)> {
        let (session, t) = (session.to_vec(py)?, t.to_vec(py)?);
        let (tail, size) = (tail.to_vec(py)?, size.to_vec(py)?);
        if [t.len(), tail.len(), size.len()] != [session.len(); 3] {
            return Err(unfit());
        }
        self.0.forget();
        let mut closed = vec![];
        let rows = session.into_iter().zip(t).zip(tail.into_iter().zip(size));
        let put = |((session, t), (tail, size))| {
            let (tail, size) = (tail as u8, i64::from(size) - 1);
            let frame = Frame { session, t, tail, size };
            self.0.add(frame, &mut closed).unwrap_or(-1)
        };
        let slots: Vec<i64> = rows.map(put).collect();
        if last {
            self.0.close_all(&mut closed);
        }
        let (mut every, mut begins) = (vec![], vec![0]);
        for one in &closed {
            every.extend_from_slice(&one.slots);
            begins.push(every.len() as i64);
        }
        Ok((
            Cells::own(py, slots)?,
            Cells::own(py, every)?,
            Cells::own(py, begins)?,
            Cells::own(py, closed.iter().map(|one| one.received).collect())?,
        ))
    }

    /// Another one that grows apart from this.
    fn __deepcopy__(&self, _memo: &Bound<'_, PyAny>) -> Self {
        self.clone()
    }
}
