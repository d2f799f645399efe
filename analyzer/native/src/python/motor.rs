//! Motors against their own past, for Python.

use std::collections::BTreeMap;

use pyo3::buffer::PyBuffer;
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;

use super::buffer::Cells;
use crate::motor::{self, CommandLog, Limits, Reports, SumLimits, Sums, Times, Watch, WELL};

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
    #[pyo3(item("given"))]
    obeyed: f64,
    #[pyo3(item)]
    sag_begun: f64,
}

/// Reports by column: speed, volts, current, reported.
type Reported = (PyBuffer<f64>, PyBuffer<f64>, PyBuffer<f64>, PyBuffer<f64>);
/// What was commanded before each: the lowest, the highest, the mean and the last.
type Commanded = (PyBuffer<f64>, PyBuffer<f64>, PyBuffer<f64>, PyBuffer<f64>);

/// Which reports are off, the last ones before each that were well, each in so many ways, shares of speed, current and
/// command; the last ones that were well.
type Compared<'py> = (
    Column<'py>,
    Column<'py>,
    (Column<'py>, Column<'py>, Column<'py>),
    [i64; WELL],
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
            given: limits.obeyed,
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
            Cells::own(py, found.before.into_flattened())?,
            shares,
            found.well,
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

/// The supply voltage that a current explains.
#[pyclass]
#[derive(Default)]
pub struct SupplyLine(motor::SupplyLine);

#[pymethods]
impl SupplyLine {
    #[new]
    fn new() -> Self {
        Self::default()
    }

    /// Takes reports of one device, in order; what was to be expected of each, NaN where nothing is known.
    #[allow(clippy::needless_pass_by_value)] // arguments from Python arrive by value
    fn feed<'py>(&mut self, py: Python<'py>, volts: PyBuffer<f64>, amperes: PyBuffer<f64>) -> PyResult<Column<'py>> {
        let (volts, amperes) = (volts.to_vec(py)?, amperes.to_vec(py)?);
        Cells::own(py, self.0.feed(&volts, &amperes).ok_or_else(unfit)?)
    }
}

/// Reports of one ESC: its bus, the channel that it is commanded by, from which row on and up to which one.
type Device = (i64, i64, usize, usize);

/// The commands of all buses.
#[pyclass]
pub struct RecentOrders {
    window: i64,
    most: usize,
    buses: BTreeMap<i64, CommandLog>,
}

#[pymethods]
impl RecentOrders {
    #[new]
    fn new(window_ns: i64, most: usize) -> Self {
        RecentOrders {
            window: window_ns,
            most,
            buses: BTreeMap::new(),
        }
    }

    /// Takes the next commands of a bus; the first of their channels has the number `first`.
    #[allow(clippy::needless_pass_by_value)] // arguments from Python arrive by value
    fn feed(
        &mut self,
        py: Python<'_>,
        place: (i64, usize),
        ran: PyBuffer<i64>,
        frame_end: PyBuffer<i64>,
        percent: PyBuffer<f32>,
    ) -> PyResult<()> {
        let (bus, first) = place;
        let (ran, frame_end, percent) = (ran.to_vec(py)?, frame_end.to_vec(py)?, percent.to_vec(py)?);
        let log = self
            .buses
            .entry(bus)
            .or_insert_with(|| CommandLog::new(self.window, self.most));
        log.feed(first, &ran, &frame_end, &percent).ok_or_else(unfit)
    }

    /// The command before each report, by times and first frames: lowest, highest, mean and last, in %; NaN for none.
    #[allow(clippy::needless_pass_by_value)] // arguments from Python arrive by value
    fn before<'py>(
        &self,
        py: Python<'py>,
        devices: Vec<Device>,
        ran: PyBuffer<i64>,
        frame: PyBuffer<i64>,
    ) -> PyResult<(Column<'py>, Column<'py>, Column<'py>, Column<'py>)> {
        let (ran, frame) = (ran.to_vec(py)?, frame.to_vec(py)?);
        let [lowest, highest, mean, last] = py.detach(|| self.found(&devices, &ran, &frame)).ok_or_else(unfit)?;
        Ok((
            Cells::own(py, lowest)?,
            Cells::own(py, highest)?,
            Cells::own(py, mean)?,
            Cells::own(py, last)?,
        ))
    }
}

impl RecentOrders {
    fn found(&self, devices: &[Device], ran: &[i64], frame: &[i64]) -> Option<[Vec<f64>; 4]> {
        let mut all = std::array::from_fn(|_| vec![f64::NAN; ran.len()]);
        for &(bus, channel, start, stop) in devices {
            let (ran, frame) = (ran.get(start..stop)?, frame.get(start..stop)?);
            let channel = usize::try_from(channel).ok()?;
            let Some(found) = self.buses.get(&bus).and_then(|log| log.before(channel, ran, frame)) else {
                continue;
            };
            for (column, values) in all.iter_mut().zip(found) {
                column[start..stop].copy_from_slice(&values);
            }
        }
        Some(all)
    }
}

fn unfit() -> PyErr {
    PyValueError::new_err("columns that do not fit together")
}
