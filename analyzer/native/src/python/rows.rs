//! Templates and tables of views for Python: tuples and Arrow buffers in, text out.

use std::sync::Arc;

use pyo3::buffer::PyBuffer;
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::{PyList, PyString, PyTuple};

use crate::rows::column::{Column, Kind};
use crate::rows::sheet::node::{Cases, Node};
use crate::rows::sheet::{self, Part};
use crate::rows::show::{Show, Take};
use crate::rows::spec::Spec;

/// Templates of one table, compiled once.
#[pyclass(frozen)]
pub struct Template(Arc<sheet::Template>);

#[pymethods]
impl Template {
    /// Takes a template for each place, as nested tuples whose first element names what it is; None for none.
    #[new]
    #[allow(clippy::needless_pass_by_value)] // arguments from Python arrive by value
    fn new(nodes: Vec<Option<Bound<'_, PyTuple>>>) -> PyResult<Self> {
        let nodes: PyResult<_> = nodes.iter().map(|one| one.as_ref().map(node).transpose()).collect();
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

/// Returns an element of a tuple.
fn item<'py, T: for<'a> FromPyObject<'a, 'py>>(of: &Bound<'py, PyTuple>, at: usize) -> PyResult<T> {
    of.get_item(at)?.extract().map_err(Into::into)
}

fn text(of: &Bound<'_, PyTuple>, at: usize) -> PyResult<Vec<u8>> {
    Ok(item::<String>(of, at)?.into_bytes())
}

fn inner(of: &Bound<'_, PyTuple>, at: usize) -> PyResult<Box<Node>> {
    Ok(Box::new(node(&item(of, at)?)?))
}

fn nodes(of: &Bound<'_, PyTuple>, at: usize) -> PyResult<Vec<Node>> {
    item::<Vec<Bound<'_, PyTuple>>>(of, at)?.iter().map(node).collect()
}

fn node(of: &Bound<'_, PyTuple>) -> PyResult<Node> {
    let name: String = item(of, 0)?;
    Ok(match name.as_str() {
        "text" => Node::Text(text(of, 1)?),
        "all" => Node::All(nodes(of, 1)?),
        "joined" => Node::Joined(text(of, 1)?, nodes(of, 2)?),
        "headed" => Node::Headed(text(of, 1)?, text(of, 2)?, inner(of, 3)?),
        "of" => Node::Of(item(of, 1)?, inner(of, 2)?),
        "or" => Node::Or(text(of, 1)?, inner(of, 2)?),
        "given" => Node::Given(item(of, 1)?, Box::new([*inner(of, 2)?, *inner(of, 3)?])),
        "unlike" => Node::Unlike(text(of, 1)?, inner(of, 2)?),
        "each" => Node::Each {
            between: text(of, 1)?,
            most: item(of, 2)?,
            more: text(of, 3)?,
            node: inner(of, 4)?,
        },
        "first" => Node::First(text(of, 1)?, inner(of, 2)?),
        "count" => Node::Count,
        "number" => Node::Number(take(&item(of, 1)?)?, show(&item(of, 2)?)?),
        "switch" => Node::Switch(take(&item(of, 1)?)?, cases(of, 2)?, inner(of, 3)?),
        "range" => Node::Range {
            take: take(&item(of, 1)?)?,
            low: item::<Option<i64>>(of, 2)?.map_or(i128::MIN, i128::from),
            high: item::<Option<i64>>(of, 3)?.map_or(i128::MAX, i128::from),
            inside: inner(of, 4)?,
            outside: inner(of, 5)?,
        },
        "copy" => Node::Copy,
        "json" => Node::Json,
        "hex" => Node::Hex {
            between: text(of, 1)?,
            most: item(of, 2)?,
            none: text(of, 3)?,
            more: [text(of, 4)?, text(of, 5)?],
        },
        "chars" => Node::Chars(item(of, 1)?, inner(of, 2)?),
        "csv" => Node::Csv(inner(of, 1)?),
        "pad" => Node::Pad {
            width: item(of, 1)?,
            left: item(of, 2)?,
            node: inner(of, 3)?,
        },
        "apart" => Node::Apart {
            width: item(of, 1)?,
            nodes: Box::new([*inner(of, 2)?, *inner(of, 3)?]),
        },
        "word" => Node::Word(item(of, 1)?),
        "message" => Node::Message(item(of, 1)?, text(of, 2)?),
        "packets" => Node::Packets {
            slot: item(of, 1)?,
            between: text(of, 2)?,
            all: item(of, 3)?,
        },
        _ => return Err(PyValueError::new_err(format!("no template {name:?}"))),
    })
}

fn take(of: &Bound<'_, PyTuple>) -> PyResult<Take> {
    Ok(Take {
        unscaled: item(of, 0)?,
        bits: item(of, 1)?,
        scaled: item(of, 2)?,
        flag: item(of, 3)?,
    })
}

fn show(of: &Bound<'_, PyTuple>) -> PyResult<Show> {
    let name: String = item(of, 0)?;
    Ok(match name.as_str() {
        "json" => Show::Json {
            no: text(of, 1)?,
            yes: text(of, 2)?,
            quoted: item(of, 3)?,
        },
        "plain" => Show::Plain,
        "format" => Show::Format(Spec {
            align: letter(of, 1)?,
            sign: letter(of, 2)?,
            zeros: item(of, 3)?,
            width: item(of, 4)?,
            precision: item(of, 5)?,
            kind: letter(of, 6)?,
        }),
        "seconds" => Show::Seconds {
            signed: item(of, 1)?,
            nine: item(of, 2)?,
        },
        "decimals" => Show::Decimals { nine: item(of, 1)? },
        "from one" => Show::FromOne,
        _ => return Err(PyValueError::new_err(format!("no number {name:?}"))),
    })
}

fn letter(of: &Bound<'_, PyTuple>, at: usize) -> PyResult<u8> {
    Ok(item::<String>(of, at)?.bytes().next().unwrap_or(0))
}

/// Takes pairs of a number and a template.
fn cases(of: &Bound<'_, PyTuple>, at: usize) -> PyResult<Cases> {
    let mut cases = Cases::default();
    for pair in item::<Vec<Bound<'_, PyTuple>>>(of, at)? {
        match item::<i128>(&pair, 0) {
            Ok(whole) => cases.whole.push((whole, *inner(&pair, 1)?)),
            Err(_) => cases.real.push((item(&pair, 0)?, *inner(&pair, 1)?)),
        }
    }
    cases.whole.sort_by_key(|(whole, _)| *whole);
    Ok(cases)
}
