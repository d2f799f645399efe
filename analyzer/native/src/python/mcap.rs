//! MCAP for Python: stretches of message records in, batches of the first tables out.

use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::PyTuple;

use super::reader::FrameBatch;
use crate::mcap::{Form, Kind, Layout, Role, Walk, Wire, MAX_WAITING};

/// Walks message records and makes rows of those that carry CAN frames.
#[pyclass]
#[derive(Default)]
pub struct McapWalk(Walk);

#[pymethods]
impl McapWalk {
    #[new]
    fn new() -> Self {
        let mut walk = Walk::default();
        walk.asks = true;
        McapWalk(walk)
    }

    /// Says what the messages of a channel look like, again for a change. `bus` names the interface of messages that
    /// name none, `flags` marks frames with what they do not state; without `timed` no frame has a time, whatever
    /// the stamps of its message are. Raises `ValueError` for a bad layout.
    #[pyo3(signature = (id, bus, layout, flags = 0, timed = true))]
    fn channel(&mut self, id: u16, bus: &str, layout: &Bound<'_, PyTuple>, flags: u16, timed: bool) -> PyResult<()> {
        let layout =
            read_layout(layout).map_err(|error| PyValueError::new_err(error.value(layout.py()).to_string()))?;
        self.0.channel(id, bus, layout);
        self.0.mark(id, flags);
        if !timed {
            self.0.untimed(id);
        }
        Ok(())
    }

    /// The next message of this channel, which is neither announced nor ignored, counts as other.
    fn pass_one(&mut self, id: u16) {
        self.0.pass(id);
    }

    /// The messages of this channel count as other.
    fn ignore(&mut self, id: u16) {
        self.0.ignore(id);
    }

    /// Takes consecutive message records from `start` on. Returns the offset where it stopped, always in front of a
    /// record, and why: 0 end of `data`, 1 another opcode, 2 incomplete record, 3 message with an impossible length,
    /// 4 `rows` rows wait, 5 message of a channel that is neither announced nor ignored.
    #[pyo3(signature = (data, start, rows = MAX_WAITING))]
    fn walk(&mut self, py: Python<'_>, data: &[u8], start: usize, rows: usize) -> (usize, u8) {
        let (at, stop) = py.detach(|| self.0.walk(data, start, rows));
        (at, stop as u8)
    }

    /// Where the last message began that the last walk took.
    #[getter]
    fn last(&self) -> usize {
        self.0.last
    }

    /// A damaged record that the caller found.
    fn unreadable(&mut self, text: &str) {
        self.0.unreadable(text);
    }

    /// Sound records that have nothing to do with CAN.
    fn other(&mut self, count: u64) {
        self.0.other(count);
    }

    /// Rows of frames and events that wait for `take`.
    #[getter]
    fn waiting(&self) -> usize {
        self.0.rows.waiting()
    }

    /// The input ends: messages that waited for one that shows how their text is coded are read as assumed.
    fn finish(&mut self) {
        self.0.finish();
    }

    /// Channels and fields (`data`, `id`) whose text was taken for hex, or for decimal numbers, for want of a message
    /// that shows it.
    #[getter]
    fn assumed(&self) -> Vec<(u16, &'static str)> {
        self.0.assumed.clone()
    }

    /// Everything since the last call.
    fn take(&mut self) -> FrameBatch {
        FrameBatch(self.0.take())
    }

    /// Frames and error frames with the recorder's time, for want of their own.
    #[getter]
    fn log_times(&self) -> u64 {
        self.0.log_times
    }

    /// Frames and error frames of channels without times.
    #[getter]
    fn absent_times(&self) -> u64 {
        self.0.absent_times
    }

    /// Frames and error frames with the time that their message states.
    #[getter]
    fn header_times(&self) -> u64 {
        self.0.header_times
    }
}

/// The CRC-32 that MCAP, gzip and zip use, continued from `value`; of the bytes from `start` to in front of `end`.
#[pyfunction]
#[pyo3(signature = (data, value = 0, start = 0, end = usize::MAX))]
pub fn crc32(py: Python<'_>, data: &[u8], value: u32, start: usize, end: usize) -> u32 {
    py.detach(|| {
        let mut hasher = crc32fast::Hasher::new_with_initial(value);
        hasher.update(data.get(start..end.min(data.len())).unwrap_or_default());
        hasher.finalize()
    })
}

fn read_layout(layout: &Bound<'_, PyTuple>) -> PyResult<Layout> {
    let (name, what) = layout.extract::<(String, Bound<'_, PyAny>)>()?;
    match name.as_str() {
        "comments" => Ok(Layout::comments()),
        "drops" => Ok(Layout::drops()),
        "cdr" => ros(Wire::Cdr, &what),
        "ros1" => ros(Wire::Ros1, &what),
        "json" => {
            let fields = what.extract::<Vec<(String, Vec<String>)>>()?;
            let fields = fields.into_iter().map(|(name, path)| Ok((role(&name)?, path)));
            Layout::json(fields.collect::<PyResult<_>>()?).map_err(PyValueError::new_err)
        }
        "protobuf" => {
            let fields = what.extract::<Vec<(String, Vec<u32>, String)>>()?;
            let fields = fields.into_iter().map(|(name, path, form)| {
                let form = Form::named(&form).ok_or_else(|| unknown("wire form", &form))?;
                Ok((role(&name)?, path, form))
            });
            Layout::protobuf(fields.collect::<PyResult<_>>()?).map_err(PyValueError::new_err)
        }
        _ => Err(unknown("layout", &name)),
    }
}

fn ros(wire: Wire, kind: &Bound<'_, PyAny>) -> PyResult<Layout> {
    let name: String = kind.extract()?;
    let kind = Kind::named(&name).ok_or_else(|| unknown("message", &name))?;
    Ok(Layout::ros(wire, kind))
}

fn role(name: &str) -> PyResult<Role> {
    Role::named(name).ok_or_else(|| unknown("role", name))
}

fn unknown(what: &str, name: &str) -> PyErr {
    PyValueError::new_err(format!("no {what} {name}"))
}
