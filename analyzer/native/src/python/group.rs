//! Transfers of one type for Python: what it needs to know of them without a table.

use std::sync::Arc;

use pyo3::prelude::*;

use super::buffer::{aligned, Cells};
use crate::groups;
use crate::transfers::{Row, Sink as _, Transfers};
use crate::wire::{Id, Kind};

type Column<'py> = PyResult<Bound<'py, Cells>>;

/// The transfers of one type and kind in a batch.
#[pyclass(frozen)]
pub struct Group(pub groups::Group);

#[pymethods]
impl Group {
    /// One made-up transfer of this kind (an index of `KINDS`) and type.
    #[staticmethod]
    fn example(kind: u8, type_id: u16, variant: u8, payload: &[u8]) -> Group {
        let kinds = [Kind::Message, Kind::Anonymous, Kind::Request, Kind::Response];
        let mut transfers = Transfers::default();
        let id = Id {
            kind: kinds[usize::from(kind & 3)],
            type_id,
            src: 0,
            dst: 0,
        };
        transfers.push(&Row::bare(id, payload));
        Group(groups::Group {
            transfers: Arc::new(transfers),
            rows: vec![0],
            kind,
            type_id,
            variant,
        })
    }

    /// Index of `KINDS`; an anonymous message is a message.
    #[getter]
    fn kind(&self) -> u8 {
        self.0.kind
    }

    #[getter]
    fn type_id(&self) -> u16 {
        self.0.type_id
    }

    #[getter]
    fn variant(&self) -> u8 {
        self.0.variant
    }

    fn __len__(&self) -> usize {
        self.0.rows.len()
    }

    /// Those of its rows at the u32 `places`.
    fn pick(&self, places: &[u8]) -> PyResult<Group> {
        Ok(Group(self.0.pick(aligned(places)?)))
    }

    /// The sender of each row, u16: bus << 8 | source.
    fn senders<'py>(&self, py: Python<'py>) -> Column<'py> {
        Cells::own(py, self.0.senders())
    }

    /// Whether the CRC of each row is right, a byte a row.
    fn trusted<'py>(&self, py: Python<'py>) -> Column<'py> {
        Cells::own(py, self.0.trusted())
    }

    /// The senders of rows whose CRC is right, u16, each once, in ascending order.
    fn nodes<'py>(&self, py: Python<'py>) -> Column<'py> {
        Cells::own(py, py.detach(|| self.0.nodes()))
    }

    /// The number of each row in the batch, u32.
    fn rows<'py>(&self, py: Python<'py>) -> Column<'py> {
        Cells::own(py, self.0.rows.clone())
    }
}
