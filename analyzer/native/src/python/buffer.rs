//! Columns that Python, or the core, looks at where they lie, by the buffer protocol: handed over without a copy.

use std::ffi::c_int;
use std::ops::Deref;
use std::slice::from_raw_parts;
use std::sync::Arc;

use bytemuck::{cast_slice, try_cast_slice, Pod};
use pyo3::buffer::{Element, PyBuffer, PyUntypedBuffer};
use pyo3::exceptions::PyValueError;
use pyo3::ffi::{PyBuffer_FillInfo, Py_buffer};
use pyo3::prelude::*;

/// What owns bytes that do not move or change as long as it lives.
trait Lend: Send + Sync {
    fn bytes(&self) -> &[u8];
}

struct Own<T>(Vec<T>);

impl<T: Pod + Send + Sync> Lend for Own<T> {
    fn bytes(&self) -> &[u8] {
        cast_slice(&self.0)
    }
}

struct Part<O>(Arc<O>, fn(&O) -> &[u8]);

impl<O: Send + Sync> Lend for Part<O> {
    fn bytes(&self) -> &[u8] {
        self.1(&self.0)
    }
}

/// The cells of a column, read-only; they live as long as anything looks at them.
#[pyclass(frozen)]
pub struct Cells(Box<dyn Lend>);

impl Cells {
    pub fn own<T: Pod + Send + Sync>(py: Python<'_>, column: Vec<T>) -> PyResult<Bound<'_, Cells>> {
        Bound::new(py, Cells(Box::new(Own(column))))
    }

    /// A column of a table that others look at, too.
    pub fn part<'py, O: Send + Sync + 'static>(
        py: Python<'py>,
        table: &Arc<O>,
        column: fn(&O) -> &[u8],
    ) -> PyResult<Bound<'py, Cells>> {
        Bound::new(py, Cells(Box::new(Part(Arc::clone(table), column))))
    }
}

#[pymethods]
impl Cells {
    /// Bytes, as numpy and Arrow count a buffer.
    fn __len__(&self) -> usize {
        self.0.bytes().len()
    }

    /// # Safety
    /// Called by the interpreter alone, which gives a `view` to fill.
    #[allow(clippy::needless_pass_by_value)] // arguments from Python arrive by value
    unsafe fn __getbuffer__(slf: Bound<'_, Self>, view: *mut Py_buffer, flags: c_int) -> PyResult<()> {
        const READ_ONLY: c_int = 1;
        let bytes = slf.get().0.bytes();
        let (start, len) = (bytes.as_ptr().cast_mut().cast(), bytes.len() as isize);
        // SAFETY: `view` comes from the interpreter. The bytes belong to what `slf` holds, which nothing can change or
        // move, and the view keeps `slf` alive; a view that could write is refused.
        let filled = unsafe { PyBuffer_FillInfo(view, slf.as_ptr(), start, len, READ_ONLY, flags) };
        if filled == 0 {
            Ok(())
        } else {
            Err(PyErr::fetch(slf.py()))
        }
    }
}

/// A column of Python: where it lies if nobody may write to it, else a copy.
#[derive(Debug)]
pub enum Lent<T: Element> {
    Borrowed(PyBuffer<T>),
    Copied(Vec<T>),
}

impl<T: Element> Lent<T> {
    pub fn of(py: Python<'_>, column: PyBuffer<T>) -> PyResult<Self> {
        let kept = column.is_c_contiguous() && column.item_count() > 0;
        if kept && column.obj(py).is_some_and(never_changes) {
            Ok(Lent::Borrowed(column))
        } else {
            Ok(Lent::Copied(column.to_vec(py)?))
        }
    }
}

impl<T: Element> Deref for Lent<T> {
    type Target = [T];

    fn deref(&self) -> &[T] {
        match self {
            // SAFETY: `of` has seen that the buffer has cells, one behind the other, of this type and aligned, as
            // `PyBuffer` checks when it is made, and that what owns them lets nobody write: a buffer of Arrow. The
            // cells stay as long as the buffer is held.
            Lent::Borrowed(column) => unsafe { from_raw_parts(column.buf_ptr().cast(), column.item_count()) },
            Lent::Copied(column) => column,
        }
    }
}

/// Views of views of one owner that are looked behind.
const VIEWS: usize = 8;

/// Whether nobody can write to what owns a column. A read-only view may be one of an array that others change, and an
/// array with memory of its own may become writable again.
fn never_changes(column: &Bound<'_, PyAny>) -> bool {
    let mut owner = column.clone();
    for _ in 0..VIEWS {
        if !PyUntypedBuffer::get(&owner).is_ok_and(|buffer| buffer.readonly()) {
            return false;
        }
        // Of an array, and of a memoryview.
        match ["base", "obj"].iter().find_map(|name| owner.getattr(*name).ok()) {
            Some(behind) if behind.is_none() => return false,
            Some(behind) => owner = behind,
            None => return true,
        }
    }
    false
}

/// Bytes from Python as the cells that they are.
pub(super) fn aligned<T: Pod>(bytes: &[u8]) -> PyResult<&[T]> {
    try_cast_slice(bytes).map_err(|error| PyValueError::new_err(error.to_string()))
}
