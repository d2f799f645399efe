//! Unpacking and packets for Python: rows of bytes in, columns out.

use bytemuck::{try_cast_slice, Pod};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::PyDict;

use super::buffer::Cells;
use super::tables::{columns, put, Dict};
use crate::bits::spans;
use crate::packets::{find, Carrier, Counter, Family, Spec};
use crate::plan;
use crate::unpack::{unpack, Rows};

/// A layout, checked once.
#[pyclass(frozen)]
pub struct Plan(plan::Plan);

#[pymethods]
impl Plan {
    /// Preorder tokens (kind, number, number); raises `ValueError` on a layout out of bounds.
    #[new]
    #[allow(clippy::needless_pass_by_value)] // arguments from Python arrive by value
    fn new(tokens: Vec<plan::Token>) -> PyResult<Self> {
        plan::Plan::parse(&tokens)
            .map(Plan)
            .map_err(|error| PyValueError::new_err(error.to_string()))
    }

    /// Unpacks rows of `payload` (bounded by i32 `offsets`): what `Group.unpack` gives.
    fn unpack<'py>(&self, py: Python<'py>, offsets: &[u8], payload: &[u8], layouts: &[u8]) -> PyResult<Unpacked<'py>> {
        let spans = spans(aligned(offsets)?, None);
        self.run(py, Rows { spans: &spans, layouts }, payload)
    }
}

impl Plan {
    /// A preorder list of (cells, validity, buffer), the bits left a row (i32) and the flags a row (u8).
    pub fn run<'py>(&self, py: Python<'py>, rows: Rows<'_>, payload: &[u8]) -> PyResult<Unpacked<'py>> {
        let (columns, left, flags) = py.detach(|| {
            let out = unpack(&self.0, rows, payload);
            (out.root.flatten(), out.left, out.dirty)
        });
        let columns = columns
            .into_iter()
            .map(|flat| {
                let own = |buffer: Option<Vec<u8>>| buffer.map(|bytes| Cells::own(py, bytes)).transpose();
                Ok((flat.len, own(flat.validity)?, own(flat.buffer)?))
            })
            .collect::<PyResult<_>>()?;
        Ok((columns, Cells::own(py, left)?, Cells::own(py, flags)?))
    }
}

type Column<'py> = Bound<'py, Cells>;
pub type Unpacked<'py> = (
    Vec<(usize, Option<Column<'py>>, Option<Column<'py>>)>,
    Column<'py>,
    Column<'py>,
);

pub(super) fn aligned<T: Pod>(bytes: &[u8]) -> PyResult<&[T]> {
    try_cast_slice(bytes).map_err(|error| PyValueError::new_err(error.to_string()))
}

/// A family: header, places of ID, count, unit and length, and packets as (ID, length, ends of the sum).
type FamilySpec = (Vec<u8>, usize, usize, usize, usize, Vec<(u8, u16, Vec<u16>)>);

/// Finds packets inside byte arrays and follows their frame counts through the capture.
#[pyclass]
pub struct Packets {
    families: Vec<Family>,
    counter: Counter,
}

#[pymethods]
impl Packets {
    #[new]
    fn new(families: Vec<FamilySpec>) -> Self {
        let spec = |(id, length, checksum_ends)| Spec {
            id,
            length,
            checksum_ends,
        };
        let families = families
            .into_iter()
            .map(|(header, id_at, count_at, unit_at, length_at, packets)| Family {
                header,
                id_at,
                count_at,
                unit_at,
                length_at,
                packets: packets.into_iter().map(spec).collect(),
            })
            .collect();
        Packets {
            families,
            counter: Counter::default(),
        }
    }

    /// Columns of the packets in `data` (bounded by i32 `offsets`), which messages of `type_id` carried; `own` is the
    /// family they should hold, `senders` the buses and source nodes (u8) of the rows.
    fn find<'py>(
        &mut self,
        py: Python<'py>,
        own: usize,
        type_id: u16,
        offsets: &[u8],
        data: &[u8],
        senders: (&[u8], &[u8]),
    ) -> PyResult<Dict<'py>> {
        let offsets: &[i32] = aligned(offsets)?;
        let (found, steps) = py.detach(|| {
            let found = find(&self.families, own, &spans(offsets, None), data);
            let carrier = |(&bus, &src)| Carrier { bus, src, type_id };
            let carriers: Vec<Carrier> = senders.0.iter().zip(senders.1).map(carrier).collect();
            let steps = self.counter.steps(&self.families, &found, &carriers, data);
            (found, steps)
        });
        let dict = columns!(
            py,
            found,
            row,
            offset,
            start,
            len,
            family,
            spec,
            header_ok,
            length_ok,
            complete,
            checksum_ok,
            checksum_end,
            reason
        );
        for (name, values, valid) in [
            ("count_step", &steps.step, &steps.step_valid),
            ("count_step_id", &steps.step_id, &steps.step_id_valid),
        ] {
            put(&dict, name, values)?;
            put(&dict, &format!("{name}_valid"), valid)?;
        }
        Ok(dict)
    }
}
