//! Templates and tables of views for Python: tuples and Arrow buffers in, text out.

use std::sync::Arc;

use pyo3::buffer::PyBuffer;
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::{PyList, PyString, PyTuple};

use super::template;
use crate::rows::column::{Column, Kind};
use crate::rows::sheet::{self, Part};

/// Templates of one table, compiled once.
#[pyclass(frozen)]
pub struct Template(Arc<sheet::Template>);

#[pymethods]
impl Template {
    /// Takes a template for each place, as nested tuples whose first element names what it is; None for none.
    #[new]
    #[allow(clippy::needless_pass_by_value)] // arguments from Python arrive by value
    fn new(nodes: Vec<Option<Bound<'_, PyTuple>>>) -> PyResult<Self> {
        let nodes: PyResult<_> = nodes
            .iter()
            .map(|one| one.as_ref().map(template::node).transpose())
            .collect();
        Ok(Template(Arc::new(nodes?)))
    }
}

/// The tables of a batch, for the templates of one view.
#[pyclass(frozen)]
pub struct Sheet {
    tables: sheet::Sheet,
    template: Arc<sheet::Template>,
    picked: Vec<u32>,
}

/// A column as `analyzer.views.sheets.flat` takes it apart.
type Flat<'py> = (
    String,
    usize,
    usize,
    Option<PyBuffer<i8>>,
    Option<PyBuffer<i8>>,
    Option<PyBuffer<i8>>,
    Vec<Bound<'py, PyTuple>>,
);

#[pymethods]
impl Sheet {
    /// Takes the template of transfers with their columns; the parts, each a template, columns, and whether they are
    /// packets; words by list and place; the number of the first transfer, and the rows to write, u32.
    #[new]
    #[allow(clippy::needless_pass_by_value)] // arguments from Python arrive by value
    fn new(
        py: Python<'_>,
        template: PyRef<'_, Template>,
        transfers: Vec<Bound<'_, PyTuple>>,
        parts: Vec<(PyRef<'_, Template>, Vec<Bound<'_, PyTuple>>, bool)>,
        words: Vec<Vec<String>>,
        first: u64,
        picked: PyBuffer<u32>,
    ) -> PyResult<Self> {
        let parts: PyResult<Vec<Part>> = parts
            .into_iter()
            .map(|(template, columns, packets)| {
                let (template, table) = (template.0.clone(), table(&columns)?);
                Ok(Part {
                    template,
                    table,
                    packets,
                })
            })
            .collect();
        let words = words
            .into_iter()
            .map(|list| list.into_iter().map(String::into_bytes).collect());
        Ok(Sheet {
            tables: sheet::Sheet::new(table(&transfers)?, parts?, words.collect(), first),
            template: template.0.clone(),
            picked: picked.to_vec(py)?,
        })
    }

    /// The texts of the rows from one place in those that were picked to another.
    fn texts<'py>(&self, py: Python<'py>, start: usize, stop: usize) -> PyResult<Bound<'py, PyList>> {
        let rows = self.picked.get(start..stop.min(self.picked.len())).unwrap_or_default();
        let (mut out, mut ends) = (vec![], Vec::with_capacity(rows.len()));
        if let Some(Some(template)) = self.template.first() {
            py.detach(|| {
                for &row in rows {
                    self.tables.write(&mut out, template, row as usize);
                    ends.push(out.len());
                }
            });
        }
        let text = std::str::from_utf8(&out).map_err(|error| PyValueError::new_err(error.to_string()))?;
        let texts = PyList::empty(py);
        let mut start = 0;
        for end in ends {
            texts.append(PyString::new(py, &text[start..end]))?;
            start = end;
        }
        Ok(texts)
    }
}

fn table(columns: &[Bound<'_, PyTuple>]) -> PyResult<Column> {
    let columns: Vec<Column> = columns.iter().map(column).collect::<PyResult<_>>()?;
    Ok(Column::table(columns.first().map_or(0, |one| one.len), columns))
}

fn column(flat: &Bound<'_, PyTuple>) -> PyResult<Column> {
    let (kind, len, first, valid, ends, data, children): Flat<'_> = flat.extract()?;
    let bytes = |buffer: Option<PyBuffer<i8>>| {
        let bytes = buffer.map(|buffer| buffer.to_vec(flat.py())).transpose();
        bytes.map(|some| some.map(bytemuck::cast_vec::<i8, u8>))
    };
    let width = kind.get(1..).and_then(|width| width.parse().ok()).unwrap_or(0);
    Ok(Column {
        kind: match kind.chars().next() {
            Some('u') => Kind::Unsigned(width),
            Some('i') => Kind::Signed(width),
            Some('f') => Kind::Real(width),
            Some('?') => Kind::Flag,
            Some('b') => Kind::Bytes,
            Some('l') => Kind::List,
            Some('s') => Kind::Struct,
            _ => Kind::Null,
        },
        len,
        first,
        valid: bytes(valid)?,
        data: bytes(data)?.unwrap_or_default(),
        ends: bytes(ends)?.unwrap_or_default(),
        children: children.iter().map(column).collect::<PyResult<_>>()?,
    })
}
