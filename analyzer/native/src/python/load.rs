//! Bit times of frames for Python.

use bytemuck::cast_slice;
use pyo3::prelude::*;
use pyo3::types::PyBytes;

use super::buffer::aligned;
use crate::load;

/// Bit times of every frame as u16: u32 `id`, u16 `flags`, i32 `offsets` (one entry more than rows) into `data`.
#[pyfunction]
pub fn frame_bits<'py>(
    py: Python<'py>,
    id: &[u8],
    flags: &[u8],
    offsets: &[u8],
    data: &[u8],
) -> PyResult<Bound<'py, PyBytes>> {
    let (id, flags, offsets) = (aligned(id)?, aligned(flags)?, aligned(offsets)?);
    let bits = py.detach(|| load::frame_bits(id, flags, offsets, data));
    Ok(PyBytes::new(py, cast_slice(&bits)))
}
