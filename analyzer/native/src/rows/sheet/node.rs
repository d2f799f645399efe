//! The language of templates: what is written of a row, as a tree.

#![forbid(unsafe_code)]

pub mod dump;
mod several;
pub mod tree;

use super::Sheet;
use crate::rows::column::{Column, Kind};
use crate::rows::number::{self, Value};
use crate::rows::show::{Show, Take};
use crate::rows::text;
use dump::Dump;
use several::{each, hex, joined};
use tree::{Place, Tree};

/// Where a template is: in a cell of a column of the table of a transfer.
#[derive(Clone, Copy)]
pub struct At<'a> {
    pub sheet: &'a Sheet,
    pub transfer: usize,
    pub column: &'a Column,
    pub row: usize,
    pub place: Place,
}

/// What is written for some values.
#[derive(Debug, Default)]
pub struct Cases {
    /// By whole number, in order.
    pub whole: Vec<(i128, Node)>,
    /// By number that is not whole.
    pub real: Vec<(f64, Node)>,
}

impl Cases {
    fn find(&self, value: Value) -> Option<&Node> {
        let whole = match value {
            Value::Flag(flag) => i128::from(flag),
            Value::Whole(whole) => whole,
            #[allow(clippy::float_cmp)] // the number that has a name, and no other
            Value::Real(real) if real.fract() != 0.0 => {
                return self.real.iter().find(|(one, _)| *one == real).map(|(_, node)| node);
            }
            Value::Real(real) if real.is_finite() => real as i128,
            Value::Real(_) => return None,
        };
        let found = self.whole.binary_search_by_key(&whole, |(one, _)| *one).ok()?;
        Some(&self.whole[found].1)
    }
}

/// A piece of a template. One that stands in a cell without a value writes nothing, if nothing else is said.
#[derive(Debug)]
pub enum Node {
    Text(Vec<u8>),
    All(Vec<Node>),
    /// What is not empty, with something in between.
    Joined(Vec<u8>, Vec<Node>),
    /// A word before what follows, with something in between if that is not empty.
    Headed(Vec<u8>, Vec<u8>, Box<Node>),
    /// Of a structure, the member with this place.
    Of(usize, Box<Node>),
    /// What stands for a cell without a value.
    Or(Vec<u8>, Box<Node>),
    /// What stands for a template that writes nothing, and this.
    Instead(Box<[Node; 2]>),
    /// In capital letters.
    Upper(Box<Node>),
    /// One if the member with this place has a value, another if it has none; both of the structure itself.
    Given(usize, Box<[Node; 2]>),
    /// What is written for any other text than this one, and for none.
    Unlike(Vec<u8>, Box<Node>),
    /// One if the member with this place has this text, else another; both of the structure itself.
    Like(usize, Vec<u8>, Box<[Node; 2]>),
    /// What is written of a list that is longer than this.
    Beyond(usize, Box<Node>),
    /// A template of the transfer itself.
    Transfer(Box<Node>),
    Tree(Tree),
    /// At most so many elements of a list, with something in between; behind more than that a text, if there is one,
    /// and their number.
    Each {
        between: Vec<u8>,
        most: usize,
        more: Vec<u8>,
        node: Box<Node>,
    },
    /// Of a list, the first element, or what stands for it in an empty one.
    First(Vec<u8>, Box<Node>),
    /// How many elements a list has, or bytes a text.
    Count,
    Number(Take, Show),
    Switch(Take, Cases, Box<Node>),
    /// What is written for some values of the member with this place, or for others; both of the structure itself.
    By(usize, Cases, Box<Node>),
    /// One for whole numbers of a member in a range, and for none, another for others; both of the structure itself.
    Range {
        member: usize,
        low: i128,
        high: i128,
        inside: Box<Node>,
        outside: Box<Node>,
    },
    /// A text as it is.
    Copy,
    /// A text in the quotes and escapes of JSON, all of it ASCII.
    Json,
    /// At most so many bytes in hexadecimal, with something in between; `none` for none; the words before and behind the
    /// number of more than that.
    Hex {
        between: Vec<u8>,
        most: usize,
        none: Vec<u8>,
        more: [Vec<u8>; 2],
    },
    Dump(Dump),
    /// A list of characters as a text in quotes, at most so many; anything else as another template says.
    Chars(usize, Box<Node>),
    /// As a cell of RFC 4180, and harmless in a spreadsheet.
    Csv(Box<Node>),
    /// Blanks in front of a text, or behind it, up to a width.
    Pad {
        width: usize,
        left: bool,
        node: Box<Node>,
    },
    /// Two texts, the second moved to the right, up to a width of both.
    Apart {
        width: usize,
        nodes: Box<[Node; 2]>,
    },
    /// The word of a list of the sheet whose place is the number in the cell.
    Word(usize),
    /// A template of the message of the transfer, or what stands for a transfer without one.
    Message(usize, Vec<u8>),
    /// A template of each packet of the transfer that has it, with something in between; each, if it is empty, too.
    Packets {
        slot: usize,
        between: Vec<u8>,
        all: bool,
    },
}

impl Node {
    pub fn write(&self, out: &mut Vec<u8>, at: &At<'_>) {
        match self {
            Node::Text(text) => out.extend_from_slice(text),
            Node::All(nodes) => nodes.iter().for_each(|node| node.write(out, at)),
            Node::Joined(between, nodes) => joined(out, between, nodes.iter(), |out, node| node.write(out, at)),
            Node::Headed(head, between, node) => {
                out.extend_from_slice(head);
                let start = out.len();
                out.extend_from_slice(between);
                let inner = out.len();
                node.write(out, at);
                if out.len() == inner {
                    out.truncate(start);
                }
            }
            Node::Of(member, node) => {
                if let Some(column) = at.column.children.get(*member) {
                    node.write(out, &At { column, ..*at });
                }
            }
            Node::Or(instead, node) => {
                if at.column.has(at.row) {
                    node.write(out, at);
                } else {
                    out.extend_from_slice(instead);
                }
            }
            Node::Given(member, nodes) => nodes[usize::from(at.member(*member).is_none())].write(out, at),
            Node::Unlike(text, node) => {
                if !at.column.has(at.row) || at.column.bytes(at.row) != text {
                    node.write(out, at);
                }
            }
            Node::Like(member, text, nodes) => {
                let same = at.member(*member).is_some_and(|column| column.bytes(at.row) == text);
                nodes[usize::from(!same)].write(out, at);
            }
            Node::Beyond(most, node) if at.column.span(at.row).len() > *most => node.write(out, at),
            Node::Transfer(node) => at.sheet.write(out, node, at.transfer),
            Node::Tree(tree) => tree.write(out, at),
            Node::Each {
                between,
                most,
                more,
                node,
            } => each(out, at, (between, *most, more), node),
            Node::First(instead, node) => match (at.column.children.first(), at.column.span(at.row)) {
                (Some(column), span) if !span.is_empty() => {
                    let row = span.start;
                    node.write(out, &At { column, row, ..*at });
                }
                _ => out.extend_from_slice(instead),
            },
            Node::Switch(take, cases, otherwise) => {
                let case = if at.column.has(at.row) {
                    cases.find(take.value(at.column, at.row))
                } else {
                    None
                };
                case.unwrap_or(otherwise).write(out, at);
            }
            Node::By(member, cases, otherwise) => {
                let column = at.member(*member);
                let case = column.and_then(|column| cases.find(column.value(at.row)));
                case.unwrap_or(otherwise).write(out, at);
            }
            Node::Range {
                member,
                low,
                high,
                inside,
                outside,
            } => {
                let column = at.member(*member);
                let inner = column.is_none_or(|column| (*low..=*high).contains(&column.whole(at.row)));
                if inner { inside } else { outside }.write(out, at);
            }
            Node::Message(slot, instead) => match at.sheet.message(at, *slot) {
                Some((node, at)) => node.write(out, &at),
                None => out.extend_from_slice(instead),
            },
            Node::Packets { slot, between, all } => {
                let packets = at.sheet.packets(at, *slot);
                if *all {
                    packets.enumerate().for_each(|(k, (node, at))| {
                        out.extend_from_slice(if k > 0 { between } else { b"" });
                        node.write(out, &at);
                    });
                } else {
                    joined(out, between, packets, |out, (node, at)| node.write(out, &at));
                }
            }
            _ => self.value(out, at),
        }
    }

    /// Writes what is left: single values, and what is done to a text.
    fn value(&self, out: &mut Vec<u8>, at: &At<'_>) {
        match self {
            Node::Count => number::whole(out, at.column.span(at.row).len() as i128),
            Node::Number(take, show) if at.column.has(at.row) => show.write(out, take.value(at.column, at.row)),
            Node::Copy => out.extend_from_slice(at.column.bytes(at.row)),
            Node::Json => text::json(out, at.column.bytes(at.row)),
            Node::Hex {
                between,
                most,
                none,
                more,
            } => hex(out, at.column.bytes(at.row), (between, *most), (none, more)),
            Node::Dump(dump) => dump.write(out, at),
            Node::Chars(most, otherwise) if !text::characters(out, at.column, at.row, *most) => {
                otherwise.write(out, at);
            }
            Node::Instead(nodes) => {
                let start = out.len();
                nodes[1].write(out, at);
                if out.len() == start {
                    nodes[0].write(out, at);
                }
            }
            Node::Upper(node) => {
                let start = out.len();
                node.write(out, at);
                let text = String::from_utf8_lossy(&out.split_off(start)).to_uppercase();
                out.extend_from_slice(text.as_bytes());
            }
            Node::Csv(node) => {
                let start = out.len();
                node.write(out, at);
                text::csv(out, start);
            }
            Node::Pad { width, left, node } => {
                let start = out.len();
                node.write(out, at);
                text::pad(out, start, *width, *left);
            }
            Node::Apart { width, nodes } => {
                let start = out.len();
                nodes[0].write(out, at);
                let (middle, taken) = (out.len(), text::width(&out[start..]));
                nodes[1].write(out, at);
                text::pad(out, middle, width.abs_diff(taken), false);
            }
            Node::Word(list) => {
                let words = at.sheet.words.get(*list).map_or(&[][..], Vec::as_slice);
                let word = usize::try_from(at.column.whole(at.row))
                    .ok()
                    .and_then(|place| words.get(place));
                out.extend_from_slice(word.map_or(b"", Vec::as_slice));
            }
            _ => {}
        }
    }
}

impl<'a> At<'a> {
    /// The column of a member of the structure, if it has a value there.
    pub fn member(&self, place: usize) -> Option<&'a Column> {
        let column = self.column.children.get(place)?;
        column.has(self.row).then_some(column)
    }

    /// The cells of a table whose rows are structures.
    pub fn of(sheet: &'a Sheet, transfer: usize, table: &'a Column, row: usize) -> At<'a> {
        debug_assert_eq!(table.kind, Kind::Struct);
        At {
            sheet,
            transfer,
            column: table,
            row,
            place: Place::default(),
        }
    }
}
