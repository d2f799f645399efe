//! Motors against their own past, for Python.

use std::collections::BTreeMap;
use std::ops::Range;

use pyo3::buffer::PyBuffer;
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;

use super::buffer::Cells;
use crate::motor::{self, CommandLog, Limits, Picked, Reports, SumLimits, Sums, Times, Watch, WELL};

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

/// Reports by column, NaN where they say nothing: speed, volts, current, temperature, reported.
type Reported = (
    PyBuffer<f64>,
    PyBuffer<f64>,
    PyBuffer<f64>,
    PyBuffer<f64>,
    PyBuffer<f64>,
);
/// When they came: times while it was recorded, times, steps of transfer IDs, first frames.
type Came = (PyBuffer<i64>, PyBuffer<i64>, PyBuffer<i64>, PyBuffer<i64>);
/// Which reports are off, the last ones before each that were well, each in so many ways, shares of speed, current and
/// command.
type Off<'py> = (Column<'py>, Column<'py>, (Column<'py>, Column<'py>, Column<'py>));
/// The rows that count, None for all; what is off, None for nothing; the last ones of them that were well.
type Compared<'py> = (Option<Column<'py>>, Option<Off<'py>>, [i64; WELL]);

/// The reports of a table, one device after the other, with what was commanded before each of them.
#[pyclass(frozen)]
pub struct EscRows {
    speed: Vec<f64>,
    volts: Vec<f64>,
    current: Vec<f64>,
    temperature: Vec<f64>,
    reported: Vec<f64>,
    commanded: [Vec<f64>; 4],
    ran: Vec<i64>,
    t: Vec<i64>,
    step: Vec<i64>,
}

impl EscRows {
    fn reports(&self, rows: Range<usize>) -> Option<Reports<'_>> {
        let part = |column: &'_ Vec<f64>| column.get(rows.clone()).is_some();
        let columns = [&self.speed, &self.volts, &self.current, &self.reported];
        if !columns.into_iter().chain(&self.commanded).all(part) {
            return None;
        }
        Some(Reports {
            speed: &self.speed[rows.clone()],
            volts: &self.volts[rows.clone()],
            current: &self.current[rows.clone()],
            reported: &self.reported[rows.clone()],
            commanded: self.commanded.each_ref().map(|column| &column[rows.clone()]),
        })
    }
}

#[pymethods]
impl EscRows {
    /// Whether any of some rows has a speed, a voltage and commands before it.
    fn some_whole(&self, start: usize, stop: usize) -> PyResult<bool> {
        let reports = self.reports(start..stop).ok_or_else(unfit)?;
        Ok((0..stop - start).any(|row| reports.is_whole(row)))
    }
}

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

    /// Takes the next reports; those that have no speed, voltage or commands before them do not count.
    fn feed<'py>(
        &mut self,
        py: Python<'py>,
        reports: &Bound<'py, EscRows>,
        start: usize,
        stop: usize,
    ) -> PyResult<Compared<'py>> {
        let reports = reports.get().reports(start..stop).ok_or_else(unfit)?;
        let kept: Vec<usize> = (0..stop - start).filter(|&row| reports.is_whole(row)).collect();
        let whole = kept.len() == stop - start;
        let found = py.detach(|| {
            if whole {
                return self.0.feed(&reports);
            }
            let Picked { reports, commanded } = reports.pick(&kept);
            let [speed, volts, current, reported] = &reports;
            self.0.feed(&Reports {
                speed,
                volts,
                current,
                reported,
                commanded: commanded.each_ref().map(Vec::as_slice),
            })
        });
        let found = found.ok_or_else(unfit)?;
        let kept = (!whole).then(|| Cells::own(py, kept.iter().map(|&row| row as i64).collect()));
        if found.off.iter().all(|&off| off == 0) {
            return Ok((kept.transpose()?, None, found.well));
        }
        let shares = (
            Cells::own(py, found.speed)?,
            Cells::own(py, found.current)?,
            Cells::own(py, found.reported)?,
        );
        let before = Cells::own(py, found.before.into_flattened())?;
        let off = (Cells::own(py, found.off)?, before, shares);
        Ok((kept.transpose()?, Some(off), found.well))
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

    /// Takes the next reports, in slots of `width` ns from `begin` on.
    #[pyo3(signature = (reports, start, stop, begin, width))]
    fn feed(
        &mut self,
        py: Python<'_>,
        reports: &Bound<'_, EscRows>,
        start: usize,
        stop: usize,
        begin: i64,
        width: i64,
    ) -> PyResult<()> {
        let all = reports.get();
        let reports = all.reports(start..stop).ok_or_else(unfit)?;
        let times = Times {
            ran: &all.ran[start..stop],
            t: &all.t[start..stop],
            step: &all.step[start..stop],
        };
        let temperature = &all.temperature[start..stop];
        py.detach(|| self.0.feed(&reports, temperature, &times, begin, width))
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

    /// The reports of devices, which stand in their order, with what was commanded before each; nothing before others.
    #[allow(clippy::needless_pass_by_value)] // arguments from Python arrive by value
    fn rows(&self, py: Python<'_>, devices: Vec<Device>, values: Reported, came: Came) -> PyResult<EscRows> {
        let (ran, frame) = (came.0.to_vec(py)?, came.3.to_vec(py)?);
        let mut speed = values.0.to_vec(py)?;
        let (volts, current, temperature) = (values.1.to_vec(py)?, values.2.to_vec(py)?, values.3.to_vec(py)?);
        let (reported, t, step) = (values.4.to_vec(py)?, came.1.to_vec(py)?, came.2.to_vec(py)?);
        let long = [
            volts.len(),
            current.len(),
            temperature.len(),
            reported.len(),
            t.len(),
            step.len(),
            ran.len(),
        ];
        if long != [speed.len(); 7] || frame.len() != speed.len() {
            return Err(unfit());
        }
        let commanded = py.detach(|| {
            for speed in &mut speed {
                *speed = speed.abs();
            }
            self.found(&devices, &ran, &frame)
        });
        Ok(EscRows {
            speed,
            volts,
            current,
            temperature,
            reported,
            commanded: commanded.ok_or_else(unfit)?,
            ran,
            t,
            step,
        })
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
