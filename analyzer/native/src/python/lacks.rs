//! Where frames of senders are missing, for Python.

use pyo3::buffer::{Element, PyBuffer};
use pyo3::prelude::*;

use super::buffer::{Cells, Lent};
use super::bus_frames::BusFrames;
use super::unfit;
use crate::joint::known::Ended;
use crate::joint::lacks::{self, Batch, Lack, Limits};

type Column<'py> = Bound<'py, Cells>;
/// Sessions, numbers of the two frames, their times, their places; tail bytes, i64 like all before; windows, frames left,
/// i64; whether they are void, a byte each.
type Rows<'py> = (Vec<Column<'py>>, Column<'py>);

/// Transfers by column.
#[derive(FromPyObject)]
pub struct Transfers {
    kind: PyBuffer<u8>,
    status: PyBuffer<u8>,
    bus: PyBuffer<u8>,
    src: PyBuffer<u8>,
    dst: PyBuffer<u8>,
    type_id: PyBuffer<u16>,
    variant: PyBuffer<u8>,
    t_end: PyBuffer<i64>,
}

/// Follows the tail bytes of all transfers.
#[pyclass]
#[derive(Clone)]
pub struct Lacks(lacks::Lacks);

#[pymethods]
impl Lacks {
    /// Takes how many sessions are remembered, and of joint lacks the frames and times that they are apart, and back.
    #[new]
    fn new(sessions: usize, few: i64, window: i64, widest: i64, reach: i64) -> Self {
        Lacks(lacks::Lacks::new(Limits {
            sessions,
            few,
            window,
            widest,
            reach,
        }))
    }

    /// Whether transfers may prove something new: of these sessions or those that were heard some are not known, or were
    /// left out.
    fn open(&self, py: Python<'_>, codes: PyBuffer<i64>) -> PyResult<bool> {
        Ok(self.0.open(&lent(py, codes)?))
    }

    /// Takes the transfers of a batch: they prove that sessions are what they seem. `defined` says so of the number of a
    /// type. Raises what that raises.
    #[allow(clippy::needless_pass_by_value)] // arguments from Python arrive by value
    fn prove(&mut self, py: Python<'_>, transfers: Transfers, defined: Bound<'_, PyAny>) -> PyResult<()> {
        let ended = Ended {
            kind: &lent(py, transfers.kind)?,
            status: &lent(py, transfers.status)?,
            bus: &lent(py, transfers.bus)?,
            src: &lent(py, transfers.src)?,
            dst: &lent(py, transfers.dst)?,
            type_id: &lent(py, transfers.type_id)?,
            variant: &lent(py, transfers.variant)?,
            t_end: &lent(py, transfers.t_end)?,
        };
        let defined = |code| defined.call1((code,))?.extract();
        self.0.known.prove(&ended, defined)?.ok_or_else(unfit)
    }

    /// Takes the frames of a bus in a batch whose first frame has a number, and the flags of all frames of that.
    fn feed(&mut self, py: Python<'_>, bus: u8, frames: BusFrames, number: i64, flags: PyBuffer<u16>) -> PyResult<()> {
        let (frames, flags) = (frames.lent(py)?, lent(py, flags)?);
        let batch = Batch {
            bus,
            sent: frames.sent(number),
            flags: &flags,
            forward: frames.forward,
        };
        let fits = py.detach(|| self.0.feed(&batch));
        fits.then_some(()).ok_or_else(unfit)
    }

    /// All that is missing since the last time, in the order of the frames behind it, and frames behind which nothing is
    /// missing after all.
    fn take<'py>(&mut self, py: Python<'py>) -> PyResult<(Rows<'py>, Column<'py>)> {
        let (found, gone) = self.0.take();
        let column = |of: fn(&Lack) -> i64| Cells::own(py, found.iter().map(of).collect());
        let columns = vec![
            column(|one| one.session)?,
            column(|one| one.number)?,
            column(|one| one.behind)?,
            column(|one| one.since)?,
            column(|one| one.until)?,
            column(|one| one.place)?,
            column(|one| one.place_behind)?,
            column(|one| one.tail.into())?,
            column(|one| one.wanted.into())?,
            column(|one| one.window)?,
            column(|one| one.left)?,
        ];
        let void = Cells::own(py, found.iter().map(|one| u8::from(one.void)).collect())?;
        Ok(((columns, void), Cells::own(py, gone)?))
    }

    /// Whether each session was known up to a time `within` after another one, a byte each.
    fn known<'py>(
        &self,
        py: Python<'py>,
        sessions: PyBuffer<i64>,
        times: PyBuffer<i64>,
        within: i64,
    ) -> PyResult<Column<'py>> {
        let (sessions, times) = (lent(py, sessions)?, lent(py, times)?);
        if sessions.len() != times.len() {
            return Err(unfit());
        }
        let known = |(&code, &t): (&i64, &i64)| u8::from(self.0.known.since(code) <= t.saturating_add(within));
        Cells::own(py, sessions.iter().zip(&*times).map(known).collect())
    }

    /// When each node of a bus that sends messages became known, in the order of these times.
    fn nodes<'py>(&self, py: Python<'py>, bus: u8) -> PyResult<Column<'py>> {
        Cells::own(py, self.0.known.nodes(bus))
    }

    /// Another one that grows apart from this.
    fn __deepcopy__(&self, _memo: &Bound<'_, PyAny>) -> Self {
        self.clone()
    }
}

fn lent<T: Element>(py: Python<'_>, column: PyBuffer<T>) -> PyResult<Lent<T>> {
    Lent::of(py, column)
}
