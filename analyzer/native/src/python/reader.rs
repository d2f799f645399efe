//! Readers for Python: bytes of a capture in, batches of the first tables out.

use std::collections::HashMap;

use bytemuck::Pod;
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::pybacked::PyBackedBytes;
use pyo3::types::PyDict;

use super::buffer::aligned;
use super::tables::{event_columns, frame_columns, Dict};
use crate::candump::Candump;
use crate::counts::Counts;
use crate::dataflash::Dataflash;
use crate::dronecan_log::DronecanLog;
use crate::events::Events;
use crate::frame_batch;
use crate::frames::{Frames, NO_TIME};
use crate::pcap::Pcap;
use crate::pcapng::Pcapng;
use crate::reader;
use crate::stamp::Stamps;

/// Rows of a capture that no engine has seen yet.
#[pyclass(frozen)]
pub struct FrameBatch(pub frame_batch::FrameBatch);

#[pymethods]
impl FrameBatch {
    /// Rows that came out of batches before: `columns()` as (name, bytes), nulls of times as the least number, `*_valid` a
    /// byte a row. Raises `ValueError` when the columns do not fit together.
    #[staticmethod]
    #[allow(clippy::needless_pass_by_value)] // arguments from Python arrive by value
    fn of(frames: Columns, events: Columns, buses: Vec<String>) -> PyResult<FrameBatch> {
        let batch = frame_batch::FrameBatch::of(frames_of(&frames)?, events_of(&events)?, buses);
        batch
            .map(FrameBatch)
            .ok_or_else(|| PyValueError::new_err("columns do not fit together"))
    }

    /// Number of frames.
    #[getter]
    fn frames(&self) -> usize {
        self.0.frames.len()
    }

    /// The columns of frames and events.
    fn columns<'py>(&self, py: Python<'py>) -> PyResult<(Dict<'py>, Dict<'py>)> {
        Ok((frame_columns(py, &self.0.frames)?, event_columns(py, &self.0.events)?))
    }

    /// Some rows of it (u32 row numbers of frames and of events), with counts of these alone.
    fn pick(&self, py: Python<'_>, frames: &[u8], events: &[u8]) -> PyResult<FrameBatch> {
        let (frames, events): (&[u32], &[u32]) = (aligned(frames)?, aligned(events)?);
        Ok(FrameBatch(py.detach(|| self.0.pick(frames, events))))
    }

    /// What became of the records of this batch.
    #[getter]
    fn lines<'py>(&self, py: Python<'py>) -> PyResult<Dict<'py>> {
        lines(py, &self.0.counts)
    }

    /// All interface names so far, by index.
    #[getter]
    fn buses(&self) -> Vec<String> {
        self.0.buses.names().to_vec()
    }

    /// Bits of the kinds of time stamps in this batch.
    #[getter]
    fn stamps(&self) -> u8 {
        self.0.stamps.bits()
    }
}

type Columns = HashMap<String, PyBackedBytes>;

fn column<T: Pod>(columns: &Columns, name: &str) -> PyResult<Vec<T>> {
    let bytes = columns
        .get(name)
        .ok_or_else(|| PyValueError::new_err(format!("no column {name}")))?;
    Ok(aligned::<T>(bytes)?.to_vec())
}

fn frames_of(columns: &Columns) -> PyResult<Frames> {
    Ok(Frames {
        t: column(columns, "t")?,
        bus: column(columns, "bus")?,
        id: column(columns, "id")?,
        flags: column(columns, "flags")?,
        line: column(columns, "line")?,
        offset: column(columns, "data_offset")?,
        data: column(columns, "data")?,
    })
}

fn events_of(columns: &Columns) -> PyResult<Events> {
    let ends = |name| column::<i32>(columns, name).map(|offsets| offsets.get(1..).unwrap_or(&[]).to_vec());
    Ok(Events {
        t: column(columns, "t")?,
        bus: column(columns, "bus")?,
        bus_valid: column(columns, "bus_valid")?,
        line: column(columns, "line")?,
        kind: column(columns, "kind")?,
        class: column(columns, "class")?,
        flags: column(columns, "flags")?,
        tx_errors: column(columns, "tx_errors")?,
        rx_errors: column(columns, "rx_errors")?,
        errors_valid: column(columns, "tx_errors_valid")?,
        data_end: ends("data_offset")?,
        data: column(columns, "data")?,
        text_end: ends("text_offset")?,
        text: column(columns, "text")?,
    })
}

/// Makes batches record by record, for formats that Python reads.
#[pyclass]
#[derive(Default)]
pub struct Rows(reader::Rows);

#[pymethods]
impl Rows {
    #[new]
    fn new() -> Self {
        Rows::default()
    }

    /// A frame; `t` in nanoseconds or None. Raises `ValueError` when there are too many buses.
    fn frame(&mut self, t: Option<i64>, bus: &str, id: u32, flags: u16, data: &[u8]) -> PyResult<()> {
        let bus = self.bus(bus)?;
        self.0.frame(t.unwrap_or(NO_TIME), bus, id, flags, data);
        Ok(())
    }

    /// An error frame with its class bits; of `flags` TX and RX count. Raises `ValueError` when there are too many buses.
    #[pyo3(signature = (t, bus, class_, data, flags = 0))]
    fn error_frame(&mut self, t: Option<i64>, bus: &str, class_: u32, data: &[u8], flags: u16) -> PyResult<()> {
        let bus = self.bus(bus)?;
        self.0.error_frame(t.unwrap_or(NO_TIME), bus, class_, flags, data);
        Ok(())
    }

    /// A damaged record.
    fn unreadable(&mut self, text: &str) {
        self.0.unreadable(NO_TIME, None, text);
    }

    /// The last line of a text that ends without ending the line.
    fn cut_short(&mut self, line: &[u8]) {
        self.0.cut_short(line);
    }

    /// A comment.
    fn comment(&mut self, text: &str) {
        self.0.comment(NO_TIME, text);
    }

    /// Records that have nothing to do with CAN.
    fn other(&mut self, count: u64) {
        self.0.other(count);
    }

    /// Empty lines.
    fn blank(&mut self, count: u64) {
        self.0.blank(count);
    }

    /// Notes kinds of time stamps.
    fn stamp(&mut self, kinds: u8) {
        self.0.stamp(Stamps::from_bits(kinds));
    }

    /// Rows of frames and events that wait for `take`.
    #[getter]
    fn waiting(&self) -> usize {
        self.0.waiting()
    }

    fn take(&mut self) -> FrameBatch {
        FrameBatch(self.0.take())
    }
}

impl Rows {
    fn bus(&mut self, name: &str) -> PyResult<u8> {
        let bus = self.0.bus(name.as_bytes());
        bus.ok_or_else(|| PyValueError::new_err(reader::Rows::too_many_buses()))
    }
}

/// Bytes that are read and put into columns before they leave the cache.
const CACHED: usize = 64 << 10;

/// A push parser of one format.
#[pyclass]
pub struct Reader {
    reader: Box<dyn reader::Reader>,
    rows: reader::Rows,
}

#[pymethods]
impl Reader {
    /// `form` is `candump`, `pcap`, `pcapng`, `dataflash` or `dronecan`; raises `ValueError` for any other.
    #[new]
    fn new(form: &str) -> PyResult<Self> {
        let reader: Box<dyn reader::Reader> = match form {
            "candump" => Box::new(Candump::new()),
            "pcap" => Box::new(Pcap::default()),
            "pcapng" => Box::new(Pcapng::default()),
            "dataflash" => Box::new(Dataflash::default()),
            "dronecan" => Box::new(DronecanLog::default()),
            _ => return Err(PyValueError::new_err(format!("no reader for {form}"))),
        };
        let rows = reader::Rows::default();
        Ok(Reader { reader, rows })
    }

    /// Takes the next bytes, cut anywhere.
    fn feed(&mut self, py: Python<'_>, chunk: &[u8]) {
        py.detach(|| {
            for part in chunk.chunks(CACHED) {
                self.reader.feed(part, &mut self.rows);
            }
        });
    }

    /// The input ends here.
    fn finish(&mut self, py: Python<'_>) {
        py.detach(|| self.reader.finish(&mut self.rows));
    }

    /// Everything since the last call.
    fn take(&mut self) -> FrameBatch {
        FrameBatch(self.rows.take())
    }

    /// Rows of frames and events that wait for `take`.
    #[getter]
    fn waiting(&self) -> usize {
        self.rows.waiting()
    }

    /// The byte in front of which reading ended early, and why.
    #[getter]
    fn damage(&self) -> Option<(u64, String)> {
        self.reader.damage().map(|damage| (damage.at, damage.reason.clone()))
    }
}

/// The terms of the sum that accounts for every line and record.
pub fn lines<'py>(py: Python<'py>, counts: &Counts) -> PyResult<Dict<'py>> {
    let dict = PyDict::new(py);
    dict.set_item("lines", counts.lines)?;
    dict.set_item("frames", counts.frames)?;
    dict.set_item("error_frames", counts.error_frames)?;
    dict.set_item("drops", counts.drops)?;
    dict.set_item("dropped_frames", counts.dropped)?;
    dict.set_item("comments", counts.comments)?;
    dict.set_item("blank", counts.blank)?;
    dict.set_item("unreadable", counts.unreadable)?;
    dict.set_item("other", counts.other)?;
    dict.set_item("repeated", counts.repeated)?;
    Ok(dict)
}
