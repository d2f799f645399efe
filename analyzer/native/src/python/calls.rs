//! Requests and responses for Python: columns of transfers in, what is to be said of them out.

use pyo3::buffer::PyBuffer;
use pyo3::prelude::*;

use super::buffer::Cells;
use super::unfit;
use crate::calls::{self, Event, Kept, Limits, Part};

type Column<'py> = Bound<'py, Cells>;
/// What is said (in the order of the core's kinds), of which transfer, and beside which other one, or -1: i64.
type Events<'py> = PyResult<(Column<'py>, Column<'py>, Column<'py>)>;

/// Transfers of services by column; times are i64, the others too.
#[derive(FromPyObject)]
pub struct Given {
    #[pyo3(item(0))]
    link: PyBuffer<i64>,
    #[pyo3(item(1))]
    first: PyBuffer<i64>,
    #[pyo3(item(2))]
    t: PyBuffer<i64>,
    #[pyo3(item(3))]
    t_end: PyBuffer<i64>,
    #[pyo3(item(4))]
    transfer_id: PyBuffer<u8>,
    #[pyo3(item(5))]
    priority: PyBuffer<u8>,
    #[pyo3(item(6))]
    asks: PyBuffer<u8>,
    #[pyo3(item(7))]
    whole: PyBuffer<u8>,
    #[pyo3(item(8))]
    now: PyBuffer<i64>,
    #[pyo3(item(9))]
    row: PyBuffer<i64>,
}

/// Follows calls.
#[pyclass]
#[derive(Clone)]
pub struct Calls(calls::Calls);

#[pymethods]
impl Calls {
    /// Times in ns.
    #[new]
    fn new(answer: i64, slow: i64, open: i64, late: i64, waiting: usize, links: usize) -> Self {
        Calls(calls::Calls::new(Limits {
            answer,
            slow,
            open,
            late,
            waiting,
            links,
        }))
    }

    /// Links with frames that look like responses.
    #[allow(clippy::needless_pass_by_value)] // arguments from Python arrive by value
    fn hold(&mut self, py: Python<'_>, links: PyBuffer<i64>) -> PyResult<()> {
        links.to_vec(py)?.into_iter().for_each(|link| self.0.hold(link));
        Ok(())
    }

    /// Takes transfers of a batch, which are called by their places from `begin` on, and the nodes that were heard first in
    /// rows of it; then the capture has come to `now`, and `end` is the last time.
    #[allow(clippy::needless_pass_by_value)] // arguments from Python arrive by value
    fn feed<'py>(
        &mut self,
        py: Python<'py>,
        given: Given,
        heard: (PyBuffer<i64>, PyBuffer<i64>),
        begin: i64,
        now: i64,
        end: i64,
    ) -> Events<'py> {
        let link = given.link.to_vec(py)?;
        let longs = [&given.first, &given.t, &given.t_end, &given.now, &given.row];
        let [first, t, t_end, times, row] = longs.map(|column| column.to_vec(py));
        let (first, t, t_end, times, row) = (first?, t?, t_end?, times?, row?);
        let bytes = [&given.transfer_id, &given.priority, &given.asks, &given.whole];
        let [transfer_id, priority, asks, whole] = bytes.map(|column| column.to_vec(py));
        let (transfer_id, priority, asks, whole) = (transfer_id?, priority?, asks?, whole?);
        let (rows, nodes) = (heard.0.to_vec(py)?, heard.1.to_vec(py)?);
        let long = [&first, &t, &t_end, &times, &row]
            .iter()
            .all(|one| one.len() == link.len());
        let short = [&transfer_id, &priority, &asks, &whole]
            .iter()
            .all(|one| one.len() == link.len());
        if !long || !short || rows.len() != nodes.len() {
            return Err(unfit());
        }
        let mut events = vec![];
        let mut new = rows.into_iter().zip(nodes).peekable();
        for k in 0..link.len() {
            while let Some((_, node)) = new.next_if(|&(at, _)| at < row[k]) {
                self.0.hear(node);
            }
            self.0.go_on(times[k]);
            let part = Part {
                id: begin + k as i64,
                first: first[k],
                t: t[k],
                t_end: t_end[k],
                transfer_id: transfer_id[k],
                priority: priority[k],
                asks: asks[k] != 0,
                whole: whole[k] != 0,
            };
            self.0.add(link[k], part, end, &mut events);
        }
        new.for_each(|(_, node)| self.0.hear(node));
        self.0.go_on(now);
        self.0.release_all(&mut events);
        columns(py, &events)
    }

    /// The same of all, after the last batch.
    fn finish<'py>(&mut self, py: Python<'py>, end: i64) -> Events<'py> {
        let mut events = vec![];
        self.0.settle_all(end, &mut events);
        columns(py, &events)
    }

    /// Which transfers of the batch that was fed last may still be told, their slots, and the slots that were left: i64.
    ///
    /// From now on they are called by these slots, which are taken once those that were left have no transfer any more.
    fn keep<'py>(&mut self, py: Python<'py>, begin: i64) -> Events<'py> {
        let Kept { new, slots, left } = self.0.keep(begin);
        Ok((Cells::own(py, new)?, Cells::own(py, slots)?, Cells::own(py, left)?))
    }

    /// Another one that grows apart from this.
    fn __deepcopy__(&self, _memo: &Bound<'_, PyAny>) -> Self {
        self.clone()
    }
}

fn columns<'py>(py: Python<'py>, events: &[Event]) -> Events<'py> {
    Ok((
        Cells::own(py, events.iter().map(|one| one.kind as i64).collect())?,
        Cells::own(py, events.iter().map(|one| one.part).collect())?,
        Cells::own(py, events.iter().map(|one| one.other.unwrap_or(-1)).collect())?,
    ))
}
