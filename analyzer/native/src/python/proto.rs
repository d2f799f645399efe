//! Protocol Buffers for Python: columns in, messages out.

use bytemuck::cast_slice;
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::pybacked::PyBackedBytes;
use pyo3::types::PyBytes;

use super::buffer::aligned;
use super::write::{taken, Taken};
use crate::proto::{encode, Cells, Field};
use crate::write::records::{merged, Batch};

/// A field: number, kind, bitmap of the rows that have it, values, i32 offsets, and what it is made of.
#[derive(FromPyObject)]
pub(super) struct Spec(
    u32,
    String,
    Option<PyBackedBytes>,
    PyBackedBytes,
    PyBackedBytes,
    Vec<Spec>,
);

impl Spec {
    fn field(&self) -> PyResult<Field<'_>> {
        Ok(Field {
            number: self.0,
            valid: self.2.as_deref(),
            cells: self.cells()?,
        })
    }

    fn cells(&self) -> PyResult<Cells<'_>> {
        let values: &[u8] = &self.3;
        Ok(match self.1.as_str() {
            "uint8" => Cells::U8(values),
            "uint16" => Cells::U16(aligned(values)?),
            "uint32" => Cells::U32(aligned(values)?),
            "uint64" => Cells::U64(aligned(values)?),
            "int8" => Cells::I8(aligned(values)?),
            "int16" => Cells::I16(aligned(values)?),
            "int32" => Cells::I32(aligned(values)?),
            "int64" => Cells::I64(aligned(values)?),
            "float" => Cells::F32(aligned(values)?),
            "double" => Cells::F64(aligned(values)?),
            "bool" => Cells::Bool(values),
            "bytes" => Cells::Bytes(aligned(&self.4)?, values),
            "list" => {
                let element = self
                    .5
                    .first()
                    .ok_or_else(|| PyValueError::new_err("a list of nothing"))?;
                Cells::List(aligned(&self.4)?, Box::new(element.cells()?))
            }
            "message" => Cells::Message(fields(&self.5)?),
            other => return Err(PyValueError::new_err(format!("no kind {other}"))),
        })
    }
}

fn fields(specs: &[Spec]) -> PyResult<Vec<Field<'_>>> {
    specs.iter().map(Spec::field).collect()
}

type Messages<'py> = (Bound<'py, PyBytes>, Bound<'py, PyBytes>);

/// One message a row: all of them, and the u64 ends of each. Raises `ValueError` when columns do not fit together.
#[pyfunction]
#[allow(clippy::needless_pass_by_value)] // arguments from Python arrive by value
pub fn protobuf(py: Python<'_>, rows: usize, columns: Vec<Spec>) -> PyResult<Messages<'_>> {
    let fields = fields(&columns)?;
    let (out, ends) = py
        .detach(|| encode(&fields, rows))
        .map_err(|error| PyValueError::new_err(error.to_string()))?;
    Ok((PyBytes::new(py, &out), PyBytes::new(py, cast_slice(&ends))))
}

/// Messages of one kind of table: u16 channel IDs, i64 times, u64 ends, and the messages.
type Encoded = (PyBackedBytes, PyBackedBytes, PyBackedBytes, PyBackedBytes);

/// MCAP message records of encoded messages by time, in chunks of about `limit` bytes, the first one to stand behind
/// `before` further bytes: records, then channel ID, message index record and number of messages by channel, then first
/// and last time. Raises `ValueError` when columns do not fit together.
#[pyfunction]
#[allow(clippy::needless_pass_by_value)] // arguments from Python arrive by value
pub fn message_records(py: Python<'_>, tables: Vec<Encoded>, before: u64, limit: usize) -> PyResult<Vec<Taken<'_>>> {
    let mut batches = Vec::with_capacity(tables.len());
    for (channels, times, ends, data) in &tables {
        let batch = Batch {
            channels: aligned(channels)?,
            times: aligned(times)?,
            ends: aligned(ends)?,
            data,
        };
        if !batch.fits() {
            return Err(PyValueError::new_err("columns do not fit together"));
        }
        batches.push(batch);
    }
    let chunks = py.detach(|| merged(&batches, before, limit));
    Ok(chunks.iter().map(|chunk| taken(py, chunk)).collect())
}
