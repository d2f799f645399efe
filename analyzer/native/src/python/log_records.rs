//! Records of an autopilot's log for Python: bytes of the log in, the bytes of chosen records out.

use pyo3::prelude::*;
use pyo3::types::PyBytes;

use crate::dataflash::{Dataflash, DataflashFormat, KeptTable};
use crate::reader::{Reader, Rows};

/// Name, format characters, column names; the records with their headers, and their numbers as u64.
type Table<'py> = (
    Bound<'py, PyBytes>,
    Bound<'py, PyBytes>,
    Bound<'py, PyBytes>,
    Bound<'py, PyBytes>,
    Bound<'py, PyBytes>,
);

/// A push parser of `ArduPilot`'s dataflash log that keeps records of some names.
#[pyclass]
pub struct LogRecords {
    reader: Dataflash,
    rows: Rows,
    records: u64,
    unreadable: u64,
}

#[pymethods]
impl LogRecords {
    #[new]
    fn new(names: Vec<String>) -> Self {
        let names = names.into_iter().map(String::into_bytes).collect();
        LogRecords {
            reader: Dataflash::of(DataflashFormat::keeping(names)),
            rows: Rows::default(),
            records: 0,
            unreadable: 0,
        }
    }

    /// Takes the next bytes, cut anywhere.
    fn feed(&mut self, py: Python<'_>, chunk: &[u8]) {
        py.detach(|| self.reader.feed(chunk, &mut self.rows));
        self.count();
    }

    /// The input ends here.
    fn finish(&mut self, py: Python<'_>) {
        py.detach(|| self.reader.finish(&mut self.rows));
        self.count();
    }

    /// The records kept since the last call, a table for each way in which the log describes one.
    fn take<'py>(&mut self, py: Python<'py>) -> Vec<Table<'py>> {
        let bytes = |bytes: &[u8]| PyBytes::new(py, bytes);
        let table = |table: &KeptTable| {
            let numbers = bytes(bytemuck::cast_slice(&table.numbers));
            let [name, format, columns] = [&table.name, &table.format, &table.columns].map(|text| bytes(text));
            (name, format, columns, bytes(&table.records), numbers)
        };
        self.reader.format_mut().take().iter().map(table).collect()
    }

    /// Sound records of any name so far.
    #[getter]
    fn records(&self) -> u64 {
        self.records
    }

    /// Places so far that could not be read.
    #[getter]
    fn unreadable(&self) -> u64 {
        self.unreadable
    }

    /// The byte in front of which reading ended early, and why.
    #[getter]
    fn damage(&self) -> Option<(u64, String)> {
        self.reader.damage().map(|damage| (damage.at, damage.reason.clone()))
    }
}

impl LogRecords {
    fn count(&mut self) {
        let counts = self.rows.take().counts;
        self.records += counts.other;
        self.unreadable += counts.unreadable;
    }
}
