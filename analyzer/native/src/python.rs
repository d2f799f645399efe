//! The Python boundary and nothing else: arguments in, columns out, the interpreter free in between.
//!
//! Every column crosses as the bytes of a native-endian array or of an Arrow bitmap;
//! `analyzer/tables.py` names and types them.

use std::sync::{Arc, Mutex};

use bytemuck::{cast_slice, Pod};
use pyo3::prelude::*;
use pyo3::types::{PyBytes, PyDict};

use crate::events::Events;
use crate::frames::{Frames, NO_TIME};
use crate::pipeline::{self, Input};
use crate::reassembly::{Resolve, Settled, TypeName};
use crate::transfers::{Transfers, NO_GAP, NO_STEP};

type Dict<'py> = Bound<'py, PyDict>;

fn put<T: Pod>(to: &Dict<'_>, name: &str, column: &[T]) -> PyResult<()> {
    to.set_item(name, PyBytes::new(to.py(), cast_slice(column)))
}

/// Sets the Arrow bitmap of a column; none when every cell is valid.
fn put_valid(to: &Dict<'_>, name: &str, valid: impl ExactSizeIterator<Item = bool>) -> PyResult<()> {
    let mut bitmap = vec![0_u8; valid.len().div_ceil(8)];
    let mut nulls = false;
    for (row, valid) in valid.enumerate() {
        bitmap[row / 8] |= u8::from(valid) << (row % 8);
        nulls |= !valid;
    }
    if nulls {
        to.set_item(name, PyBytes::new(to.py(), &bitmap))
    } else {
        to.set_item(name, to.py().None())
    }
}

macro_rules! columns {
    ($py:expr, $table:expr, $($name:ident),+) => {{
        let dict = PyDict::new($py);
        $( put(&dict, stringify!($name), &$table.$name)?; )+
        dict
    }};
}

mod decode;
mod load;
mod mcap;
mod merge;
mod proto;
mod reader;
#[cfg(target_os = "linux")]
mod receive;
mod rows;
mod write;

fn timed(t: &[i64]) -> impl ExactSizeIterator<Item = bool> + '_ {
    t.iter().map(|&t| t != NO_TIME)
}

/// Bytes of text that are taken in one step.
const STEP: usize = 4 << 20;

/// What a capture is fed in.
#[derive(FromPyObject)]
enum Chunk<'py> {
    Text(Bound<'py, PyBytes>),
    Rows(Bound<'py, reader::FrameBatch>),
}

/// Frames to transfers, batch after batch; candump text never becomes an object a line.
#[pyclass]
struct Pipeline {
    pipeline: pipeline::Pipeline,
    failure: Arc<Mutex<Option<PyErr>>>,
}

#[pymethods]
impl Pipeline {
    /// `resolve(service, type_id)` gives the signatures of the types with this ID; asked once an ID.
    #[new]
    fn new(resolve: Py<PyAny>) -> Self {
        let failure = Arc::new(Mutex::new(None));
        let slot = Arc::clone(&failure);
        let ask: Resolve = Box::new(move |service, type_id| {
            let answer = Python::attach(|py| resolve.call1(py, (service, type_id))?.extract::<Vec<u64>>(py));
            answer.unwrap_or_else(|error| {
                if let Ok(mut slot) = slot.lock() {
                    slot.get_or_insert(error);
                }
                vec![]
            })
        });
        Pipeline {
            pipeline: pipeline::Pipeline::new(ask),
            failure,
        }
    }

    /// Takes the rows of a reader, or candump text, cut anywhere; a capture is one or the other. Of text it takes some
    /// `STEP` bytes from `start` on, so that tables can be taken in between: the place to go on with, None at the end.
    #[pyo3(signature = (chunk, start = 0))]
    #[allow(clippy::needless_pass_by_value)] // arguments from Python arrive by value
    fn feed(&mut self, py: Python<'_>, chunk: Chunk<'_>, start: usize) -> PyResult<Option<usize>> {
        let next = match &chunk {
            Chunk::Text(text) => {
                let text = text.as_bytes();
                let end = text.len().min(start.saturating_add(STEP));
                let part = text.get(start..end).unwrap_or_default();
                py.detach(|| self.pipeline.feed(Input::Text(part)));
                (end < text.len()).then_some(end)
            }
            Chunk::Rows(batch) => {
                let batch = &batch.get().0;
                py.detach(|| self.pipeline.feed(Input::Rows(batch)));
                None
            }
        };
        self.check()?;
        Ok(next)
    }

    /// End of capture.
    fn finish(&mut self, py: Python<'_>) -> PyResult<()> {
        py.detach(|| self.pipeline.finish());
        self.check()
    }

    /// Rows of frames and events that wait for `take`.
    #[getter]
    fn waiting(&self) -> usize {
        self.pipeline.waiting()
    }

    /// Everything found since the last call: (frames, transfers, events, settled, rows by type).
    fn take<'py>(&mut self, py: Python<'py>) -> PyResult<Taken<'py>> {
        let batch = self.pipeline.take();
        let types = self.pipeline.reassembler.types();
        let mut groups = vec![];
        for (rows, &(service, type_id, variant)) in batch.results.transfers.rows_by_type(types.len()).iter().zip(types)
        {
            if !rows.is_empty() {
                groups.push((service, type_id, variant, PyBytes::new(py, cast_slice(rows))));
            }
        }
        let frames = frame_columns(py, &batch.frames)?;
        put(&frames, "verdict", &batch.results.verdict)?;
        put(&frames, "anomaly", &batch.results.anomaly)?;
        let events = event_columns(py, &batch.events)?;
        let Settled {
            frame,
            verdict,
            anomaly,
        } = &batch.results.settled;
        let settled = PyDict::new(py);
        put(&settled, "frame", frame)?;
        put(&settled, "verdict", verdict)?;
        put(&settled, "anomaly", anomaly)?;
        Ok((
            frames,
            transfer_columns(py, &batch.results.transfers, types)?,
            events,
            settled,
            groups,
        ))
    }

    /// Interface names by index.
    #[getter]
    fn buses(&self) -> Vec<String> {
        self.pipeline.buses().to_vec()
    }

    /// Frames by verdict, capture-wide; their sum is the number of frames.
    #[getter]
    fn verdicts(&self) -> Vec<u64> {
        self.pipeline.reassembler.counts().to_vec()
    }

    /// What became of the lines of the text, capture-wide.
    #[getter]
    fn lines<'py>(&self, py: Python<'py>) -> PyResult<Dict<'py>> {
        reader::lines(py, self.pipeline.counts())
    }

    /// Bits of the kinds of time stamps seen.
    #[getter]
    fn stamps(&self) -> u8 {
        self.pipeline.stamps().bits()
    }
}

impl Pipeline {
    /// A failure of `resolve` surfaces here: it is a bug of a dissector, not of the capture.
    fn check(&self) -> PyResult<()> {
        let failure = self.failure.lock().ok().and_then(|mut slot| slot.take());
        failure.map_or(Ok(()), Err)
    }
}

type Taken<'py> = (
    Dict<'py>,
    Dict<'py>,
    Dict<'py>,
    Dict<'py>,
    Vec<(bool, u16, u8, Bound<'py, PyBytes>)>,
);

fn frame_columns<'py>(py: Python<'py>, frames: &Frames) -> PyResult<Dict<'py>> {
    let dict = columns!(py, frames, t, bus, id, flags, line, data);
    put(&dict, "data_offset", &frames.offset)?;
    put_valid(&dict, "t_valid", timed(&frames.t))?;
    Ok(dict)
}

fn event_columns<'py>(py: Python<'py>, e: &Events) -> PyResult<Dict<'py>> {
    let dict = columns!(py, e, t, bus, line, kind, class, flags, tx_errors, rx_errors, data, text);
    put_valid(&dict, "t_valid", timed(&e.t))?;
    put_valid(&dict, "bus_valid", e.bus_valid.iter().map(|&v| v != 0))?;
    put_valid(&dict, "tx_errors_valid", e.errors_valid.iter().map(|&v| v != 0))?;
    put_valid(&dict, "rx_errors_valid", e.errors_valid.iter().map(|&v| v != 0))?;
    for (name, ends) in [("data_offset", &e.data_end), ("text_offset", &e.text_end)] {
        let offsets: Vec<i32> = std::iter::once(0).chain(ends.iter().copied()).collect();
        put(&dict, name, &offsets)?;
    }
    Ok(dict)
}

fn transfer_columns<'py>(py: Python<'py>, rows: &Transfers, types: &[TypeName]) -> PyResult<Dict<'py>> {
    let dict = columns!(
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
    put_valid(&dict, "t_valid", timed(&rows.t))?;
    put_valid(&dict, "t_end_valid", timed(&rows.t_end))?;
    put_valid(&dict, "dst_valid", rows.kind.iter().map(|&kind| kind >= 2))?;
    put_valid(
        &dict,
        "crc_wire_valid",
        rows.crc_valid.iter().map(|&bits| bits & 1 != 0),
    )?;
    put_valid(
        &dict,
        "crc_here_valid",
        rows.crc_valid.iter().map(|&bits| bits & 2 != 0),
    )?;
    put_valid(&dict, "step_valid", rows.step.iter().map(|&step| step != NO_STEP))?;
    put_valid(&dict, "gap_valid", rows.gap.iter().map(|&gap| gap != NO_GAP))?;
    let variant = |&known: &u16| types.get(usize::from(known)).map_or(0, |name| name.2);
    put(&dict, "variant", &rows.known.iter().map(variant).collect::<Vec<u8>>())?;
    let mut fd = vec![0_u8; rows.fd.len().div_ceil(8)];
    for (row, &bit) in rows.fd.iter().enumerate() {
        fd[row / 8] |= bit << (row % 8);
    }
    put(&dict, "fd", &fd)?;
    Ok(dict)
}

#[pymodule]
fn _native(m: &Bound<'_, PyModule>) -> PyResult<()> {
    m.add_class::<Pipeline>()?;
    m.add_class::<merge::Merger>()?;
    m.add_class::<merge::Fingerprint>()?;
    m.add_class::<reader::FrameBatch>()?;
    m.add_class::<reader::Rows>()?;
    m.add_class::<reader::Reader>()?;
    m.add_class::<mcap::McapWalk>()?;
    #[cfg(target_os = "linux")]
    m.add_class::<receive::SocketReceiver>()?;
    m.add_class::<write::Messages>()?;
    m.add_class::<write::AsRecorded>()?;
    m.add_class::<write::Writer>()?;
    m.add_function(wrap_pyfunction!(load::frame_bits, m)?)?;
    m.add_function(wrap_pyfunction!(mcap::crc32, m)?)?;
    m.add_function(wrap_pyfunction!(proto::protobuf, m)?)?;
    m.add_function(wrap_pyfunction!(proto::message_records, m)?)?;
    m.add_class::<rows::Template>()?;
    m.add_class::<rows::Sheet>()?;
    m.add_class::<decode::Plan>()?;
    m.add_class::<decode::Packets>()
}
