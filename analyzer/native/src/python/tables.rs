//! Tables as dicts of columns: native-endian cells and Arrow bitmaps. `analyzer/tables.py` names and types them.

use std::sync::Arc;

use bytemuck::{cast_slice, Pod};
use pyo3::prelude::*;
use pyo3::types::{PyBytes, PyDict};

use super::buffer::Cells;
use crate::events::Events;
use crate::frames::{Frames, NO_TIME};
use crate::pipeline::Batch;
use crate::reassembly::{Settled, TypeName};
use crate::transfers::{Transfers, NO_GAP, NO_STEP};

pub type Dict<'py> = Bound<'py, PyDict>;

/// Sets a column that is copied.
pub fn put<T: Pod>(to: &Dict<'_>, name: &str, column: &[T]) -> PyResult<()> {
    to.set_item(name, PyBytes::new(to.py(), cast_slice(column)))
}

/// Sets a column that is handed over.
pub fn give<T: Pod + Send + Sync>(to: &Dict<'_>, name: &str, column: Vec<T>) -> PyResult<()> {
    to.set_item(name, Cells::own(to.py(), column)?)
}

/// Bits in Arrow's order, one a cell.
pub fn bitmap<T: Copy>(cells: &[T], holds: impl Fn(T) -> bool) -> Vec<u8> {
    let byte = |eight: &[T]| {
        let bits = eight.iter().rev();
        bits.fold(0, |bits, &cell| bits << 1 | u8::from(holds(cell)))
    };
    cells.chunks(8).map(byte).collect()
}

/// The Arrow bitmap of a column; none when every cell is valid.
fn validity<T: Copy>(cells: &[T], valid: impl Fn(T) -> bool) -> Option<Vec<u8>> {
    // Piece by piece without a branch inside: nearly all are valid.
    let all = |piece: &[T]| piece.iter().fold(true, |all, &cell| all & valid(cell));
    let whole = cells.chunks(256).all(all);
    (!whole).then(|| bitmap(cells, valid))
}

macro_rules! columns {
    ($py:expr, $table:expr, $($name:ident),+) => {{
        let dict = PyDict::new($py);
        $( put(&dict, stringify!($name), &$table.$name)?; )+
        dict
    }};
}

/// The same columns of a table that nobody needs any more.
macro_rules! given {
    ($py:expr, $table:expr, $($name:ident),+) => {{
        let dict = PyDict::new($py);
        $( give(&dict, stringify!($name), $table.$name)?; )+
        dict
    }};
}

/// The same columns of a table that stays where it is.
macro_rules! lent {
    ($py:expr, $table:expr, $($name:ident),+) => {{
        let dict = PyDict::new($py);
        $( {
            let cells = Cells::part($py, $table, |table| cast_slice(&table.$name))?;
            dict.set_item(stringify!($name), cells)?;
        } )+
        dict
    }};
}

pub fn times(to: &Dict<'_>, name: &str, t: &[i64]) -> PyResult<()> {
    put_valid(to, name, t, |t| t != NO_TIME)
}

fn put_valid<T: Copy>(to: &Dict<'_>, name: &str, cells: &[T], valid: impl Fn(T) -> bool) -> PyResult<()> {
    match validity(cells, valid) {
        Some(bitmap) => put(to, name, &bitmap),
        None => to.set_item(name, to.py().None()),
    }
}

pub fn frame_columns<'py>(py: Python<'py>, frames: &Frames) -> PyResult<Dict<'py>> {
    let dict = columns!(py, frames, t, bus, id, flags, line, data);
    put(&dict, "data_offset", &frames.offset)?;
    times(&dict, "t_valid", &frames.t)?;
    Ok(dict)
}

pub fn event_columns<'py>(py: Python<'py>, e: &Events) -> PyResult<Dict<'py>> {
    let dict = columns!(py, e, t, bus, line, kind, class, flags, tx_errors, rx_errors, data, text);
    times(&dict, "t_valid", &e.t)?;
    for (name, valid) in [
        ("bus_valid", &e.bus_valid),
        ("tx_errors_valid", &e.errors_valid),
        ("rx_errors_valid", &e.errors_valid),
    ] {
        put_valid(&dict, name, valid, |valid| valid != 0)?;
    }
    for (name, ends) in [("data_offset", &e.data_end), ("text_offset", &e.text_end)] {
        let offsets: Vec<i32> = std::iter::once(0).chain(ends.iter().copied()).collect();
        put(&dict, name, &offsets)?;
    }
    Ok(dict)
}

/// Tables of one batch: frames, transfers, events, settled.
pub type Tables<'py> = (Dict<'py>, Dict<'py>, Dict<'py>, Dict<'py>);

/// The tables of a batch, handed over, and its transfers, which stay where they are.
pub fn batch_tables<'py>(py: Python<'py>, batch: Batch, types: &[TypeName]) -> PyResult<(Tables<'py>, Arc<Transfers>)> {
    let (frames, results) = (batch.frames, batch.results);
    let valid = validity(&frames.t, |t| t != NO_TIME);
    let table = given!(py, frames, t, bus, id, flags, line, data);
    give(&table, "data_offset", frames.offset)?;
    table.set_item("t_valid", valid.map(|bits| PyBytes::new(py, &bits)))?;
    give(&table, "verdict", results.verdict)?;
    give(&table, "anomaly", results.anomaly)?;
    let Settled {
        frame,
        verdict,
        anomaly,
    } = results.settled;
    let settled = PyDict::new(py);
    give(&settled, "frame", frame)?;
    give(&settled, "verdict", verdict)?;
    give(&settled, "anomaly", anomaly)?;
    let transfers = Arc::new(results.transfers);
    let tables = (
        table,
        transfer_columns(py, &transfers, types)?,
        event_columns(py, &batch.events)?,
        settled,
    );
    Ok((tables, transfers))
}

fn transfer_columns<'py>(py: Python<'py>, rows: &Arc<Transfers>, types: &[TypeName]) -> PyResult<Dict<'py>> {
    let dict = lent!(
        py,
        rows,
        t,
        t_end,
        bus,
        kind,
        type_id,
        src,
        dst,
        priority,
        transfer_id,
        status,
        crc_wire,
        crc_here,
        step,
        gap,
        anomaly,
        frame_offset,
        frame,
        payload_offset,
        payload
    );
    times(&dict, "t_valid", &rows.t)?;
    times(&dict, "t_end_valid", &rows.t_end)?;
    put_valid(&dict, "dst_valid", &rows.kind, |kind| kind >= 2)?;
    put_valid(&dict, "crc_wire_valid", &rows.crc_valid, |bits| bits & 1 != 0)?;
    put_valid(&dict, "crc_here_valid", &rows.crc_valid, |bits| bits & 2 != 0)?;
    put_valid(&dict, "step_valid", &rows.step, |step| step != NO_STEP)?;
    put_valid(&dict, "gap_valid", &rows.gap, |gap| gap != NO_GAP)?;
    let variant = |&known: &u16| types.get(usize::from(known)).map_or(0, |name| name.2);
    give(&dict, "variant", rows.known.iter().map(variant).collect::<Vec<u8>>())?;
    give(&dict, "fd", bitmap(&rows.fd, |fd| fd != 0))?;
    Ok(dict)
}
