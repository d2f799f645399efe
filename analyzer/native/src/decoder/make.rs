//! What a profile makes of the fields of a layout: a column each, in the order of the table.
#![forbid(unsafe_code)]

use super::number::{flags, floats, holds, number, outside, reals, slices, valid_without, Linear, Number};
use super::words::{append_text, date};
use crate::plan::{Kind, Node};
use crate::unpack::column::{Bitmap, Column, Data};

/// What a slice of a word is shown as.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Look {
    Flag,
    Number,
    Physical(Linear),
}

/// How a value is read whose unit follows another field: raw * `exact` of a whole number, else raw * `factor`.
#[derive(Clone, Debug, PartialEq)]
pub struct Measure {
    pub mode: u64,
    pub exact: Linear,
    pub factor: f64,
    pub unit: String,
}

/// Adds `add` to a value in `start` <= value < `stop`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Piece {
    pub start: f64,
    pub stop: f64,
    pub add: f64,
}

/// How a derived value comes from a raw one; without a value are those outside `low` to `high`, and those `without`.
#[derive(Clone, Debug, PartialEq)]
pub struct Formula {
    pub linear: Linear,
    pub pieces: Vec<Piece>,
    pub low: f64,
    pub high: f64,
    pub without: Vec<u64>,
}

/// One or two columns of a table. Fields are places in the outermost structure, voids counted.
#[derive(Clone, Debug, PartialEq)]
pub enum Make {
    /// The field itself, with the numbers at some paths scaled: places of members, down through lists.
    Shown {
        field: usize,
        scales: Vec<(Vec<usize>, Linear)>,
    },
    /// Bits of a word, null where it holds a value of `without`.
    Part {
        field: usize,
        low: u32,
        width: u32,
        look: Look,
        without: Vec<u64>,
    },
    /// Bytes as text.
    Text { field: usize },
    /// Number and unit of a value whose unit follows the field `by`.
    Measured {
        field: usize,
        by: usize,
        measures: Vec<Measure>,
    },
    /// Computed from a number, element by element of a list, or from one element of it.
    Derived {
        field: usize,
        element: Option<usize>,
        formula: Formula,
    },
    /// The day that a number names.
    Day { field: usize, element: Option<usize> },
}

impl Make {
    /// Appends its columns; a field that is shown is taken out of `columns` last of all, by [`Make::show`].
    pub fn run(&self, fields: &[Node], columns: &[Column], out: &mut Vec<Option<Column>>) {
        let of = |field: usize| fields.get(field).zip(columns.get(field));
        match self {
            Make::Shown { .. } => out.push(None),
            Make::Part {
                field,
                low,
                width,
                look,
                without,
            } => {
                out.push(columns.get(*field).map(|word| part(word, *low, *width, *look, without)));
            }
            Make::Text { field } => out.push(columns.get(*field).map(text)),
            Make::Measured { field, by, measures } => {
                let pair = of(*field).zip(of(*by)).map(|(value, by)| measured(value, by, measures));
                let (value, unit) = pair.unzip();
                out.extend([value, unit]);
            }
            Make::Derived {
                field,
                element,
                formula,
            } => {
                out.push(of(*field).map(|of| derived(of, *element, &|node, column| formula.column(node, column))));
            }
            Make::Day { field, element } => out.push(of(*field).map(|of| derived(of, *element, &days))),
        }
    }

    /// The field that is shown, out of `columns`.
    pub fn show(&self, fields: &[Node], columns: &mut [Column]) -> Option<Column> {
        let Make::Shown { field, scales } = self else {
            return None;
        };
        let empty = Column::filled(0, None, Data::Void);
        let mut column = std::mem::replace(columns.get_mut(*field)?, empty);
        for (path, linear) in scales {
            scale(&fields[*field], &mut column, path, linear);
        }
        Some(column)
    }
}

fn scale(node: &Node, column: &mut Column, path: &[usize], linear: &Linear) {
    match (&node.kind, &mut column.data, path) {
        (Kind::Array { element, .. } | Kind::List { element, .. }, Data::List { child, .. }, _) => {
            scale(element, child, path, linear);
        }
        (Kind::Struct(nodes) | Kind::Union { members: nodes, .. }, Data::Struct(children), [at, path @ ..]) => {
            if let (Some(node), Some(child)) = (nodes.get(*at), children.get_mut(*at)) {
                scale(node, child, path, linear);
            }
        }
        (_, data, _) => {
            if let Some(values) = floats(node, data, |raw| linear.of(raw)) {
                *data = Data::Scalar { width: 8, values };
            }
        }
    }
}

fn part(column: &Column, low: u32, width: u32, look: Look, without: &[u64]) -> Column {
    let validity = valid_without(column, &[holds(&column.data, without)]);
    if look == Look::Flag {
        return Column::filled(column.len(), validity, Data::Bool(flags(&column.data, low)));
    }
    let (size, values) = slices(&column.data, low, width);
    let data = Data::Scalar { width: size, values };
    let Look::Physical(linear) = look else {
        return Column::filled(column.len(), validity, data);
    };
    let node = Node::unsigned(width);
    reals(floats(&node, &data, |raw| linear.of(raw)).unwrap_or_default(), validity)
}

/// Texts of some rows, of which `write` appends one, unless it has none.
fn texts(rows: usize, write: impl Fn(&mut String, usize) -> Option<()>) -> Column {
    let (mut offsets, mut out, mut missing) = (Vec::with_capacity(rows + 1), String::new(), vec![]);
    offsets.push(0);
    for row in 0..rows {
        if write(&mut out, row).is_none() {
            missing.push(row);
        }
        offsets.push(i32::try_from(out.len()).unwrap_or(i32::MAX));
    }
    let gone = |row: usize| missing.binary_search(&row).is_ok();
    let validity = (!missing.is_empty()).then(|| Bitmap::of(rows, |row| !gone(row)));
    let bytes = out.into_bytes();
    Column::filled(rows, validity, Data::Text { offsets, bytes })
}

fn text(column: &Column) -> Column {
    let (offsets, values) = match &column.data {
        Data::List { offsets, child } => match &child.data {
            Data::Scalar { values, .. } => (&offsets[..], &values[..]),
            _ => (&offsets[..], &[][..]),
        },
        _ => (&[][..], &[][..]),
    };
    texts(column.len(), |out, row| {
        let ends = offsets.get(row..row + 2)?;
        let raw = values.get(ends[0].unsigned_abs() as usize..ends[1].unsigned_abs() as usize)?;
        column.is_valid(row).then(|| append_text(out, raw))
    })
}

fn measured(value: (&Node, &Column), by: (&Node, &Column), measures: &[Measure]) -> (Column, Column) {
    let (column, rows) = (value.1, value.1.len());
    let measure = |row: usize| {
        let mode = number(by.0, &by.1.data, row).filter(|_| by.1.is_valid(row))?;
        measures.iter().find(|one| Number::Whole(one.mode.into()) == mode)
    };
    let physical = |row: usize| {
        let raw = number(value.0, &column.data, row).filter(|_| column.is_valid(row))?;
        let measure = measure(row)?;
        Some(match raw {
            Number::Whole(_) => measure.exact.of(raw.float()),
            Number::Real(raw) => raw * measure.factor,
        })
    };
    let cells: Vec<Option<f64>> = (0..rows).map(physical).collect();
    let whole = cells.iter().all(Option::is_some);
    let validity = (!whole).then(|| Bitmap::of(rows, |row| cells[row].is_some()));
    let values = cells
        .iter()
        .flat_map(|cell| cell.unwrap_or_default().to_le_bytes())
        .collect();
    let units = texts(rows, |out, row| {
        cells[row]?;
        out.push_str(&measure(row)?.unit);
        Some(())
    });
    (reals(values, validity), units)
}

/// What `make` makes of the numbers of a column, in lists if it is one, or of one element of each.
fn derived(source: (&Node, &Column), element: Option<usize>, make: &dyn Fn(&Node, &Column) -> Column) -> Column {
    let (node, column) = source;
    match (&node.kind, &column.data, element) {
        (Kind::Array { element: of, .. } | Kind::List { element: of, .. }, Data::List { offsets, child }, place) => {
            if let Some(place) = place {
                return make(of, &at(offsets, child, place));
            }
            let data = Data::List {
                offsets: offsets.clone(),
                child: Box::new(make(of, child)),
            };
            Column::filled(column.len(), column.validity().cloned(), data)
        }
        _ => make(node, column),
    }
}

/// The element at `place` of each list, null where there are fewer.
fn at(offsets: &[i32], child: &Column, place: usize) -> Column {
    let (rows, width) = (
        offsets.len().saturating_sub(1),
        match &child.data {
            Data::Scalar { width, .. } => *width,
            _ => 0,
        },
    );
    let cell = |row: usize| {
        let at = offsets[row].unsigned_abs() as usize + place;
        (at < offsets[row + 1].unsigned_abs() as usize && child.is_valid(at)).then_some(at)
    };
    let mut values = vec![0; rows * width];
    if let Data::Scalar { values: from, .. } = &child.data {
        for row in 0..rows {
            if let Some(at) = cell(row) {
                values[row * width..(row + 1) * width].copy_from_slice(&from[at * width..(at + 1) * width]);
            }
        }
    }
    let valid = Bitmap::of(rows, |row| cell(row).is_some());
    let all = (0..rows).all(|row| valid.get(row));
    Column::filled(rows, (!all).then_some(valid), Data::Scalar { width, values })
}

fn days(node: &Node, column: &Column) -> Column {
    texts(column.len(), |out, row| {
        let raw = number(node, &column.data, row).filter(|_| column.is_valid(row))?;
        out.push_str(&date(raw)?);
        Some(())
    })
}

impl Formula {
    fn column(&self, node: &Node, column: &Column) -> Column {
        let value = |raw: f64| {
            let value = self.linear.of(raw);
            let piece = self
                .pieces
                .iter()
                .find(|piece| value >= piece.start && value < piece.stop);
            piece.map_or(value, |piece| value + piece.add)
        };
        let values = if self.pieces.is_empty() {
            floats(node, &column.data, |raw| self.linear.of(raw))
        } else {
            floats(node, &column.data, value)
        };
        let [low, high] = [self.low, self.high].map(|limit| rounded(node, limit));
        let limited = low > f64::NEG_INFINITY || high < f64::INFINITY;
        let beyond = limited.then(|| outside(node, &column.data, low, high)).flatten();
        let without = [holds(&column.data, &self.without), beyond];
        reals(values.unwrap_or_default(), valid_without(column, &without))
    }
}

/// A limit in the precision of the numbers that it is for.
fn rounded(node: &Node, limit: f64) -> f64 {
    if node.width() == 4
        && matches!(
            node.kind,
            Kind::Scalar {
                form: crate::plan::Form::Float,
                ..
            }
        )
    {
        f64::from(limit as f32)
    } else {
        limit
    }
}
