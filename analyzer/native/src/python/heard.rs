//! When nodes and their types were heard, for Python.

use pyo3::buffer::PyBuffer;
use pyo3::prelude::*;

use super::buffer::{Cells, Lent};
use super::bus_frames::BusFrames;
use super::unfit;
use crate::heard::by_session::by_session;
use crate::heard::nodes::{self, Frames};
use crate::heard::sessions;
use crate::session_code::of_message;

type Column<'py> = Bound<'py, Cells>;

/// Frames of a batch by column.
#[derive(FromPyObject)]
pub struct Heard {
    t: PyBuffer<i64>,
    bus: PyBuffer<u8>,
    id: PyBuffer<u32>,
    flags: PyBuffer<u16>,
    first: i64,
}

/// Follows the frames of nodes; these are numbers with the bus above 7 bits.
#[pyclass]
#[derive(Clone)]
pub struct HeardNodes {
    nodes: nodes::Nodes,
    asked: u16,
    wanted: u16,
    no_time: i64,
}

#[pymethods]
impl HeardNodes {
    /// Gaps are longer than `least` in ns, `most` are kept of a node. Frames that are a node's have of the flags `asked`
    /// the `wanted` ones, and another time than `no_time`.
    #[new]
    fn new(least: i64, most: usize, asked: u16, wanted: u16, no_time: i64) -> Self {
        HeardNodes {
            nodes: nodes::Nodes::new(least, most),
            asked,
            wanted,
            no_time,
        }
    }

    /// Takes the frames of a batch.
    fn feed(&mut self, py: Python<'_>, frames: Heard) -> PyResult<()> {
        let (t, bus) = (Lent::of(py, frames.t)?, Lent::of(py, frames.bus)?);
        let (id, flags) = (Lent::of(py, frames.id)?, Lent::of(py, frames.flags)?);
        let frames = Frames {
            t: &t,
            bus: &bus,
            id: &id,
            flags: &flags,
            first: frames.first,
            asked: self.asked,
            wanted: self.wanted,
            no_time: self.no_time,
        };
        py.detach(|| self.nodes.feed(&frames)).then_some(()).ok_or_else(unfit)
    }

    /// Notes what is silent up to the end of its bus.
    fn finish(&mut self, bus: usize, end: i64) {
        self.nodes.finish(bus, end);
    }

    /// Nodes whose last frame is before a number, once for each silence: with the number of that frame, and whether the
    /// silence that was told of the node before this one has become a gap.
    fn fell_silent(&mut self, number: i64) -> Vec<(i64, i64, bool)> {
        self.nodes.fell_silent(number)
    }

    /// The number of the oldest frame that is still needed to tell of a node.
    fn oldest(&self, node: i64) -> Option<i64> {
        self.nodes.oldest(node)
    }

    /// The gaps of a node between two times: begin, end, and the number of the frame before each.
    fn between(&self, node: i64, start: i64, stop: i64) -> Vec<(i64, i64, i64)> {
        let found = self.nodes.between(node, start, stop);
        found.map(|gap| (gap.start, gap.stop, gap.number)).collect()
    }

    /// When the longest gap of each node between two times begins and ends, i64: the second time where there is none.
    #[allow(clippy::needless_pass_by_value)] // arguments from Python arrive by value
    fn longest<'py>(
        &self,
        py: Python<'py>,
        nodes: PyBuffer<i64>,
        start: PyBuffer<i64>,
        stop: PyBuffer<i64>,
    ) -> PyResult<(Column<'py>, Column<'py>)> {
        let (nodes, start, stop) = (nodes.to_vec(py)?, start.to_vec(py)?, stop.to_vec(py)?);
        if [start.len(), stop.len()] != [nodes.len(); 2] {
            return Err(unfit());
        }
        let found = nodes
            .iter()
            .zip(start.iter().zip(&stop))
            .map(|(&node, (&start, &stop))| {
                let longest = self.nodes.longest(node, start, stop);
                longest.map_or((stop, stop), |gap| (gap.start, gap.stop))
            });
        let (begins, ends) = found.unzip();
        Ok((Cells::own::<i64>(py, begins)?, Cells::own::<i64>(py, ends)?))
    }

    /// Which nodes lie in a gap at a time, a byte each; `end` is the last time so far.
    #[allow(clippy::needless_pass_by_value)] // arguments from Python arrive by value
    fn silent<'py>(&self, py: Python<'py>, nodes: PyBuffer<i64>, t: PyBuffer<i64>, end: i64) -> PyResult<Column<'py>> {
        let (nodes, t) = (nodes.to_vec(py)?, t.to_vec(py)?);
        if nodes.len() != t.len() {
            return Err(unfit());
        }
        let found = nodes
            .iter()
            .zip(&t)
            .map(|(&node, &t)| u8::from(self.nodes.is_silent(node, t, end)));
        Cells::own(py, found.collect())
    }

    /// Another one that grows apart from this.
    fn __deepcopy__(&self, _memo: &Bound<'_, PyAny>) -> Self {
        self.clone()
    }
}

/// Frames of a bus, which has some rows of a batch or all, one session after the other: places among them, rows, i64, and
/// tail bytes; where sessions begin and the last one ends, and their codes, i64.
#[pyfunction]
#[allow(clippy::type_complexity)]
pub fn frames_by_session(
    py: Python<'_>,
    bus: u8,
    id: PyBuffer<u32>,
    tail: PyBuffer<u8>,
    rows: Option<PyBuffer<i64>>,
) -> PyResult<(Column<'_>, Column<'_>, Column<'_>, Column<'_>, Column<'_>)> {
    let (id, tail) = (Lent::of(py, id)?, Lent::of(py, tail)?);
    let rows = rows.map(|rows| Lent::of(py, rows)).transpose()?;
    let found = py
        .detach(|| by_session(bus, &id, &tail, rows.as_deref()))
        .ok_or_else(unfit)?;
    Ok((
        Cells::own(py, found.place)?,
        Cells::own(py, found.row)?,
        Cells::own(py, found.tail)?,
        Cells::own(py, found.first)?,
        Cells::own(py, found.codes)?,
    ))
}

/// Transfers by column.
#[derive(FromPyObject)]
pub struct Transfers {
    kind: PyBuffer<u8>,
    bus: PyBuffer<u8>,
    src: PyBuffer<u8>,
    type_id: PyBuffer<u16>,
    code: PyBuffer<i64>,
}

/// Follows the frames of sessions.
#[pyclass]
#[derive(Clone)]
pub struct HeardSessions(sessions::Sessions);

#[pymethods]
impl HeardSessions {
    /// Sessions beyond so many are left out.
    #[new]
    fn new(most: usize) -> Self {
        HeardSessions(sessions::Sessions::new(most))
    }

    /// Takes the frames of a bus: codes and places of the sessions in which transfers begin, and how many in each; of
    /// these the times, the numbers of frames, and how many were left out, all i64.
    fn feed<'py>(&mut self, py: Python<'py>, frames: BusFrames, number: i64) -> PyResult<Vec<Column<'py>>> {
        let frames = frames.lent(py)?;
        let sent = frames.sent(number);
        let begun = py.detach(|| self.0.feed(&sent)).ok_or_else(unfit)?;
        let columns = [begun.codes, begun.place, begun.size, begun.t, begun.number, begun.lost];
        columns.into_iter().map(|column| Cells::own(py, column)).collect()
    }

    /// Takes the transfers of a batch, of which those of a `kind` are messages: the places of sessions that have a type
    /// now, in their order, and the types, i64.
    fn prove<'py>(&mut self, py: Python<'py>, transfers: Transfers, kind: u8) -> PyResult<(Column<'py>, Column<'py>)> {
        let (kinds, bus) = (Lent::of(py, transfers.kind)?, Lent::of(py, transfers.bus)?);
        let (src, type_id) = (Lent::of(py, transfers.src)?, Lent::of(py, transfers.type_id)?);
        let code = Lent::of(py, transfers.code)?;
        if [bus.len(), src.len(), type_id.len(), code.len()] != [kinds.len(); 4] {
            return Err(unfit());
        }
        let messages = (0..kinds.len()).filter(|&row| kinds[row] == kind);
        let sent = messages.map(|row| {
            let session = of_message(bus[row], src[row], type_id[row].into());
            (session, code[row])
        });
        let (places, types) = self.0.prove(sent).into_iter().unzip();
        Ok((Cells::own::<i64>(py, places)?, Cells::own::<i64>(py, types)?))
    }

    /// Another one that grows apart from this.
    fn __deepcopy__(&self, _memo: &Bound<'_, PyAny>) -> Self {
        self.clone()
    }
}
