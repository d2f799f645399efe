//! Motors against their own past, for Python.

use pyo3::buffer::PyBuffer;
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;

use super::buffer::Cells;
use crate::motor::{ordered, Limits, Orders, Reports, SumLimits, Sums, Times, Watch};

type Column<'py> = Bound<'py, Cells>;

/// The numbers that decide, by name.
#[derive(FromPyObject)]
pub struct Given {
    #[pyo3(item)]
    learned: f64,
    #[pyo3(item)]
    steady_percent: f64,
    #[pyo3(item)]
    even_percent: f64,
    #[pyo3(item)]
    slow: f64,
    #[pyo3(item)]
    fast: f64,
    #[pyo3(item)]
    unloaded: f64,
    #[pyo3(item)]
    dragged: f64,
    #[pyo3(item)]
    worn: f64,
    #[pyo3(item)]
    many: u32,
    #[pyo3(item)]
    far: f64,
    #[pyo3(item)]
    least_a: f64,
    #[pyo3(item)]
    sag_begun: f64,
}

/// Reports by column: speed, volts, current, reported.
type Reported = (PyBuffer<f64>, PyBuffer<f64>, PyBuffer<f64>, PyBuffer<f64>);
/// What was commanded before each: the lowest, the highest, the mean and the last.
type Commanded = (PyBuffer<f64>, PyBuffer<f64>, PyBuffer<f64>, PyBuffer<f64>);

/// Which reports are off, the last good one before each, shares of speed, current and command; the last good one.
type Compared<'py> = (Column<'py>, Column<'py>, (Column<'py>, Column<'py>, Column<'py>), i64);

/// Follows one ESC.
#[pyclass]
pub struct MotorWatch(Watch);

#[pymethods]
impl MotorWatch {
    #[new]
    #[allow(clippy::needless_pass_by_value)] // arguments from Python arrive by value
    fn new(limits: Given) -> Self {
        MotorWatch(Watch::new(Limits {
            learned: limits.learned,
            steady_percent: limits.steady_percent,
            even_percent: limits.even_percent,
            slow: limits.slow,
            fast: limits.fast,
            unloaded: limits.unloaded,
            dragged: limits.dragged,
            worn: limits.worn,
            many: limits.many,
            far: limits.far,
            least_a: limits.least_a,
            sag_begun: limits.sag_begun,
        }))
    }

    /// Takes the next reports, all of them with commands before them.
    #[allow(clippy::needless_pass_by_value)] // arguments from Python arrive by value
    fn feed<'py>(&mut self, py: Python<'py>, reports: Reported, commanded: Commanded) -> PyResult<Compared<'py>> {
        let own = Owned::of(py, &reports, &commanded)?;
        let found = py.detach(|| self.0.feed(&own.reports())).ok_or_else(unfit)?;
        let shares = (
            Cells::own(py, found.speed)?,
            Cells::own(py, found.current)?,
            Cells::own(py, found.reported)?,
        );
        Ok((
            Cells::own(py, found.off)?,
            Cells::own(py, found.before)?,
            shares,
            found.good,
        ))
    }
}

/// The numbers that decide of sums, by name.
#[derive(FromPyObject)]
pub struct GivenSums {
    #[pyo3(item)]
    idle_rpm: f64,
    #[pyo3(item)]
    idle_percent: f64,
    #[pyo3(item)]
    least_a: f64,
    #[pyo3(item)]
    steady_percent: f64,
    #[pyo3(item)]
    steady_speed: f64,
    #[pyo3(item)]
    pause: i64,
    #[pyo3(item)]
    late_periods: f64,
}

/// When reports came: times while it was recorded, times, steps of transfer IDs; the first slot, and ns of each.
type Came = (PyBuffer<i64>, PyBuffer<i64>, PyBuffer<i64>, i64, i64);
/// Numbers and sums by kind, slot and bin; both by slot; counts by slot; times of the first report of each slot.
type Summed<'py> = (Column<'py>, Column<'py>, Column<'py>, Column<'py>, Column<'py>);

/// Adds up the reports of one ESC.
#[pyclass]
pub struct MotorSums(Sums);

#[pymethods]
impl MotorSums {
    #[new]
    #[allow(clippy::needless_pass_by_value)] // arguments from Python arrive by value
    fn new(limits: GivenSums) -> Self {
        MotorSums(Sums::new(SumLimits {
            idle_rpm: limits.idle_rpm,
            idle_percent: limits.idle_percent,
            least_a: limits.least_a,
            steady_percent: limits.steady_percent,
            steady_speed: limits.steady_speed,
            pause: limits.pause,
            late_periods: limits.late_periods,
        }))
    }

    /// Takes the next reports.
    #[allow(clippy::needless_pass_by_value)] // arguments from Python arrive by value
    fn feed(
        &mut self,
        py: Python<'_>,
        reports: Reported,
        temperature: PyBuffer<f64>,
        commanded: Commanded,
        came: Came,
    ) -> PyResult<()> {
        let temperature = temperature.to_vec(py)?;
        let (ran, t, step) = (came.0.to_vec(py)?, came.1.to_vec(py)?, came.2.to_vec(py)?);
        let times = Times {
            ran: &ran,
            t: &t,
            step: &step,
        };
        let own = Owned::of(py, &reports, &commanded)?;
        py.detach(|| self.0.feed(&own.reports(), &temperature, &times, came.3, came.4))
            .ok_or_else(unfit)
    }

    /// Makes one slot of two.
    fn halve(&mut self) {
        self.0.halve();
    }

    /// The sums so far.
    fn sums<'py>(&self, py: Python<'py>) -> PyResult<Summed<'py>> {
        let sums = &self.0;
        Ok((
            Cells::own(py, sums.count.as_flattened().to_vec())?,
            Cells::own(py, sums.total.as_flattened().to_vec())?,
            Cells::own(py, sums.measured.as_flattened().as_flattened().to_vec())?,
            Cells::own(py, sums.counted.as_flattened().to_vec())?,
            Cells::own(py, sums.first.as_flattened().to_vec())?,
        ))
    }
}

/// Columns of reports, taken over from Python.
struct Owned([Vec<f64>; 8]);

impl Owned {
    fn of(py: Python<'_>, reports: &Reported, commanded: &Commanded) -> PyResult<Self> {
        Ok(Owned([
            reports.0.to_vec(py)?,
            reports.1.to_vec(py)?,
            reports.2.to_vec(py)?,
            reports.3.to_vec(py)?,
            commanded.0.to_vec(py)?,
            commanded.1.to_vec(py)?,
            commanded.2.to_vec(py)?,
            commanded.3.to_vec(py)?,
        ]))
    }

    fn reports(&self) -> Reports<'_> {
        let [speed, volts, current, reported, commanded @ ..] = &self.0;
        Reports {
            speed,
            volts,
            current,
            reported,
            commanded: commanded.each_ref().map(Vec::as_slice),
        }
    }
}

/// The command before each report, by times and first frames; of commands: when, last frame, %; NaN for none.
#[pyfunction]
#[pyo3(name = "ordered")]
#[allow(clippy::needless_pass_by_value)] // arguments from Python arrive by value
pub fn ordered_before(
    py: Python<'_>,
    orders: (PyBuffer<i64>, PyBuffer<i64>, PyBuffer<f32>),
    ran: PyBuffer<i64>,
    frame: PyBuffer<i64>,
    window_ns: i64,
) -> PyResult<(Column<'_>, Column<'_>, Column<'_>, Column<'_>)> {
    let (when, frame_end, percent) = (orders.0.to_vec(py)?, orders.1.to_vec(py)?, orders.2.to_vec(py)?);
    let (ran, frame) = (ran.to_vec(py)?, frame.to_vec(py)?);
    let orders = Orders {
        ran: &when,
        frame_end: &frame_end,
        percent: &percent,
    };
    let found = py.detach(|| ordered(&orders, &ran, &frame, window_ns));
    let [lowest, highest, mean, last] = found.ok_or_else(unfit)?;
    Ok((
        Cells::own(py, lowest)?,
        Cells::own(py, highest)?,
        Cells::own(py, mean)?,
        Cells::own(py, last)?,
    ))
}

fn unfit() -> PyErr {
    PyValueError::new_err("columns that do not fit together")
}
