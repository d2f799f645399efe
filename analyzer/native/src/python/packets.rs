//! Packets for Python: found in what messages carry.

use std::sync::Arc;

use bytemuck::cast_slice;
use pyo3::buffer::PyBuffer;
use pyo3::prelude::*;

use super::buffer::{aligned, Cells, Lent};
use super::group::Group;
use crate::bits::spans;
use crate::packets::cut::{cut, Cut};
use crate::packets::{find, Carrier, Counter, Family, Spec};

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

    /// The packets in the byte arrays of `carriers`, the messages of a batch that begins with transfer `first`: the
    /// arrays are `data`, cut by i32 `offsets`. One for each table; `own` is the family that they should hold.
    fn find(
        &mut self,
        py: Python<'_>,
        own: usize,
        carriers: &Group,
        first: u64,
        offsets: PyBuffer<i8>,
        data: PyBuffer<i8>,
    ) -> PyResult<Vec<PacketRows>> {
        let (offsets, data) = (Lent::of(py, offsets)?, Lent::of(py, data)?);
        let (offsets, data): (&[u8], &[u8]) = (cast_slice(&offsets), cast_slice(&data));
        let tables = py.detach(|| {
            let ends: Vec<i32> = offsets
                .as_chunks()
                .0
                .iter()
                .map(|end| i32::from_le_bytes(*end))
                .collect();
            let found = find(&self.families, own, &spans(&ends, None), data);
            let type_id = carriers.0.type_id;
            let carrier = |node: u16| Carrier {
                bus: (node >> 8) as u8,
                src: node as u8,
                type_id,
            };
            let senders: Vec<Carrier> = carriers.0.senders().into_iter().map(carrier).collect();
            let steps = self.counter.steps(&self.families, &found, &senders, data);
            cut(&found, &steps, data, &Arc::new(carriers.0.clone()), first)
        });
        Ok(tables.into_iter().map(PacketRows).collect())
    }
}

/// The packets of one table in one batch.
#[pyclass(frozen)]
pub struct PacketRows(pub Cut);

#[pymethods]
impl PacketRows {
    /// Family and packet; none for bytes that the profile does not know.
    #[getter]
    fn known(&self) -> Option<(u8, i16)> {
        self.0.known
    }

    fn __len__(&self) -> usize {
        self.0.len()
    }

    /// The sending node of each, u16: bus << 8 | source.
    fn senders<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, Cells>> {
        Cells::own(py, self.0.messages().senders())
    }

    /// Whether each can be relied on, a byte a row: whole, with the right length and checksum, in a transfer with a
    /// good CRC.
    fn sound<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, Cells>> {
        Cells::own(py, self.0.sound())
    }

    /// Places in the order of sending, u64, through the whole capture: transfer row, then byte in the array.
    fn positions<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, Cells>> {
        Cells::own(py, self.0.positions())
    }

    /// Those at the u32 `places`.
    fn pick(&self, places: &[u8]) -> PyResult<PacketRows> {
        Ok(PacketRows(self.0.pick(aligned(places)?)))
    }
}
