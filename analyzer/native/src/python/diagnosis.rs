//! Causes of broken transfers for Python: the frames of the recent past in, what is asked of some of them, answers out.

use pyo3::buffer::PyBuffer;
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;

use super::buffer::{Cells, Lent};
use super::unfit;
use crate::diagnosis::index::{key, Columns, Frames, Hold, Index};
use crate::diagnosis::questions::{ask, Found, Question};
use crate::diagnosis::Known;

/// Questions in the order of their numbers.
const QUESTIONS: [Question; 5] = [
    Question::Broken,
    Question::Checksum,
    Question::Remainder,
    Question::Copy,
    Question::Inside,
];

type Column<'py> = Bound<'py, Cells>;

/// Columns of the table of frames, where they lie.
#[derive(Debug)]
struct FrameColumns {
    t: Lent<i64>,
    bus: Lent<u8>,
    id: Lent<u32>,
    flags: Lent<u16>,
    offsets: Lent<i32>,
    data: Lent<u8>,
}

impl Hold for FrameColumns {
    fn columns(&self) -> Columns<'_> {
        Columns {
            t: &self.t,
            bus: &self.bus,
            id: &self.id,
            flags: &self.flags,
            offsets: &self.offsets,
            data: &self.data,
        }
    }
}

/// The frames of a batch in the order of their sessions.
#[pyclass(frozen)]
pub struct FrameIndex(pub Index);

#[pymethods]
impl FrameIndex {
    /// Takes columns of the table of frames; `offsets` say where the data field of each begins, one more than rows.
    #[new]
    #[allow(clippy::too_many_arguments)] // columns, as Python hands them over
    fn new(
        py: Python<'_>,
        first: u64,
        t: PyBuffer<i64>,
        bus: PyBuffer<u8>,
        id: PyBuffer<u32>,
        flags: PyBuffer<u16>,
        offsets: PyBuffer<i32>,
        data: PyBuffer<u8>,
    ) -> PyResult<Self> {
        let columns = FrameColumns {
            t: Lent::of(py, t)?,
            bus: Lent::of(py, bus)?,
            id: Lent::of(py, id)?,
            flags: Lent::of(py, flags)?,
            offsets: Lent::of(py, offsets)?,
            data: Lent::of(py, data)?,
        };
        let index = py.detach(|| Index::new(first, Box::new(columns)));
        index.map(FrameIndex).ok_or_else(unfit)
    }

    /// Some frames as `candump -l` writes them, without those that are not there; `buses` are names.
    #[allow(clippy::needless_pass_by_value)] // arguments from Python arrive by value
    fn lines(&self, numbers: Vec<u64>, buses: Vec<String>) -> Vec<String> {
        let frames = numbers.iter().filter_map(|&number| self.0.frame(number, &buses));
        frames.map(|frame| frame.line()).collect()
    }

    /// The numbers of the frames of a session from `low` to before `high`.
    fn numbers(&self, low: u64, high: u64, bus: u8, session: u32) -> Vec<u64> {
        let rows = self.0.between(key(bus, session), &(low..high));
        rows.iter().map(|&row| self.0.range().start + u64::from(row)).collect()
    }

    /// Numbers and tail bytes of the first `most` frames of a session from `low` to before `high` with another
    /// transfer ID.
    fn others(&self, low: u64, high: u64, bus: u8, session: u32, id: u8, most: usize) -> Vec<(u64, u8)> {
        let parts = self.0.parts(key(bus, session), &(low..high));
        let others = parts.filter(|part| part.tail & 0x1F != id).take(most);
        others.map(|part| (part.number, part.tail)).collect()
    }

    /// The same of many: a range of numbers (first two columns), a bus, a session and a transfer ID each, i64. Where the
    /// frames of each begin (one more than there are), i64, and their numbers, i64.
    fn all_others<'py>(
        &self,
        py: Python<'py>,
        given: [PyBuffer<i64>; 5],
        most: usize,
    ) -> PyResult<(Column<'py>, Column<'py>)> {
        let [low, high, bus, session, id] = given.map(|column| column.to_vec(py));
        let (low, high, bus, session, id) = (low?, high?, bus?, session?, id?);
        if [high.len(), bus.len(), session.len(), id.len()] != [low.len(); 4] {
            return Err(unfit());
        }
        let (mut begins, mut numbers) = (vec![0_i64], vec![]);
        for k in 0..low.len() {
            let range = low[k] as u64..high[k] as u64;
            let parts = self.0.parts(key(bus[k] as u8, session[k] as u32), &range);
            let others = parts.filter(|part| i64::from(part.tail & 0x1F) != id[k]).take(most);
            numbers.extend(others.map(|part| part.number as i64));
            begins.push(numbers.len() as i64);
        }
        Ok((Cells::own(py, begins)?, Cells::own(py, numbers)?))
    }

    /// Of the last `most` frames of a session from `low` to before `high`: how many there are, and the numbers of those
    /// with these bytes, the last one first.
    fn alike(&self, low: u64, high: u64, bus: u8, session: u32, data: &[u8], most: usize) -> (usize, Vec<u64>) {
        let Some((&tail, body)) = data.split_last() else {
            return (0, vec![]);
        };
        let mut count = 0;
        let last = self.0.parts(key(bus, session), &(low..high)).rev().take(most);
        let counted = last.inspect(|_| count += 1);
        let same = counted.filter(|part| part.tail == tail && part.body == body);
        let numbers = same.map(|part| part.number).collect();
        (count, numbers)
    }

    /// Shares it: it never changes.
    fn __deepcopy__(slf: Py<Self>, _memo: &Bound<'_, PyAny>) -> Py<Self> {
        slf
    }
}

/// The frames that are asked about: those of question `k` are `numbers[offsets[k]..offsets[k + 1]]`.
#[derive(FromPyObject)]
pub struct Asked {
    #[pyo3(item(0))]
    numbers: PyBuffer<u64>,
    #[pyo3(item(1))]
    offsets: PyBuffer<i64>,
    #[pyo3(item(2))]
    types: PyBuffer<u32>,
    #[pyo3(item(3))]
    fd: PyBuffer<u8>,
}

/// Form, flags and value of each answer; where its numbers begin and all of them; the same of its evidence.
type Answers<'py> = (
    Column<'py>,
    Column<'py>,
    Column<'py>,
    (Column<'py>, Column<'py>),
    (Column<'py>, Column<'py>),
);

/// Answers one question about each of some lists of frames, in the order in which they are given.
///
/// `types` are known start values of the CRC, and bytes of the payload if they never change. A list or a type that is
/// not there gets no answer: an error.
#[pyfunction]
#[allow(clippy::needless_pass_by_value)] // arguments from Python arrive by value
pub fn diagnose<'py>(
    py: Python<'py>,
    question: usize,
    batches: Vec<Bound<'py, FrameIndex>>,
    types: Vec<(Vec<u16>, Option<usize>)>,
    asked: Asked,
) -> PyResult<Answers<'py>> {
    let wrong = || PyValueError::new_err("questions that do not fit together");
    let question = *QUESTIONS.get(question).ok_or_else(wrong)?;
    let known = |(starts, size)| Known { starts, size };
    let types: Vec<Known> = types.into_iter().map(known).collect();
    let batches: Vec<&Index> = batches.iter().map(|batch| &batch.get().0).collect();
    let numbers = asked.numbers.to_vec(py)?;
    let offsets = asked.offsets.to_vec(py)?;
    let (which, fd) = (asked.types.to_vec(py)?, asked.fd.to_vec(py)?);
    let lists = offsets.windows(2).zip(which.iter().zip(&fd));
    let found: Option<Vec<Found>> = py.detach(|| {
        let answer = |(ends, (&which, &fd)): (&[i64], (&u32, &u8))| {
            let wanted = numbers.get(usize::try_from(ends[0]).ok()?..usize::try_from(ends[1]).ok()?)?;
            Some(ask(
                question,
                Frames(&batches),
                wanted,
                types.get(which as usize)?,
                fd != 0,
            ))
        };
        lists.map(answer).collect()
    });
    let found = found.ok_or_else(wrong)?;
    Ok((
        Cells::own(py, found.iter().map(|one| one.cause.form as u8).collect())?,
        Cells::own(py, found.iter().map(|one| one.flags).collect())?,
        Cells::own(py, found.iter().map(|one| one.value).collect())?,
        lists_of(py, found.iter().map(|one| &one.cause.numbers[..]))?,
        lists_of(py, found.iter().map(|one| &one.evidence[..]))?,
    ))
}

/// The tail bytes of the last frames before some in their sessions, of `look` that came before each: i16, -1 for none.
///
/// A session is the bus above 32 bits of an identifier.
#[pyfunction]
#[allow(clippy::needless_pass_by_value)] // arguments from Python arrive by value
pub fn tails_before<'py>(
    py: Python<'py>,
    batches: Vec<Bound<'py, FrameIndex>>,
    numbers: PyBuffer<i64>,
    sessions: PyBuffer<i64>,
    look: u64,
) -> PyResult<Column<'py>> {
    let batches: Vec<&Index> = batches.iter().map(|batch| &batch.get().0).collect();
    let (numbers, sessions) = (numbers.to_vec(py)?, sessions.to_vec(py)?);
    if numbers.len() != sessions.len() {
        return Err(unfit());
    }
    let tail = |(number, session): (i64, i64)| {
        let key = key((session >> 32) as u8, session as u32);
        let found = Frames(&batches).tail_before(key, number as u64, look);
        found.map_or(-1, i16::from)
    };
    let found = py.detach(|| numbers.into_iter().zip(sessions).map(tail).collect());
    Cells::own(py, found)
}

/// Where each list begins, and one more, i64; and all of their numbers, u64.
fn lists_of<'py, 'l>(py: Python<'py>, lists: impl Iterator<Item = &'l [u64]>) -> PyResult<(Column<'py>, Column<'py>)> {
    let (mut ends, mut all) = (vec![0_i64], vec![]);
    for list in lists {
        all.extend_from_slice(list);
        ends.push(all.len() as i64);
    }
    Ok((Cells::own(py, ends)?, Cells::own(py, all)?))
}
