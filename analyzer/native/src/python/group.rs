//! Transfers of one type for Python: what it needs to know of them without a table, and the columns of their table.

use std::sync::Arc;

use pyo3::prelude::*;
use pyo3::types::PyDict;

use super::buffer::Cells;
use super::decode::{aligned, Plan, Unpacked};
use super::tables::{bitmap, give, times, Dict};
use crate::groups::{self, REQUEST};
use crate::transfers::{Row, Sink as _, Status, Transfers, NO_GAP, NO_STEP};
use crate::unpack::Rows;
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
        transfers.push(&Row {
            id: Id {
                kind: kinds[usize::from(kind & 3)],
                type_id,
                src: 0,
                dst: 0,
            },
            bus: 0,
            t: 0,
            t_end: 0,
            priority: 0,
            transfer_id: 0,
            status: Status::Unchecked,
            crc_wire: None,
            crc_here: None,
            step: NO_STEP,
            gap: NO_GAP,
            anomaly: 0,
            fd: false,
            known: 0,
            frames: &[],
            payload,
        });
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

    /// Whether each row came as CAN FD, a byte a row.
    fn fd<'py>(&self, py: Python<'py>) -> Column<'py> {
        Cells::own(py, self.0.gather(&self.0.transfers.fd))
    }

    /// The number of each row in the batch, u32.
    fn rows<'py>(&self, py: Python<'py>) -> Column<'py> {
        Cells::own(py, self.0.rows.clone())
    }

    /// Whether the byte at `at` of each row counts those behind it, which begin with `header`; a byte a row.
    fn counted<'py>(&self, py: Python<'py>, at: usize, header: &[u8]) -> Column<'py> {
        Cells::own(py, self.0.counted(at, header))
    }

    /// What stands in front of the fields of a message; the batch begins with transfer `first` of the capture.
    fn context<'py>(&self, py: Python<'py>, first: u64) -> PyResult<Dict<'py>> {
        let (group, of) = (&self.0, &self.0.transfers);
        let dict = PyDict::new(py);
        let numbers = group.rows.iter().map(|&row| first + u64::from(row));
        give(&dict, "transfer", numbers.collect::<Vec<u64>>())?;
        let t = group.gather(&of.t);
        times(&dict, "t_valid", &t)?;
        give(&dict, "t", t)?;
        give(&dict, "bus", group.gather(&of.bus))?;
        give(&dict, "src", group.gather(&of.src))?;
        if group.kind >= REQUEST {
            give(&dict, "dst", group.gather(&of.dst))?;
        }
        give(&dict, "trusted", bitmap(&group.trusted(), |ok| ok != 0))?;
        Ok(dict)
    }

    /// Unpacks every row by a layout code each.
    fn unpack<'py>(&self, py: Python<'py>, plan: &Plan, layouts: &[u8]) -> PyResult<Unpacked<'py>> {
        let spans = self.0.spans();
        plan.run(py, Rows { spans: &spans, layouts }, &self.0.transfers.payload)
    }
}
