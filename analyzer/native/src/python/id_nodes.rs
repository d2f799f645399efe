//! Nodes whose transfer-ID counters break, for Python: columns of a batch in, causes and columns of told steps out.

use std::collections::{HashMap, HashSet};

use pyo3::buffer::PyBuffer;
use pyo3::prelude::*;

use super::buffer::Cells;
use super::diagnosis::FrameIndex;
use super::odd_steps::{Given, OddRows};
use super::orphans::OrphanIndex;
use super::unfit;
use crate::diagnosis::counters::Gaps;
use crate::diagnosis::index::{Frames, Index};
use crate::id_nodes::around::Around;
use crate::id_nodes::begun_anew::Stated;
use crate::id_nodes::shared_counter::Message;
use crate::id_nodes::step::{Explains, Step, Told};
use crate::id_nodes::{self, Events, Sender, Sent};

type Column<'py> = Bound<'py, Cells>;

/// Bits of a told step, the first three those of a step that is given.
const LATE: u8 = 1;
const EARLY: u8 = 2;
const ASTRAY: u8 = 4;
const MOVED: u8 = 8;
const NOTED: u8 = 16;

/// Messages in their order: senders, rows, types, IDs, steps.
#[derive(FromPyObject)]
pub struct Messages(PyBuffer<u16>, PyBuffer<u32>, PyBuffer<i64>, PyBuffer<u8>, PyBuffer<u8>);

/// Uptimes that nodes state: senders, rows of the transfers, times, seconds, IDs.
#[derive(FromPyObject)]
pub struct Uptimes(PyBuffer<u16>, PyBuffer<u32>, PyBuffer<i64>, PyBuffer<i64>, PyBuffer<u8>);

/// Where the frames of each transfer begin, one more than rows, and the numbers of all.
#[derive(FromPyObject)]
pub struct FrameLists(PyBuffer<i64>, PyBuffer<u64>);

/// What all steps are judged by: since when frames have come without a gap, when each gap ended, how many transfers show a
/// sender, the last time so far, when each bus began, and a function that gives the values from which the CRC of a type may
/// start.
#[derive(FromPyObject)]
pub struct Known<'py>(i64, PyBuffer<i64>, u32, i64, HashMap<u8, i64>, Bound<'py, PyAny>);

/// Bus, node, time, frames, the kind of the cause and its numbers.
type Cause = (u8, u8, i64, Vec<u64>, u8, Vec<i64>);
/// Steps that nothing explains: buses, nodes, rules, marks, times, those of the transfers before, the times between, types,
/// IDs, those before; where the frames of each begin, one more than rows, and the numbers of all.
type Unexplained<'py> = (
    (Column<'py>, Column<'py>, Column<'py>, Column<'py>),
    (Column<'py>, Column<'py>, Column<'py>, Column<'py>),
    (Column<'py>, Column<'py>),
    (Column<'py>, Column<'py>),
);

type Found<'py> = (Vec<Cause>, Unexplained<'py>);

/// What a batch has of each node, in the order in which they come.
#[derive(Default)]
struct BySender {
    sent: Vec<(Sender, Sent)>,
    places: HashMap<Sender, usize>,
}

impl BySender {
    fn of(&mut self, sender: Sender) -> &mut Sent {
        let at = *self.places.entry(sender).or_insert_with(|| {
            self.sent.push((sender, Sent::default()));
            self.sent.len() - 1
        });
        &mut self.sent[at].1
    }
}

/// Follows nodes whose counters break.
#[pyclass]
#[derive(Clone)]
pub struct IdNodes(id_nodes::IdNodes);

#[pymethods]
impl IdNodes {
    #[new]
    fn new() -> Self {
        IdNodes(id_nodes::IdNodes::default())
    }

    /// Nodes of which messages are wanted although nobody counts oddly, u16 each.
    #[getter]
    fn sharing<'py>(&self, py: Python<'py>) -> PyResult<Column<'py>> {
        Cells::own(py, self.0.sharing().map(number).collect())
    }

    /// Takes a batch, with frames of the recent past: those of sessions that belong to no transfer, and all. Messages are
    /// taken of nodes with breaches and of those that are wanted, though there may be others.
    #[allow(clippy::needless_pass_by_value)] // arguments from Python arrive by value
    fn feed<'py>(
        &mut self,
        py: Python<'py>,
        orphans: &OrphanIndex,
        batches: Vec<Bound<'py, FrameIndex>>,
        given: (PyBuffer<i64>, Messages, Uptimes),
        lists: FrameLists,
        known: Known<'py>,
    ) -> PyResult<Found<'py>> {
        let batches: Vec<&Index> = batches.iter().map(|batch| &batch.get().0).collect();
        let (odd, messages, uptimes) = given;
        let judged = Given {
            orphans: &orphans.0,
            frames: Frames(&batches),
            starts: known.4,
            types: known.5,
        };
        let steps = OddRows::of(py, &odd)?.steps(&judged)?;
        let (begins, numbers) = (lists.0.to_vec(py)?, lists.1.to_vec(py)?);
        let frames_of = |row: u32| {
            let ends = begins.get(row as usize..).and_then(|ends| ends.first_chunk());
            let some = ends.and_then(|&[begin, end]: &[i64; 2]| numbers.get(begin as usize..end as usize));
            some.unwrap_or_default().to_vec()
        };
        let mut sent = BySender::default();
        let mut wanted: HashSet<Sender> = self.0.sharing().collect();
        for (bus, node, step) in steps {
            let frames = frames_of(step.row).into_boxed_slice();
            let sender = Sender { bus, node };
            wanted.insert(sender);
            sent.of(sender).steps.push(Step { frames, ..step });
        }
        add_uptimes(py, &mut sent, &uptimes)?;
        for sender in self.0.sharing() {
            sent.of(sender);
        }
        add_messages(py, &mut sent, &messages, &wanted)?;
        let ends = known.1.to_vec(py)?;
        let around = Around {
            frames: Frames(&batches),
            gaps: Gaps {
                start: known.0,
                ends: &ends,
            },
            least: known.2,
            frames_of: &frames_of,
        };
        give(py, self.0.feed(sent.sent, around, known.3))
    }

    /// Tells what is held back.
    fn finish<'py>(&mut self, py: Python<'py>) -> PyResult<Found<'py>> {
        give(py, self.0.finish())
    }

    /// Another one that grows apart from this.
    fn __deepcopy__(&self, _memo: &Bound<'_, PyAny>) -> Self {
        self.clone()
    }
}

fn sender(number: u16) -> Sender {
    let [bus, node] = number.to_be_bytes();
    Sender { bus, node }
}

fn number(sender: Sender) -> u16 {
    u16::from_be_bytes([sender.bus, sender.node])
}

fn add_messages(py: Python<'_>, sent: &mut BySender, given: &Messages, wanted: &HashSet<Sender>) -> PyResult<()> {
    let (senders, row, code) = (given.0.to_vec(py)?, given.1.to_vec(py)?, given.2.to_vec(py)?);
    let (id, step) = (given.3.to_vec(py)?, given.4.to_vec(py)?);
    if [row.len(), code.len(), id.len(), step.len()] != [senders.len(); 4] {
        return Err(unfit());
    }
    let ours = (0..).zip(&senders).map(|(k, &from)| (k, sender(from)));
    for (k, from) in ours.filter(|(_, from)| wanted.contains(from)) {
        let k: usize = k;
        sent.of(from).messages.push(Message {
            row: row[k],
            code: code[k],
            id: id[k],
            step: step[k],
        });
    }
    Ok(())
}

fn add_uptimes(py: Python<'_>, sent: &mut BySender, given: &Uptimes) -> PyResult<()> {
    let (senders, row, t) = (given.0.to_vec(py)?, given.1.to_vec(py)?, given.2.to_vec(py)?);
    let (uptime, id) = (given.3.to_vec(py)?, given.4.to_vec(py)?);
    if [row.len(), t.len(), uptime.len(), id.len()] != [senders.len(); 4] {
        return Err(unfit());
    }
    for (k, &from) in senders.iter().enumerate() {
        sent.of(sender(from)).stated.push(Stated {
            row: row[k],
            t: t[k],
            uptime: uptime[k],
            id: id[k],
        });
    }
    Ok(())
}

fn give(py: Python<'_>, found: Events) -> PyResult<Found<'_>> {
    let causes = found.causes.into_iter();
    let causes = causes.map(|(sender, cause)| {
        let (kind, numbers) = numbers_of(&cause.explains);
        (sender.bus, sender.node, cause.t, cause.frames, kind, numbers)
    });
    Ok((causes.collect(), columns(py, &found.told)?))
}

/// The kind of a cause, and its numbers; -1 for an ID that there is none of.
fn numbers_of(cause: &Explains) -> (u8, Vec<i64>) {
    match cause {
        Explains::Types(count) => (0, vec![*count as i64]),
        Explains::ByTurns(code, ids) => (1, [*code].into_iter().chain(ids.iter().map(|&id| id.into())).collect()),
        Explains::GoesOn(code, id, other) => (2, vec![*code, (*id).into(), other.map_or(-1, i64::from)]),
        Explains::Wraps(id, before) => (3, vec![(*id).into(), (*before).into()]),
    }
}

fn marks(told: &Told) -> u8 {
    let step = &told.step;
    let marked = [(step.late, LATE), (step.early, EARLY), (step.astray, ASTRAY)];
    let moved = told.moved.as_ref();
    let moved = [(moved.is_some(), MOVED), (moved.is_some_and(|one| one.noted), NOTED)];
    let set = marked.into_iter().chain(moved).filter(|(is, _)| *is);
    set.fold(0, |marks, (_, bit)| marks | bit)
}

fn columns<'py>(py: Python<'py>, told: &[(Sender, Told)]) -> PyResult<Unexplained<'py>> {
    let (mut begins, mut numbers) = (vec![0_i64], vec![]);
    for (_, one) in told {
        numbers.extend_from_slice(&one.step.frames);
        numbers.extend(one.moved.iter().flat_map(|moved| moved.behind.iter()));
        begins.push(numbers.len() as i64);
    }
    let bytes = |cell: fn(&(Sender, Told)) -> u8| Cells::own(py, told.iter().map(cell).collect());
    let words = |cell: fn(&(Sender, Told)) -> i64| Cells::own(py, told.iter().map(cell).collect());
    Ok((
        (
            bytes(|(sender, _)| sender.bus)?,
            bytes(|(sender, _)| sender.node)?,
            bytes(|(_, one)| one.step.rule as u8)?,
            bytes(|(_, one)| marks(one))?,
        ),
        (
            words(|(_, one)| one.step.t)?,
            words(|(_, one)| one.step.since)?,
            words(|(_, one)| one.step.gap)?,
            words(|(_, one)| one.step.code)?,
        ),
        (bytes(|(_, one)| one.step.id)?, bytes(|(_, one)| one.step.before)?),
        (Cells::own(py, begins)?, Cells::own(py, numbers)?),
    ))
}
