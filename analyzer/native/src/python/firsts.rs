//! What came first of each key, for Python.

use pyo3::buffer::PyBuffer;
use pyo3::prelude::*;

use super::buffer::Cells;
use super::unfit;
use crate::firsts::{self, First};

type Column<'py> = Bound<'py, Cells>;

/// Remembers the time and the frame of what came first of each key.
#[pyclass]
#[derive(Clone)]
pub struct Firsts(firsts::Firsts);

#[pymethods]
impl Firsts {
    /// Keys beyond so many are left out.
    #[new]
    fn new(most: usize) -> Self {
        Firsts(firsts::Firsts::new(most))
    }

    /// Adds keys with times and numbers of frames: how many were new.
    #[allow(clippy::needless_pass_by_value)] // arguments from Python arrive by value
    fn add(
        &mut self,
        py: Python<'_>,
        keys: PyBuffer<i64>,
        t: PyBuffer<i64>,
        numbers: PyBuffer<i64>,
    ) -> PyResult<usize> {
        let (keys, t, numbers) = (keys.to_vec(py)?, t.to_vec(py)?, numbers.to_vec(py)?);
        if [t.len(), numbers.len()] != [keys.len(); 2] {
            return Err(unfit());
        }
        let rows = keys.into_iter().zip(t.into_iter().zip(numbers));
        let new = rows.filter(|&(key, (t, number))| self.0.add(key, First { t, number }));
        Ok(new.count())
    }

    /// Which keys are known, a byte each.
    #[allow(clippy::needless_pass_by_value)] // arguments from Python arrive by value
    fn has<'py>(&self, py: Python<'py>, keys: PyBuffer<i64>) -> PyResult<Column<'py>> {
        let found = keys.to_vec(py)?.into_iter().map(|key| u8::from(self.0.has(key)));
        Cells::own(py, found.collect())
    }

    /// The time and the frame of each key, i64; `t` and `number` of those that are not known.
    #[allow(clippy::needless_pass_by_value)] // arguments from Python arrive by value
    fn find<'py>(
        &self,
        py: Python<'py>,
        keys: PyBuffer<i64>,
        t: i64,
        number: i64,
    ) -> PyResult<(Column<'py>, Column<'py>)> {
        let none = First { t, number };
        let found = keys.to_vec(py)?.into_iter().map(|key| self.0.find(key).unwrap_or(none));
        let (t, number) = found.map(|one| (one.t, one.number)).unzip();
        Ok((Cells::own::<i64>(py, t)?, Cells::own::<i64>(py, number)?))
    }

    /// Another one that grows apart from this.
    fn __deepcopy__(&self, _memo: &Bound<'_, PyAny>) -> Self {
        self.clone()
    }
}
