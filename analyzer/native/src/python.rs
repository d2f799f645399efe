//! The Python boundary and nothing else: arguments in, columns out, the interpreter free in between.
//!
//! Every column crosses as the bytes of a native-endian array or of an Arrow bitmap, most of them where they lie
//! (`buffer`); `analyzer/tables.py` names and types them.

use std::sync::{Arc, Mutex};

use pyo3::prelude::*;
use pyo3::types::PyBytes;

use crate::frames::Frames;
use crate::groups;
use crate::pipeline::{self, Input};
use crate::reassembly::Resolve;
use group::Group;
use tables::{batch_tables, give, Dict, Tables};

mod alike;
mod budgets;
mod buffer;
mod bus_frames;
mod calls;
mod decoder;
mod diagnosis;
mod esc_rows;
mod firsts;
mod frame_cells;
mod group;
mod grouped;
mod heard;
mod id_nodes;
mod joint;
mod lacks;
mod last_runs;
mod load;
mod log_records;
mod losses;
mod mcap;
mod merge;
mod mistakes;
mod motor;
mod odd_steps;
mod orphans;
mod paces;
mod packets;
mod proto;
mod reader;
#[cfg(target_os = "linux")]
mod receive;
mod remainders;
mod rows;
mod runs;
mod silences;
mod tables;
mod template;
mod write;

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
    failure: Failure,
}

/// The first failure of a function of Python that the core has called.
type Failure = Arc<Mutex<Option<PyErr>>>;

/// Keeps a failure, and answers nothing.
fn keep<T: Default>(failure: &Failure, error: PyErr) -> T {
    if let Ok(mut slot) = failure.lock() {
        slot.get_or_insert(error);
    }
    T::default()
}

#[pymethods]
impl Pipeline {
    /// `resolve(service, type_id)` gives the signatures of the types with this ID; asked once an ID. Of sessions for which
    /// `asked(kind, type_id, src, dst)` is false transfers are only counted; asked once a session, None wants all.
    #[new]
    #[pyo3(signature = (resolve, asked = None))]
    fn new(resolve: Py<PyAny>, asked: Option<Py<PyAny>>) -> Self {
        let failure = Failure::default();
        let slot = Arc::clone(&failure);
        let ask: Resolve = Box::new(move |service, type_id| {
            let answer = Python::attach(|py| resolve.call1(py, (service, type_id))?.extract::<Vec<u64>>(py));
            answer.unwrap_or_else(|error| keep(&slot, error))
        });
        let mut pipeline = pipeline::Pipeline::new(ask);
        if let Some(asked) = asked {
            let slot = Arc::clone(&failure);
            pipeline.reassembler.ask_only(Box::new(move |id| {
                let session = (id.kind as u8, id.type_id, id.src, id.dst);
                let answer = Python::attach(|py| asked.call1(py, session)?.extract::<bool>(py));
                answer.unwrap_or_else(|error| keep(&slot, error))
            }));
        }
        Pipeline { pipeline, failure }
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

    /// Everything found since the last call: frames, transfers, events, settled, and the transfers by type. If `measured`,
    /// the frames have a column of their bit times more.
    #[pyo3(signature = (*, measured = false))]
    fn take<'py>(&mut self, py: Python<'py>, measured: bool) -> PyResult<(Tables<'py>, Vec<Group>)> {
        let (batch, bits) = py.detach(|| {
            let batch = self.pipeline.take();
            let bits = measured.then(|| frame_bits(&batch.frames));
            (batch, bits)
        });
        let types = self.pipeline.reassembler.types();
        let (tables, transfers) = batch_tables(py, batch, types)?;
        if let Some(bits) = bits {
            give(&tables.0, "bit_times", bits)?;
        }
        let rows = py.detach(|| transfers.rows_by_type(types.len()));
        let known = rows.into_iter().zip(types).filter(|(rows, _)| !rows.is_empty());
        let groups = known.flat_map(|(rows, &name)| groups::Group::of(&transfers, rows, name));
        Ok((tables, groups.map(Group).collect()))
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

    /// Transfers that were only counted, capture-wide.
    #[getter]
    fn unasked(&self) -> u64 {
        self.pipeline.reassembler.unasked()
    }

    /// Frames before this number have their last verdicts: no later batch settles one of them.
    #[getter]
    fn settled_before(&mut self) -> u64 {
        self.pipeline.reassembler.settled_before()
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
    /// A failure of `resolve` or `asked` surfaces here: it is a bug of a dissector, not of the capture.
    fn check(&self) -> PyResult<()> {
        let failure = self.failure.lock().ok().and_then(|mut slot| slot.take());
        failure.map_or(Ok(()), Err)
    }
}

fn frame_bits(frames: &Frames) -> Vec<u16> {
    crate::load::frame_bits(&frames.id, &frames.flags, &frames.offset, &frames.data)
}

/// What is raised where columns that belong together are not equally long.
fn unfit() -> PyErr {
    pyo3::exceptions::PyValueError::new_err("columns that do not fit together")
}

#[pymodule]
fn _native(m: &Bound<'_, PyModule>) -> PyResult<()> {
    m.add_class::<Pipeline>()?;
    m.add_class::<buffer::Cells>()?;
    m.add_class::<merge::Merger>()?;
    m.add_class::<merge::Fingerprint>()?;
    m.add_class::<reader::FrameBatch>()?;
    m.add_class::<reader::Rows>()?;
    m.add_class::<reader::Reader>()?;
    m.add_class::<log_records::LogRecords>()?;
    m.add_class::<mcap::McapWalk>()?;
    #[cfg(target_os = "linux")]
    m.add_class::<receive::SocketReceiver>()?;
    m.add_class::<write::Messages>()?;
    m.add_class::<write::AsRecorded>()?;
    m.add_class::<write::Writer>()?;
    m.add_class::<diagnosis::FrameIndex>()?;
    m.add_class::<id_nodes::IdNodes>()?;
    m.add_class::<alike::Identities>()?;
    m.add_class::<lacks::Lacks>()?;
    m.add_class::<losses::Losses>()?;
    m.add_class::<esc_rows::EscRows>()?;
    m.add_class::<motor::MotorSums>()?;
    m.add_class::<motor::MotorWatch>()?;
    m.add_class::<esc_rows::RecentOrders>()?;
    m.add_class::<motor::SupplyLine>()?;
    m.add_class::<orphans::OrphanIndex>()?;
    m.add_class::<heard::HeardNodes>()?;
    m.add_class::<heard::HeardSessions>()?;
    m.add_class::<paces::Paces>()?;
    m.add_class::<budgets::Budget>()?;
    m.add_class::<calls::Calls>()?;
    m.add_class::<budgets::Causes>()?;
    m.add_class::<remainders::Remainders>()?;
    m.add_class::<firsts::Firsts>()?;
    m.add_class::<last_runs::LastRuns>()?;
    m.add_class::<runs::OccurrenceGroups>()?;
    m.add_function(wrap_pyfunction!(alike::repeats, m)?)?;
    m.add_function(wrap_pyfunction!(diagnosis::diagnose, m)?)?;
    m.add_function(wrap_pyfunction!(diagnosis::tails_before, m)?)?;
    m.add_function(wrap_pyfunction!(frame_cells::frame_lines, m)?)?;
    m.add_function(wrap_pyfunction!(frame_cells::frame_cells, m)?)?;
    m.add_function(wrap_pyfunction!(grouped::rows, m)?)?;
    m.add_function(wrap_pyfunction!(heard::frames_by_session, m)?)?;
    m.add_function(wrap_pyfunction!(joint::joint, m)?)?;
    m.add_function(wrap_pyfunction!(load::frame_bits, m)?)?;
    m.add_function(wrap_pyfunction!(mcap::crc32, m)?)?;
    m.add_function(wrap_pyfunction!(mistakes::crc_starts, m)?)?;
    m.add_function(wrap_pyfunction!(mistakes::mistaken, m)?)?;
    m.add_function(wrap_pyfunction!(proto::protobuf, m)?)?;
    m.add_function(wrap_pyfunction!(proto::message_records, m)?)?;
    m.add_function(wrap_pyfunction!(silences::last_before, m)?)?;
    m.add_class::<rows::Template>()?;
    m.add_class::<rows::Sheet>()?;
    m.add_class::<Group>()?;
    m.add_class::<decoder::Decoder>()?;
    m.add_class::<decoder::Counters>()?;
    m.add_class::<packets::PacketRows>()?;
    m.add_function(wrap_pyfunction!(decoder::unrecognized, m)?)?;
    m.add_class::<packets::Packets>()
}
