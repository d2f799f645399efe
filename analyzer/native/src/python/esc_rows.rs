//! Reports of ESCs with what was commanded before them, for Python.

use std::collections::BTreeMap;
use std::ops::Range;

use pyo3::buffer::PyBuffer;
use pyo3::prelude::*;

use super::unfit;
use crate::motor::{CommandLog, Reports};

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

/// The reports of a table, one device after the other, with what was commanded before each of them.
#[pyclass(frozen)]
pub struct EscRows {
    speed: Vec<f64>,
    volts: Vec<f64>,
    current: Vec<f64>,
    pub(super) temperature: Vec<f64>,
    reported: Vec<f64>,
    commanded: [Vec<f64>; 4],
    pub(super) ran: Vec<i64>,
    pub(super) t: Vec<i64>,
    pub(super) step: Vec<i64>,
}

impl EscRows {
    /// Some of them, if there are so many.
    pub(super) fn reports(&self, rows: Range<usize>) -> Option<Reports<'_>> {
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
