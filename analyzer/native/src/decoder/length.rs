//! Which rows carry a length in front of their tail array although they came on classic CAN.
//!
//! The document prints C structures with a length byte and maximum lengths that include one, so some senders write it.
//! DSDL on classic CAN leaves it out. A row is read with a length only when that reading fits exactly.
#![forbid(unsafe_code)]

use super::number::{floats, holds};
use crate::bits::Span;
use crate::plan::{Kind, Node, Plan};
use crate::unpack::column::{Column, Data};
use crate::unpack::{unpack, Rows, Unpacked, BYTE_PREFIX, PREFIX, TAIL};

/// What tells that a length is there.
#[derive(Clone, Debug, PartialEq)]
pub enum Length {
    /// No row has one.
    Never,
    /// The byte at `at` counts those behind it, which begin with `header`.
    Counted { at: usize, header: Vec<u8> },
    /// Values are inside these limits when they are read with one.
    Fits(Vec<Limit>),
}

/// What the numbers of a field are: from `low` to `high`, or one of some special raw values.
#[derive(Clone, Debug, PartialEq)]
pub struct Limit {
    pub field: usize,
    pub low: f64,
    pub high: f64,
    pub special: Vec<u64>,
}

impl Length {
    /// What the rows at `spans` unpack to, and the layout code of each; those on CAN FD always have a length.
    pub fn unpack(&self, plan: &Plan, spans: &[Span], fd: &[u8], payload: &[u8]) -> (Vec<u8>, Unpacked) {
        let mut codes: Vec<u8> = fd.iter().map(|&fd| if fd == 0 { TAIL } else { PREFIX }).collect();
        let read = |codes: &[u8]| unpack(plan, Rows { spans, layouts: codes }, payload);
        let found = match self {
            Length::Never => None,
            Length::Counted { at, header } => {
                for (code, span) in codes.iter_mut().zip(spans).filter(|(code, _)| **code == TAIL) {
                    if is_counted(payload, *span, *at, header) {
                        *code = PREFIX;
                    }
                }
                None
            }
            Length::Fits(limits) => {
                let usual = read(&codes);
                let rows: Vec<usize> = (0..spans.len())
                    .filter(|&row| codes[row] == TAIL && usual.left[row] >= 8)
                    .collect();
                let best = fitting(plan, limits, &rows, spans, payload);
                rows.iter().zip(&best).for_each(|(&row, &code)| codes[row] = code);
                best.iter().all(|&code| code == TAIL).then_some(usual)
            }
        };
        let found = found.unwrap_or_else(|| read(&codes));
        (codes, found)
    }
}

/// The layout code of some rows, of which the usual reading leaves a byte or more.
fn fitting(plan: &Plan, limits: &[Limit], rows: &[usize], spans: &[Span], payload: &[u8]) -> Vec<u8> {
    let mut best = vec![TAIL; rows.len()];
    if rows.is_empty() {
        return best;
    }
    let spans: Vec<Span> = rows.iter().map(|&row| spans[row]).collect();
    for code in [BYTE_PREFIX, PREFIX] {
        let layouts = vec![code; rows.len()];
        let tried = unpack(
            plan,
            Rows {
                spans: &spans,
                layouts: &layouts,
            },
            payload,
        );
        let good = plausible(plan, limits, &tried.root);
        for (row, best) in best.iter_mut().enumerate() {
            let fits = (0..8).contains(&tried.left[row]) && tried.dirty[row] == 0;
            if fits && (good[row] || *best == TAIL) {
                *best = code;
            }
        }
    }
    best
}

/// Rows in which every limited number is inside its limits.
fn plausible(plan: &Plan, limits: &[Limit], root: &Column) -> Vec<bool> {
    let mut good = vec![true; root.len()];
    let (Kind::Struct(nodes) | Kind::Union { members: nodes, .. }, Data::Struct(columns)) =
        (&plan.root.kind, &root.data)
    else {
        return good;
    };
    for limit in limits {
        let Some((node, column)) = nodes.get(limit.field).zip(columns.get(limit.field)) else {
            continue;
        };
        match (&node.kind, &column.data) {
            (Kind::Array { element, .. } | Kind::List { element, .. }, Data::List { offsets, child }) => {
                let cells = limit.holds(element, child);
                for (row, ends) in offsets.windows(2).enumerate() {
                    let mine = ends[0].unsigned_abs() as usize..ends[1].unsigned_abs() as usize;
                    good[row] &= !column.is_valid(row) || cells[mine].iter().all(|&cell| cell);
                }
            }
            _ => good
                .iter_mut()
                .zip(limit.holds(node, column))
                .for_each(|(good, cell)| *good &= cell),
        }
    }
    good
}

impl Limit {
    /// The cells that are inside, or null; all of them where there are no numbers.
    fn holds(&self, node: &Node, column: &Column) -> Vec<bool> {
        let special = holds(&column.data, &self.special);
        let Some(values) = floats(node, &column.data, |raw| raw) else {
            return vec![true; column.len()];
        };
        let inside = |(row, cell): (usize, &[u8; 8])| {
            (self.low..=self.high).contains(&f64::from_le_bytes(*cell))
                || !column.is_valid(row)
                || special.as_ref().is_some_and(|special| special.get(row))
        };
        values.as_chunks().0.iter().enumerate().map(inside).collect()
    }
}

fn is_counted(payload: &[u8], span: Span, at: usize, header: &[u8]) -> bool {
    let bytes = payload.get(span.start..span.end);
    let Some((&count, rest)) = bytes.and_then(|bytes| bytes.get(at..)?.split_first()) else {
        return false;
    };
    rest.len() >= header.len().max(1) && usize::from(count) == rest.len() && rest.starts_with(header)
}
