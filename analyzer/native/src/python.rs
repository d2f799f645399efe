//! The Python boundary and nothing else: arguments in, columns out, the interpreter free in between.
//!
//! Every column crosses as the bytes of a native-endian array or of an Arrow bitmap;
//! `analyzer/tables.py` names and types them.

use std::sync::{Arc, Mutex};

use bytemuck::{cast_slice, try_cast_slice, Pod};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::{PyBytes, PyDict};

use crate::bits::spans;
use crate::frames::{Frames, NO_TIME};
use crate::packets::{find, Carrier, Counter, Family, Spec};
use crate::pipeline::Pipeline;
use crate::plan;
use crate::reassembly::{Resolve, Settled};
use crate::transfers::{Transfers, NO_GAP, NO_STEP};
use crate::unpack::{unpack, Rows};

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

fn timed<'a>(t: &'a [i64]) -> impl ExactSizeIterator<Item = bool> + 'a {
    t.iter().map(|&t| t != NO_TIME)
}

/// Frames to transfers, batch after batch; candump text never becomes an object a line.
#[pyclass]
struct Engine {
    pipeline: Pipeline,
    failure: Arc<Mutex<Option<PyErr>>>,
}

#[pymethods]
impl Engine {
    /// `resolve(service, type_id)` gives the signature of a type, or None; asked once a type.
    #[new]
    fn new(resolve: Py<PyAny>) -> Self {
        let failure = Arc::new(Mutex::new(None));
        let slot = Arc::clone(&failure);
        let ask: Resolve = Box::new(move |service, type_id| {
            let answer = Python::attach(|py| resolve.call1(py, (service, type_id))?.extract::<Option<u64>>(py));
            answer.unwrap_or_else(|error| {
                if let Ok(mut slot) = slot.lock() {
                    slot.get_or_insert(error);
                }
                None
            })
        });
        Engine {
            pipeline: Pipeline::new(ask),
            failure,
        }
    }

    /// Takes candump text, cut anywhere.
    fn feed_candump(&mut self, py: Python<'_>, chunk: &[u8]) -> PyResult<()> {
        py.detach(|| self.pipeline.feed_candump(chunk));
        self.check()
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
        for (rows, &(service, type_id)) in batch.results.transfers.rows_by_type(types.len()).iter().zip(types) {
            if !rows.is_empty() {
                groups.push((service, type_id, PyBytes::new(py, cast_slice(rows))));
            }
        }
        let frames = frame_columns(py, &batch.frames)?;
        put(&frames, "verdict", &batch.results.verdict)?;
        put(&frames, "anomaly", &batch.results.anomaly)?;
        let e = &batch.events;
        let events = columns!(py, e, t, bus, line, kind, class, tx_errors, rx_errors, text);
        put_valid(&events, "t_valid", timed(&e.t))?;
        put_valid(&events, "bus_valid", e.bus_valid.iter().map(|&v| v != 0))?;
        put_valid(&events, "tx_errors_valid", e.errors_valid.iter().map(|&v| v != 0))?;
        put_valid(&events, "rx_errors_valid", e.errors_valid.iter().map(|&v| v != 0))?;
        let offsets: Vec<i32> = std::iter::once(0).chain(e.text_end.iter().copied()).collect();
        put(&events, "text_offset", &offsets)?;
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
            transfer_columns(py, &batch.results.transfers)?,
            events,
            settled,
            groups,
        ))
    }

    /// Interface names by index.
    #[getter]
    fn buses(&self) -> Vec<String> {
        self.pipeline.candump.buses().to_vec()
    }

    /// Frames by verdict, capture-wide; their sum is the number of frames.
    #[getter]
    fn verdicts(&self) -> Vec<u64> {
        self.pipeline.reassembler.counts().to_vec()
    }

    /// What became of the lines of the text, capture-wide.
    #[getter]
    fn lines<'py>(&self, py: Python<'py>) -> PyResult<Dict<'py>> {
        let counts = self.pipeline.candump.counts();
        let dict = PyDict::new(py);
        dict.set_item("lines", counts.lines)?;
        dict.set_item("frames", counts.frames)?;
        dict.set_item("error_frames", counts.error_frames)?;
        dict.set_item("drops", counts.drops)?;
        dict.set_item("dropped_frames", counts.dropped)?;
        dict.set_item("comments", counts.comments)?;
        dict.set_item("blank", counts.blank)?;
        dict.set_item("unreadable", counts.unreadable)?;
        Ok(dict)
    }

    /// Bits of the kinds of time stamps seen.
    #[getter]
    fn stamps(&self) -> u8 {
        self.pipeline.candump.stamps().bits()
    }
}

impl Engine {
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
    Vec<(bool, u16, Bound<'py, PyBytes>)>,
);

fn frame_columns<'py>(py: Python<'py>, frames: &Frames) -> PyResult<Dict<'py>> {
    let dict = columns!(py, frames, t, bus, id, flags, line, data);
    put(&dict, "data_offset", &frames.offset)?;
    put_valid(&dict, "t_valid", timed(&frames.t))?;
    Ok(dict)
}

fn transfer_columns<'py>(py: Python<'py>, rows: &Transfers) -> PyResult<Dict<'py>> {
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
    let mut fd = vec![0_u8; rows.fd.len().div_ceil(8)];
    for (row, &bit) in rows.fd.iter().enumerate() {
        fd[row / 8] |= bit << (row % 8);
    }
    put(&dict, "fd", &fd)?;
    Ok(dict)
}

/// A layout, checked once.
#[pyclass(frozen)]
struct Plan(plan::Plan);

#[pymethods]
impl Plan {
    /// Preorder tokens (kind, number, number); raises `ValueError` on a layout out of bounds.
    #[new]
    fn new(tokens: Vec<(String, u32, u32)>) -> PyResult<Self> {
        plan::Plan::parse(&tokens)
            .map(Plan)
            .map_err(|error| PyValueError::new_err(error.to_string()))
    }

    /// Unpacks rows of `payload` (bounded by i32 `offsets`; u32 `rows` picks some): a preorder list of
    /// (cells, validity, buffer), the bits left a row (i32) and the flags a row (u8).
    #[pyo3(signature = (offsets, payload, layouts, rows=None))]
    fn unpack<'py>(
        &self,
        py: Python<'py>,
        offsets: &[u8],
        payload: &[u8],
        layouts: &[u8],
        rows: Option<&[u8]>,
    ) -> PyResult<Unpacked<'py>> {
        let offsets: &[i32] = aligned(offsets)?;
        let rows: Option<&[u32]> = rows.map(aligned).transpose()?;
        let (columns, left, flags) = py.detach(|| {
            let spans = spans(offsets, rows);
            let out = unpack(&self.0, Rows { spans: &spans, layouts }, payload);
            (out.root.flatten(), out.left, out.dirty)
        });
        let columns = columns
            .into_iter()
            .map(|flat| {
                let bytes = |buffer: Option<Vec<u8>>| buffer.map(|b| PyBytes::new(py, &b));
                (flat.len, bytes(flat.validity), bytes(flat.buffer))
            })
            .collect();
        Ok((columns, PyBytes::new(py, cast_slice(&left)), PyBytes::new(py, &flags)))
    }
}

type Bytes<'py> = Bound<'py, PyBytes>;
type Unpacked<'py> = (
    Vec<(usize, Option<Bytes<'py>>, Option<Bytes<'py>>)>,
    Bytes<'py>,
    Bytes<'py>,
);

fn aligned<T: Pod>(bytes: &[u8]) -> PyResult<&[T]> {
    try_cast_slice(bytes).map_err(|error| PyValueError::new_err(error.to_string()))
}

/// (header, id_at, count_at, unit_at, length_at, packets as (id, length, ends of the sum)).
type FamilySpec = (Vec<u8>, usize, usize, usize, usize, Vec<(u8, u16, Vec<u16>)>);

/// Finds packets inside byte arrays and follows their frame counts through the capture.
#[pyclass]
struct Packets {
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
    /// family they should hold, `bus` and `src` (u8) say a row where it came from.
    fn find<'py>(
        &mut self,
        py: Python<'py>,
        own: usize,
        type_id: u16,
        offsets: &[u8],
        data: &[u8],
        bus: &[u8],
        src: &[u8],
    ) -> PyResult<Dict<'py>> {
        let offsets: &[i32] = aligned(offsets)?;
        let (found, steps) = py.detach(|| {
            let found = find(&self.families, own, &spans(offsets, None), data);
            let carriers: Vec<Carrier> = bus
                .iter()
                .zip(src)
                .map(|(&bus, &src)| Carrier { bus, src, type_id })
                .collect();
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

#[pymodule]
fn _native(m: &Bound<'_, PyModule>) -> PyResult<()> {
    m.add_class::<Engine>()?;
    m.add_class::<Plan>()?;
    m.add_class::<Packets>()
}
