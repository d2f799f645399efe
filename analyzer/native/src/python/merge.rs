//! Merging for Python: batches of several captures in, batches of one out.

use pyo3::prelude::*;

use super::reader::FrameBatch;
use crate::merge::meeting;
use crate::merge::{self, Entry};

/// Nanoseconds to add to the times of a capture, and new names of its interfaces (None fits all).
type EntrySpec = (i64, Vec<(Option<String>, String)>);

/// Several captures as one, in the order of their times.
#[pyclass]
pub struct Merger(merge::Merger);

#[pymethods]
impl Merger {
    #[new]
    fn new(entries: Vec<EntrySpec>, same_bus: bool) -> Self {
        let entry = |(offset, names)| Entry { offset, names };
        Merger(merge::Merger::new(entries.into_iter().map(entry).collect(), same_bus))
    }

    /// The next rows of a capture; `label` names it beside records that cannot be read.
    fn push(&mut self, index: usize, batch: &FrameBatch, label: &str) {
        self.0.push(index, batch.0.clone(), label);
    }

    /// A capture has ended.
    fn finish(&mut self, index: usize) {
        self.0.finish(index);
    }

    /// The capture that has to deliver next; None once all have ended.
    #[getter]
    fn awaited(&self) -> Option<usize> {
        self.0.awaited()
    }

    /// All rows that nothing can come before any more.
    fn take(&mut self, py: Python<'_>) -> FrameBatch {
        FrameBatch(py.detach(|| self.0.take()))
    }

    /// All rows up to the latest one that had come at the last call: for buses, which do not wait for each other.
    fn take_later(&mut self, py: Python<'_>) -> FrameBatch {
        FrameBatch(py.detach(|| self.0.take_later()))
    }
}

/// The frames by which two captures of one bus are recognised.
#[pyclass]
#[derive(Default)]
pub struct Fingerprint(meeting::Fingerprint);

#[pymethods]
impl Fingerprint {
    #[new]
    fn new() -> Self {
        Fingerprint::default()
    }

    fn add(&mut self, py: Python<'_>, batch: &FrameBatch) {
        py.detach(|| self.0.add(&batch.0.frames));
    }

    /// The earliest time of any frame.
    #[getter]
    fn start(&self) -> Option<i64> {
        self.0.start()
    }

    /// Nanoseconds to add to the other's times and how many frames say so; None if the two did not meet.
    fn meet(&self, py: Python<'_>, other: &Fingerprint) -> Option<(i64, usize)> {
        let meeting = py.detach(|| self.0.meet(&other.0));
        meeting.map(|meeting| (meeting.offset, meeting.frames))
    }
}
