//! Frames of a bus, one session after the other, as Python lends them.

use pyo3::buffer::PyBuffer;
use pyo3::prelude::*;

use super::buffer::Lent;
use crate::heard::by_session::Sent;

/// Rows, tail bytes, places, where sessions begin and the last one ends, their codes; times of all rows of the batch.
#[derive(FromPyObject)]
pub struct BusFrames {
    row: PyBuffer<i64>,
    tail: PyBuffer<u8>,
    place: PyBuffer<i64>,
    first: PyBuffer<i64>,
    codes: PyBuffer<i64>,
    times: PyBuffer<i64>,
    forward: bool,
}

/// The same, to be read; time does not go back if it goes `forward`.
pub struct LentFrames {
    row: Lent<i64>,
    tail: Lent<u8>,
    place: Lent<i64>,
    first: Lent<i64>,
    codes: Lent<i64>,
    times: Lent<i64>,
    pub forward: bool,
}

impl BusFrames {
    pub fn lent(self, py: Python<'_>) -> PyResult<LentFrames> {
        Ok(LentFrames {
            row: Lent::of(py, self.row)?,
            tail: Lent::of(py, self.tail)?,
            place: Lent::of(py, self.place)?,
            first: Lent::of(py, self.first)?,
            codes: Lent::of(py, self.codes)?,
            times: Lent::of(py, self.times)?,
            forward: self.forward,
        })
    }
}

impl LentFrames {
    /// Of a batch whose first frame has this number.
    pub fn sent(&self, number: i64) -> Sent<'_> {
        Sent {
            row: &self.row,
            tail: &self.tail,
            place: &self.place,
            first: &self.first,
            codes: &self.codes,
            t: &self.times,
            number,
        }
    }
}
