//! Searches and their causes by sender, for Python.

use pyo3::buffer::PyBuffer;
use pyo3::prelude::*;

use super::buffer::Cells;
use super::unfit;
use crate::diagnosis::budgets;

type Column<'py> = Bound<'py, Cells>;

/// Counts the searches of each sender.
#[pyclass]
#[derive(Clone)]
pub struct Budget(budgets::Budget);

#[pymethods]
impl Budget {
    #[new]
    fn new(searches: u32, senders: usize) -> Self {
        Budget(budgets::Budget::new(searches, senders))
    }

    fn left(&self, sender: i64) -> u32 {
        self.0.left(sender)
    }

    fn spend(&mut self, sender: i64) {
        self.0.spend(sender);
    }

    /// For which of these a search may be made, a byte each.
    #[allow(clippy::needless_pass_by_value)] // arguments from Python arrive by value
    fn allows<'py>(&self, py: Python<'py>, senders: PyBuffer<i64>) -> PyResult<Column<'py>> {
        Cells::own(py, self.0.allows(&senders.to_vec(py)?))
    }

    /// The same; these searches are noted.
    #[allow(clippy::needless_pass_by_value)] // arguments from Python arrive by value
    fn take<'py>(&mut self, py: Python<'py>, senders: PyBuffer<i64>) -> PyResult<Column<'py>> {
        Cells::own(py, self.0.take(&senders.to_vec(py)?))
    }

    /// Another one that grows apart from this.
    fn __deepcopy__(&self, _memo: &Bound<'_, PyAny>) -> Self {
        self.clone()
    }
}

/// The causes that were found for each sender, as numbers.
#[pyclass]
#[derive(Clone)]
pub struct Causes(budgets::Causes);

#[pymethods]
impl Causes {
    #[new]
    fn new(senders: usize, shapes: usize) -> Self {
        Causes(budgets::Causes::new(senders, shapes))
    }

    /// Notes what was found: senders, shapes and causes, a row each.
    #[allow(clippy::needless_pass_by_value)] // arguments from Python arrive by value
    fn note(
        &mut self,
        py: Python<'_>,
        senders: PyBuffer<i64>,
        shapes: PyBuffer<i64>,
        causes: PyBuffer<i64>,
    ) -> PyResult<()> {
        let (senders, shapes, causes) = (senders.to_vec(py)?, shapes.to_vec(py)?, causes.to_vec(py)?);
        if [shapes.len(), causes.len()] != [senders.len(); 2] {
            return Err(unfit());
        }
        for ((sender, shape), cause) in senders.into_iter().zip(shapes).zip(causes) {
            self.0.note(sender, shape, cause as u32);
        }
        Ok(())
    }

    /// The causes of senders and shapes, i64: of at least that share of what was found, or else `none`.
    #[allow(clippy::needless_pass_by_value)] // arguments from Python arrive by value
    fn like<'py>(
        &self,
        py: Python<'py>,
        senders: PyBuffer<i64>,
        shapes: PyBuffer<i64>,
        share: f64,
        none: u32,
    ) -> PyResult<Column<'py>> {
        let (senders, shapes) = (senders.to_vec(py)?, shapes.to_vec(py)?);
        if shapes.len() != senders.len() {
            return Err(unfit());
        }
        let rows = senders.into_iter().zip(shapes);
        let like = |(sender, shape)| i64::from(self.0.like(sender, shape, share).unwrap_or(none));
        Cells::own(py, rows.map(like).collect())
    }

    /// Another one that grows apart from this.
    fn __deepcopy__(&self, _memo: &Bound<'_, PyAny>) -> Self {
        self.clone()
    }
}
