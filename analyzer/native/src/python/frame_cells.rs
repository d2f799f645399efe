//! Frames of the recent past for Python, picked by their numbers from several batches at once.

use pyo3::buffer::PyBuffer;
use pyo3::prelude::*;

use super::buffer::Cells;
use super::diagnosis::FrameIndex;
use crate::diagnosis::index::{Frames, Index};

type Column<'py> = Bound<'py, Cells>;

/// Frames as `candump -l` writes them, in the order of `numbers`, empty ones of those that are gone; `buses` are names.
#[pyfunction]
#[allow(clippy::needless_pass_by_value)] // arguments from Python arrive by value
pub fn frame_lines(
    py: Python<'_>,
    batches: Vec<Bound<'_, FrameIndex>>,
    numbers: PyBuffer<i64>,
    buses: Vec<String>,
) -> PyResult<Vec<String>> {
    let batches: Vec<&Index> = batches.iter().map(|batch| &batch.get().0).collect();
    let line = |number: i64| {
        let found = Frames(&batches).shown(number as u64, &buses);
        found.map_or(String::new(), |frame| frame.line())
    };
    Ok(numbers.to_vec(py)?.into_iter().map(line).collect())
}

/// Which frames are there, a byte each, and their cells, i64: time, bus, identifier, flags, last byte (0 without data).
#[pyfunction]
#[allow(clippy::needless_pass_by_value)] // arguments from Python arrive by value
pub fn frame_cells<'py>(
    py: Python<'py>,
    batches: Vec<Bound<'py, FrameIndex>>,
    numbers: PyBuffer<i64>,
) -> PyResult<(Column<'py>, [Column<'py>; 5])> {
    let batches: Vec<&Index> = batches.iter().map(|batch| &batch.get().0).collect();
    let numbers = numbers.to_vec(py)?;
    let (mut known, mut cells) = (vec![0_u8; numbers.len()], [(); 5].map(|()| vec![0_i64; numbers.len()]));
    for (row, &number) in numbers.iter().enumerate() {
        if let Some(frame) = Frames(&batches).whole(number as u64) {
            known[row] = 1;
            let (bus, id, flags) = (frame.bus.into(), frame.id.into(), frame.flags.into());
            let tail = frame.data.last().map_or(0, |&tail| tail.into());
            for (cell, value) in cells.iter_mut().zip([frame.t, bus, id, flags, tail]) {
                cell[row] = value;
            }
        }
    }
    let [t, bus, id, flags, tail] = cells.map(|column| Cells::own(py, column));
    Ok((Cells::own(py, known)?, [t?, bus?, id?, flags?, tail?]))
}
