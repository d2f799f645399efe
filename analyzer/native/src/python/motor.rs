//! Motors against their own past, for Python.

use pyo3::buffer::PyBuffer;
use pyo3::prelude::*;

use super::buffer::Cells;
use super::esc_rows::EscRows;
use super::unfit;
use crate::motor::{self, Limits, Picked, Reports, SumLimits, Sums, Times, Watch, WELL};

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

/// Which reports are off, the last ones before each that were well, each in so many ways, shares of speed, current and
/// command.
type Off<'py> = (Column<'py>, Column<'py>, (Column<'py>, Column<'py>, Column<'py>));
/// The rows that count, None for all; what is off, None for nothing; the last ones of them that were well, and the first
/// one that was so by its past.
type Compared<'py> = (Option<Column<'py>>, Option<Off<'py>>, [i64; WELL], i64);

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
            return Ok((kept.transpose()?, None, found.well, found.learned));
        }
        let shares = (
            Cells::own(py, found.speed)?,
            Cells::own(py, found.current)?,
            Cells::own(py, found.reported)?,
        );
        let before = Cells::own(py, found.before.into_flattened())?;
        let off = (Cells::own(py, found.off)?, before, shares);
        Ok((kept.transpose()?, Some(off), found.well, found.learned))
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

    /// Numbers and sums by kind, slot and bin.
    fn bins<'py>(&self, py: Python<'py>) -> PyResult<(Column<'py>, Column<'py>)> {
        let [count, total] = [self.0.binned.count(), self.0.binned.total()].map(Vec::into_flattened);
        Ok((Cells::own(py, count)?, Cells::own(py, total)?))
    }

    /// Numbers and sums by slot, counts by slot, times of the first report of each slot.
    fn slots<'py>(&self, py: Python<'py>) -> PyResult<(Column<'py>, Column<'py>, Column<'py>)> {
        let sums = &self.0;
        Ok((
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
