//! Templates as Python gives them: nested tuples whose first element names what they are.

use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::PyTuple;

use crate::rows::layout::Layout;
use crate::rows::sheet::node::dump::{Dump, Piece};
use crate::rows::sheet::node::tree::{Field, Tree};
use crate::rows::sheet::node::{Cases, Node};
use crate::rows::show::{Show, Take};
use crate::rows::spec::Spec;

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

pub(super) fn node(of: &Bound<'_, PyTuple>) -> PyResult<Node> {
    let name: String = item(of, 0)?;
    Ok(match name.as_str() {
        "text" => Node::Text(text(of, 1)?),
        "all" => Node::All(nodes(of, 1)?),
        "joined" => Node::Joined(text(of, 1)?, nodes(of, 2)?),
        "headed" => Node::Headed(text(of, 1)?, text(of, 2)?, inner(of, 3)?),
        "of" => Node::Of(item(of, 1)?, inner(of, 2)?),
        "or" => Node::Or(text(of, 1)?, inner(of, 2)?),
        "instead" => Node::Instead(Box::new([*inner(of, 1)?, *inner(of, 2)?])),
        "like" => Node::Like(item(of, 1)?, text(of, 2)?, Box::new([*inner(of, 3)?, *inner(of, 4)?])),
        "beyond" => Node::Beyond(item(of, 1)?, inner(of, 2)?),
        "transfer" => Node::Transfer(inner(of, 1)?),
        "upper" => Node::Upper(inner(of, 1)?),
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
        "by" => Node::By(item(of, 1)?, cases(of, 2)?, inner(of, 3)?),
        "range" => Node::Range {
            member: item(of, 1)?,
            low: item::<Option<i128>>(of, 2)?.unwrap_or(i128::MIN),
            high: item::<Option<i128>>(of, 3)?.unwrap_or(i128::MAX),
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
        "dump" => Node::Dump(Dump {
            data: item(of, 1)?,
            between: text(of, 2)?,
            per_line: item(of, 3)?,
            pieces: item::<Vec<Bound<'_, PyTuple>>>(of, 4)?
                .iter()
                .map(|piece| {
                    Ok(Piece {
                        length: item(piece, 0)?,
                        around: [text(piece, 1)?, text(piece, 2)?, text(piece, 3)?],
                    })
                })
                .collect::<PyResult<_>>()?,
        }),
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
        _ => Node::Tree(tree(of, &name)?),
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

fn tree(of: &Bound<'_, PyTuple>, name: &str) -> PyResult<Tree> {
    Ok(match name {
        "line" => Tree::Line(item(of, 1)?, Box::new([*inner(of, 2)?, *inner(of, 3)?])),
        "fields" => Tree::Fields(item(of, 1)?, fields(of, 2)?),
        "union" => Tree::Union(item(of, 1)?, fields(of, 2)?),
        "elements" => Tree::Elements(layout(&item(of, 1)?)?, inner(of, 2)?),
        "inside" => Tree::Inside(item(of, 1)?),
        "turned" => Tree::Turned([item(of, 1)?, item(of, 2)?], inner(of, 3)?),
        "where" => Tree::Where([text(of, 1)?, text(of, 2)?, text(of, 3)?, text(of, 4)?, text(of, 5)?]),
        "byte" => Tree::Byte,
        "index" => Tree::Index,
        "raw" => Tree::Raw {
            payload: item(of, 1)?,
            digits: item(of, 2)?,
            signed: item(of, 3)?,
            around: [text(of, 4)?, text(of, 5)?],
        },
        "held" => Tree::Held(item(of, 1)?, inner(of, 2)?),
        "bits" => Tree::Bits {
            take: take(&item(of, 1)?)?,
            width: item(of, 2)?,
            low: item(of, 3)?,
            high: item(of, 4)?,
        },
        "octets" => Tree::Octets(text(of, 1)?, [text(of, 2)?, text(of, 3)?]),
        _ => return Err(PyValueError::new_err(format!("no template {name:?}"))),
    })
}

fn fields(of: &Bound<'_, PyTuple>, at: usize) -> PyResult<Vec<Field>> {
    let fields: Vec<Bound<'_, PyTuple>> = item(of, at)?;
    let field = |of: &Bound<'_, PyTuple>| {
        let inner: Option<Bound<'_, PyTuple>> = item(of, 2)?;
        Ok(Field {
            member: item(of, 0)?,
            layout: layout(&item(of, 1)?)?,
            node: inner.as_ref().map(node).transpose()?,
        })
    };
    fields.iter().map(field).collect()
}

fn layout(of: &Bound<'_, PyTuple>) -> PyResult<Layout> {
    let name: String = item(of, 0)?;
    Ok(match name.as_str() {
        "bits" => Layout::Bits(item(of, 1)?),
        "list" => Layout::List {
            element: Box::new(layout(&item(of, 1)?)?),
            count: item(of, 2)?,
            length: item(of, 3)?,
            least: item(of, 4)?,
        },
        "struct" => Layout::Struct(members(of, 1)?),
        "union" => Layout::Union(item(of, 1)?, members(of, 2)?),
        _ => return Err(PyValueError::new_err(format!("no layout {name:?}"))),
    })
}

fn members(of: &Bound<'_, PyTuple>, at: usize) -> PyResult<Vec<(Option<usize>, Layout)>> {
    let members: Vec<Bound<'_, PyTuple>> = item(of, at)?;
    members
        .iter()
        .map(|of| Ok((item(of, 0)?, layout(&item(of, 1)?)?)))
        .collect()
}
