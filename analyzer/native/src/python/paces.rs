//! Breaks in reports at a steady pace, for Python.

use pyo3::buffer::PyBuffer;
use pyo3::prelude::*;

use super::buffer::Cells;
use super::unfit;
use crate::paces::{self, Limits, Report};

type Column<'py> = Bound<'py, Cells>;
/// Start and end, the period, the place of the report before it, whether nothing was lost, and whether the pace changed.
type Break = (i64, i64, f64, i64, bool, Option<bool>);

/// Follows the reports of many senders.
#[pyclass]
#[derive(Clone)]
pub struct Paces(paces::Paces);

#[pymethods]
impl Paces {
    /// Times in ns; `other` are how far off another pace may be, and the slowest that is one before it is seen twice.
    #[new]
    fn new(least: i64, periods: f64, fewest: usize, span: i64, other: (f64, i64)) -> Self {
        let (alike, slowest) = other;
        Paces(paces::Paces::new(Limits {
            least,
            periods,
            fewest,
            span,
            alike,
            slowest,
        }))
    }

    /// The time of the last report of each, i64.
    fn last<'py>(&self, py: Python<'py>) -> PyResult<Column<'py>> {
        Cells::own(py, self.0.last().collect())
    }

    /// Takes reports, one sender after the other, so many of each: whether the pace only changed behind earlier breaks, and
    /// the breaks, each with the place of its sender among these.
    #[allow(clippy::needless_pass_by_value, clippy::type_complexity)] // arguments from Python arrive by value
    fn feed(
        &mut self,
        py: Python<'_>,
        senders: PyBuffer<i64>,
        size: PyBuffer<i64>,
        t: PyBuffer<i64>,
        lost: PyBuffer<i64>,
    ) -> PyResult<(Vec<(i64, bool)>, Vec<(usize, Break)>)> {
        let (senders, size) = (senders.to_vec(py)?, size.to_vec(py)?);
        let (t, lost) = (t.to_vec(py)?, lost.to_vec(py)?);
        let total = size
            .iter()
            .map(|&some| usize::try_from(some))
            .sum::<Result<usize, _>>()?;
        if senders.len() != size.len() || [t.len(), lost.len()] != [total; 2] {
            return Err(unfit());
        }
        let reports: Vec<Report> = t.iter().zip(&lost).map(|(&t, &lost)| Report { t, lost }).collect();
        let (mut settled, mut told, mut begin) = (vec![], vec![], 0);
        for (k, (&sender, &size)) in senders.iter().zip(&size).enumerate() {
            let mut found = vec![];
            let end = usize::try_from(size)?.saturating_add(begin);
            let new = reports.get(begin..end).ok_or_else(unfit)?;
            let lowered = self.0.feed(usize::try_from(sender)?, new, &mut found);
            settled.extend(lowered.map(|lowered| (sender, lowered)));
            told.extend(found.iter().map(|one| (k, cells(one))));
            begin = end;
        }
        Ok((settled, told))
    }

    /// The breaks that last until a time of each, with the sender.
    #[allow(clippy::needless_pass_by_value)] // arguments from Python arrive by value
    fn silences(&self, py: Python<'_>, until: PyBuffer<i64>) -> PyResult<Vec<(usize, Break)>> {
        let found = self.0.silences(&until.to_vec(py)?);
        Ok(found.iter().map(|(sender, one)| (*sender, cells(one))).collect())
    }

    /// Another one that grows apart from this.
    fn __deepcopy__(&self, _memo: &Bound<'_, PyAny>) -> Self {
        self.clone()
    }
}

fn cells(one: &paces::Break) -> Break {
    (one.start, one.stop, one.period, one.at, one.kept, one.lowered)
}
