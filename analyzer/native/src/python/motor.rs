//! Motors against their own past, for Python.

use pyo3::buffer::PyBuffer;
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;

use super::buffer::Cells;
use crate::motor::{Limits, Orders, Reports, Watch};

type Column<'py> = Bound<'py, Cells>;

/// The numbers that decide, by name.
#[derive(FromPyObject)]
pub struct Given {
    #[pyo3(item)]
    window_ns: i64,
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

/// Reports by column: speed, volts, current, reported, when, first frame.
type Reported = (
    PyBuffer<f64>,
    PyBuffer<f64>,
    PyBuffer<f64>,
    PyBuffer<f64>,
    PyBuffer<i64>,
    PyBuffer<i64>,
);

/// Rows, which of them are off, the last good one before each, shares of speed, current and command; the last good one.
type Compared<'py> = (
    Column<'py>,
    Column<'py>,
    Column<'py>,
    (Column<'py>, Column<'py>, Column<'py>),
    i64,
);

/// Follows one ESC.
#[pyclass]
pub struct MotorWatch(Watch);

#[pymethods]
impl MotorWatch {
    #[new]
    #[allow(clippy::needless_pass_by_value)] // arguments from Python arrive by value
    fn new(limits: Given) -> Self {
        MotorWatch(Watch::new(Limits {
            window_ns: limits.window_ns,
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

    /// Takes the next reports, and the commands of their channel: when, last frame, %.
    #[allow(clippy::needless_pass_by_value)] // arguments from Python arrive by value
    fn feed<'py>(
        &mut self,
        py: Python<'py>,
        reports: Reported,
        orders: (PyBuffer<i64>, PyBuffer<i64>, PyBuffer<f32>),
    ) -> PyResult<Compared<'py>> {
        let (speed, volts, current) = (reports.0.to_vec(py)?, reports.1.to_vec(py)?, reports.2.to_vec(py)?);
        let (reported, ran, frame) = (reports.3.to_vec(py)?, reports.4.to_vec(py)?, reports.5.to_vec(py)?);
        let (when, frame_end, percent) = (orders.0.to_vec(py)?, orders.1.to_vec(py)?, orders.2.to_vec(py)?);
        let reports = Reports {
            speed: &speed,
            volts: &volts,
            current: &current,
            reported: &reported,
            ran: &ran,
            frame: &frame,
        };
        let orders = Orders {
            ran: &when,
            frame_end: &frame_end,
            percent: &percent,
        };
        let found = py
            .detach(|| self.0.feed(&reports, &orders))
            .ok_or_else(|| PyValueError::new_err("columns that do not fit together"))?;
        let shares = (
            Cells::own(py, found.speed)?,
            Cells::own(py, found.current)?,
            Cells::own(py, found.reported)?,
        );
        Ok((
            Cells::own(py, found.rows)?,
            Cells::own(py, found.off)?,
            Cells::own(py, found.before)?,
            shares,
            found.good,
        ))
    }
}
