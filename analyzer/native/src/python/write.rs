//! Writers for Python: batches in, bytes of a capture out.

use std::collections::HashMap;

use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::{PyBytes, PyDict};

use super::reader::FrameBatch;
use super::Dict;
use crate::write::{self, candump, mcap, pcapng, Account};

/// Rows to the bytes of one format.
#[pyclass]
pub struct Writer(Box<dyn write::Writer>);

#[pymethods]
impl Writer {
    /// `form` is `candump` or `pcapng`; raises `ValueError` for any other. In `recording`s of a live bus no line of
    /// candump depends on those before it: fractions always have 9 digits, and every name can stand in a drop count.
    #[new]
    #[pyo3(signature = (form, recording = false))]
    fn new(form: &str, recording: bool) -> PyResult<Self> {
        let writer: Box<dyn write::Writer> = match form {
            "candump" if recording => Box::new(candump::Candump::recording()),
            "candump" => Box::new(candump::Candump::default()),
            "pcapng" => Box::new(pcapng::Pcapng::default()),
            _ => return Err(PyValueError::new_err(format!("no writer for {form}"))),
        };
        Ok(Writer(writer))
    }

    /// What stands before all rows.
    fn start<'py>(&self, py: Python<'py>) -> Bound<'py, PyBytes> {
        let mut out = vec![];
        self.0.start(&mut out);
        PyBytes::new(py, &out)
    }

    /// The rows of a batch, with `comments` on its frames by row.
    #[pyo3(signature = (batch, comments = None))]
    fn write<'py>(
        &mut self,
        py: Python<'py>,
        batch: &FrameBatch,
        comments: Option<HashMap<usize, String>>,
    ) -> Bound<'py, PyBytes> {
        let mut out = vec![];
        let comments = comments.unwrap_or_default();
        py.detach(|| self.0.write(&batch.0, &comments, &mut out));
        PyBytes::new(py, &out)
    }

    /// Frames written so far.
    #[getter]
    fn frames(&self) -> u64 {
        self.0.account().frames
    }

    /// What could not be written so far, in words, and how often.
    #[getter]
    fn lost<'py>(&self, py: Python<'py>) -> PyResult<Dict<'py>> {
        lost(py, self.0.account())
    }
}

/// The form in which a recording gives rows back, and in which a live session has to decode and judge them.
#[pyclass]
#[derive(Default)]
pub struct AsRecorded(write::recorded::Recorded);

#[pymethods]
impl AsRecorded {
    /// One for each session.
    #[new]
    fn new() -> Self {
        AsRecorded::default()
    }

    /// The rows of the next batch; buses and records are numbered on from the batches before.
    fn apply(&mut self, py: Python<'_>, batch: &FrameBatch) -> FrameBatch {
        FrameBatch(py.detach(|| self.0.apply(&batch.0)))
    }

    /// What does not go through so far, in words, and how often.
    #[getter]
    fn lost<'py>(&self, py: Python<'py>) -> PyResult<Dict<'py>> {
        lost(py, self.0.account())
    }
}

pub(super) type Taken<'py> = (Bound<'py, PyBytes>, Vec<(u16, Bound<'py, PyBytes>, u64)>, (u64, u64));

/// The messages of an MCAP chunk under way.
#[pyclass]
#[derive(Default)]
pub struct Messages(mcap::Messages);

#[pymethods]
impl Messages {
    #[new]
    fn new() -> Self {
        Messages::default()
    }

    /// Appends the rows of a batch from `start` on until `limit` bytes wait; the row to go on with, None at its end.
    fn add(&mut self, py: Python<'_>, batch: &FrameBatch, start: usize, limit: usize) -> Option<usize> {
        py.detach(|| self.0.add(&batch.0, start, limit))
    }

    /// Bytes that wait for `take`.
    #[getter]
    fn waiting(&self) -> usize {
        self.0.waiting()
    }

    /// Bus, direction (0 unknown, 1 received, 2 sent), what the messages are (`frames`, `drops`, `comments`), flag bits
    /// that all frames have though no message says so, and whether there are times, from channel `first` (counted from 0)
    /// on.
    fn channels(&self, first: usize) -> Vec<(String, u8, &'static str, u16, bool)> {
        let channels = self.0.channels().iter().skip(first);
        let row = |one: &mcap::Channel| {
            let (content, flags) = match one.content {
                mcap::Content::Frames(flags) => ("frames", flags),
                mcap::Content::Drops => ("drops", 0),
                mcap::Content::Comments => ("comments", 0),
            };
            (one.bus.clone(), one.direction as u8, content, flags, one.timed)
        };
        channels.map(row).collect()
    }

    /// The messages since the last call, to stand behind `before` further bytes in a chunk: their records, then channel
    /// ID, message index record and number of messages by channel, then first and last time. None if there are none.
    fn take<'py>(&mut self, py: Python<'py>, before: u64) -> Option<Taken<'py>> {
        let chunk = py.detach(|| self.0.take(before))?;
        Some(taken(py, &chunk))
    }

    /// Frames written so far.
    #[getter]
    fn frames(&self) -> u64 {
        self.0.account().frames
    }

    /// What could not be written so far, in words, and how often.
    #[getter]
    fn lost<'py>(&self, py: Python<'py>) -> PyResult<Dict<'py>> {
        lost(py, self.0.account())
    }
}

fn lost<'py>(py: Python<'py>, account: &Account) -> PyResult<Dict<'py>> {
    let dict = PyDict::new(py);
    for (word, count) in account.lost() {
        dict.set_item(word, count)?;
    }
    Ok(dict)
}

/// A chunk as Python gets it.
pub(super) fn taken<'py>(py: Python<'py>, chunk: &mcap::Chunk) -> Taken<'py> {
    let indexes = chunk.indexes.iter();
    let indexes = indexes.map(|(id, record, count)| (*id, PyBytes::new(py, record), *count));
    (PyBytes::new(py, &chunk.messages), indexes.collect(), chunk.span)
}
