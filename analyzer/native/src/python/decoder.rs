//! Descriptions of tables for Python: a decoder is told what to make, and makes it of whole groups.

use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;

use super::buffer::Cells;
use super::group::Group;
use super::packets::PacketRows;
use crate::decoder;
use crate::decoder::length::{Length, Limit};
use crate::decoder::make::{Formula, Look, Make, Measure, Piece};
use crate::decoder::number::Linear;
use crate::decoder::packet::{context, Order, Wrap};
use crate::decoder::unwrap::Unwrapper;
use crate::plan::{Plan, Token};
use crate::unpack::column::Column;
use crate::unpack::ipc::record_batch;

/// A table as a message of Arrow's IPC format.
pub type Table<'py> = PyResult<Bound<'py, Cells>>;
/// Times, by, plus.
type Steps = (f64, f64, f64);

/// A type or packet with what its profile makes of it, told column by column.
#[pyclass]
pub struct Decoder(decoder::Decoder);

fn linear((times, by, plus): Steps) -> Linear {
    Linear { times, by, plus }
}

pub fn handed_over(py: Python<'_>, columns: impl FnOnce() -> Vec<Column> + Send) -> Table<'_> {
    Cells::own(py, py.detach(|| record_batch(columns())))
}

#[pymethods]
impl Decoder {
    /// Preorder tokens (kind, number, number); raises `ValueError` on a layout out of bounds.
    #[new]
    #[allow(clippy::needless_pass_by_value)] // arguments from Python arrive by value
    fn new(tokens: Vec<Token>) -> PyResult<Self> {
        match Plan::parse(&tokens) {
            Ok(plan) => Ok(Decoder(decoder::Decoder::new(plan))),
            Err(error) => Err(PyValueError::new_err(error.to_string())),
        }
    }

    /// A row has a length in front of its tail array if the byte at `at` counts those behind it, which begin with
    /// `header`.
    fn length_counts(&mut self, at: usize, header: Vec<u8>) {
        self.0.length = Length::Counted { at, header };
    }

    /// A row has a length in front of its tail array if it fits and numbers are inside limits: (field, low, high,
    /// special raw values).
    fn length_fits(&mut self, limits: Vec<(usize, f64, f64, Vec<u64>)>) {
        let limit = |(field, low, high, special)| Limit {
            field,
            low,
            high,
            special,
        };
        self.0.length = Length::Fits(limits.into_iter().map(limit).collect());
    }

    /// A column: a field, with the numbers at some paths of members scaled.
    fn show(&mut self, field: usize, scales: Vec<(Vec<usize>, Steps)>) {
        let scales = scales.into_iter().map(|(path, steps)| (path, linear(steps))).collect();
        self.0.makes.push(Make::Shown { field, scales });
    }

    /// A column: bits of a word, as a number, with `steps` as a physical one; null at the raw values `without`.
    fn part(&mut self, field: usize, low: u32, width: u32, without: Vec<u64>, steps: Option<Steps>) {
        let look = steps.map_or(Look::Number, |steps| Look::Physical(linear(steps)));
        self.0.makes.push(Make::Part {
            field,
            low,
            width,
            look,
            without,
        });
    }

    /// A column: a bit of a word, as a flag; null at the raw values `without`.
    fn flag(&mut self, field: usize, low: u32, without: Vec<u64>) {
        self.0.makes.push(Make::Part {
            field,
            low,
            width: 1,
            look: Look::Flag,
            without,
        });
    }

    /// A column: bytes as text.
    fn text(&mut self, field: usize) {
        self.0.makes.push(Make::Text { field });
    }

    /// Two columns: value and unit of a field by the raw value of another one: (that value, steps of a whole number,
    /// factor of another one, unit).
    fn measured(&mut self, field: usize, by: usize, measures: Vec<(u64, Steps, f64, String)>) {
        let measure = |(mode, steps, factor, unit)| Measure {
            mode,
            exact: linear(steps),
            factor,
            unit,
        };
        let measures = measures.into_iter().map(measure).collect();
        self.0.makes.push(Make::Measured { field, by, measures });
    }

    /// A column: computed from a number, of a list from each of its elements, or from one. A value from `start` to
    /// below `stop` gets what the first such piece (start, stop, add) adds. Without a value are raw ones outside the
    /// `limits`, and those `without`.
    fn derive(
        &mut self,
        field: usize,
        element: Option<usize>,
        steps: Steps,
        pieces: Vec<Steps>,
        limits: (f64, f64),
        without: Vec<u64>,
    ) {
        let piece = |(start, stop, add)| Piece { start, stop, add };
        let formula = Formula {
            linear: linear(steps),
            pieces: pieces.into_iter().map(piece).collect(),
            low: limits.0,
            high: limits.1,
            without,
        };
        self.0.makes.push(Make::Derived {
            field,
            element,
            formula,
        });
    }

    /// A column: the day that a number names.
    fn day(&mut self, field: usize, element: Option<usize>) {
        self.0.makes.push(Make::Day { field, element });
    }

    /// Of a packet: the places (first byte, bytes) of what senders of the other byte order turn round.
    fn numbers(&mut self, places: Vec<(usize, usize)>) {
        self.0.numbers = places;
    }

    /// A column behind all others of a packet: a counter of `bits` bits that wraps, continued for each value of the
    /// byte at `unit_at`; with `steps` as a physical number.
    fn unwrap(&mut self, field: usize, bits: u32, unit_at: usize, steps: Option<Steps>) {
        self.0.wraps.push(Wrap {
            field,
            bits,
            unit_at,
            physical: steps.map(linear),
        });
    }

    /// The table of a group; the batch begins with transfer `first` of the capture.
    fn table<'py>(&self, py: Python<'py>, group: &Group, first: u64) -> Table<'py> {
        handed_over(py, || self.0.table(&group.0, first))
    }

    /// The table of packets; `order` says of each, a byte a row, whether it is big-endian, and whether that is decided.
    fn packets<'py>(
        &self,
        py: Python<'py>,
        rows: &PacketRows,
        order: Option<(&[u8], &[u8])>,
        counters: &mut Counters,
    ) -> Table<'py> {
        let order = order.map(|(big, decided)| Order { big, decided });
        handed_over(py, || self.0.packets(&rows.0, order, &mut counters.0))
    }

    /// The fields of packets, all read in one byte order.
    fn packet_fields<'py>(&self, py: Python<'py>, rows: &PacketRows, big: bool) -> Table<'py> {
        handed_over(py, || self.0.packet_fields(&rows.0, big))
    }
}

/// How far the counters of one table of packets have come.
#[pyclass]
#[derive(Default)]
pub struct Counters(Vec<Unwrapper>);

#[pymethods]
impl Counters {
    #[new]
    fn new() -> Self {
        Counters::default()
    }
}

/// The table of bytes that are no packet.
#[pyfunction]
pub fn unrecognized<'py>(py: Python<'py>, rows: &PacketRows) -> Table<'py> {
    handed_over(py, || context(&rows.0))
}
