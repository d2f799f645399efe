//! What is written of a field beside its value: the bits it took, how they look, and where they are.

#![forbid(unsafe_code)]

use super::{At, Node};
use crate::rows::layout::{member, raw, Layout, Walk};
use crate::rows::number;
use crate::rows::show::Take;
use crate::rows::text;
use crate::unpack::PREFIX;

/// Bits of the payload that a cell came from: none of them behind what is `lost`.
#[derive(Clone, Copy, Debug, Default)]
pub struct Place {
    pub walk: Walk,
    pub bits: usize,
    /// The layout code of what ends here.
    pub code: u8,
    /// Whether the bytes of numbers are the other way round.
    pub turned: bool,
    /// Which element of a list it is.
    pub index: usize,
}

/// A field: its place in a structure, how it lies in the payload, and what is written of it, all in the structure.
#[derive(Debug)]
pub struct Field {
    pub member: Option<usize>,
    pub layout: Layout,
    pub node: Option<Node>,
}

#[derive(Debug)]
pub enum Tree {
    /// A line: a text, and behind it, from so many characters on, but not directly, another one.
    Line(usize, Box<[Node; 2]>),
    /// The fields of a structure, one behind the other; the member with this place is the layout code of a message.
    Fields(Option<usize>, Vec<Field>),
    /// A tag of so many bits, and the member of a union that has a value.
    Union(usize, Vec<Field>),
    /// Each element of a list.
    Elements(Layout, Box<Node>),
    /// Packets of the transfer, in the bytes of a list, behind its length.
    Inside(usize),
    /// A template of a packet whose numbers are turned round if both members with these places are set.
    Turned([usize; 2], Box<Node>),
    /// Where the bits are, in these words: byte, bytes, bit, bits, to byte.
    Where([Vec<u8>; 5]),
    /// The byte at which the place begins, from 1.
    Byte,
    Index,
    /// The number in the bits, of the payload in this column of the transfers: hexadecimal digits, or signed or not.
    Raw {
        payload: usize,
        digits: Option<usize>,
        signed: bool,
        around: [Vec<u8>; 2],
    },
    /// What is written only if the payload holds the bits.
    Held(usize, Box<Node>),
    /// The digits of some bits of a word of this width, points for the others.
    Bits {
        take: Take,
        width: u32,
        low: u32,
        high: u32,
    },
    /// Bytes in hexadecimal, and behind them, if they are characters up to a zero, these.
    Octets(Vec<u8>, [Vec<u8>; 2]),
}

impl Tree {
    pub fn write(&self, out: &mut Vec<u8>, at: &At<'_>) {
        match self {
            Tree::Line(width, nodes) => line(out, at, *width, nodes),
            Tree::Fields(code, members) => {
                let code = code.and_then(|code| at.column.children.get(code));
                let code = code.map_or(at.place.code, |code| code.whole(at.row) as u8);
                let mut walk = at.place.walk;
                for (k, field) in members.iter().enumerate() {
                    let code = if k + 1 == members.len() { code } else { PREFIX };
                    field.write(out, at, &mut walk, code);
                }
            }
            Tree::Union(tag, members) => {
                let mut walk = at.place.walk;
                walk.at += tag;
                let cell = Some((at.column, at.row));
                if let Some(field) = members.iter().find(|field| member(cell, field.member).is_some()) {
                    field.write(out, at, &mut walk, at.place.code);
                }
            }
            Tree::Elements(layout, node) => elements(out, at, layout, node),
            Tree::Inside(slot) => inside(out, at, *slot),
            Tree::Turned(members, node) => {
                let set = |place: &usize| at.member(*place).is_some_and(|column| column.whole(at.row) != 0);
                let mut place = at.place;
                place.turned = members.iter().all(set);
                node.write(out, &At { place, ..*at });
            }
            Tree::Where(words) => wherever(out, at.place, words),
            Tree::Byte => number::whole(out, (at.place.walk.at / 8 + 1) as i128),
            Tree::Index => number::whole(out, at.place.index as i128),
            Tree::Raw {
                payload,
                digits,
                signed,
                around,
            } => {
                if let Some(word) = held(at, *payload) {
                    out.extend_from_slice(&around[0]);
                    let bits = at.place.bits;
                    let negative = *signed && word >> (bits - 1) & 1 != 0;
                    match digits {
                        Some(digits) => out.extend_from_slice(format!("{word:0digits$X}").as_bytes()),
                        None => number::whole(out, i128::from(word) - if negative { 1 << bits } else { 0 }),
                    }
                    out.extend_from_slice(&around[1]);
                }
            }
            Tree::Held(payload, node) => {
                if held(at, *payload).is_some() {
                    node.write(out, at);
                }
            }
            Tree::Bits { take, width, low, high } => {
                if let number::Value::Whole(word) = take.value(at.column, at.row) {
                    for bit in (0..*width).rev() {
                        let digit = if word >> bit & 1 != 0 { b'1' } else { b'0' };
                        out.push(if (*low..=*high).contains(&bit) { digit } else { b'.' });
                        if bit > 0 && bit % 4 == 0 {
                            out.push(b' ');
                        }
                    }
                }
            }
            Tree::Octets(none, around) => octets(out, at, none, around),
        }
    }
}

impl Field {
    fn write(&self, out: &mut Vec<u8>, at: &At<'_>, walk: &mut Walk, code: u8) {
        let start = *walk;
        let cell = member(Some((at.column, at.row)), self.member);
        self.layout.walk(walk, cell, code);
        if let Some(node) = &self.node {
            let place = Place {
                walk: start,
                bits: walk.at - start.at,
                code,
                ..at.place
            };
            node.write(out, &At { place, ..*at });
        }
    }
}

fn held(at: &At<'_>, payload: usize) -> Option<u64> {
    let Place { walk, bits, turned, .. } = at.place;
    let column = at.sheet.transfers.children.get(payload).filter(|_| !walk.lost)?;
    raw(column.bytes(at.transfer), walk.at, bits, turned)
}

fn line(out: &mut Vec<u8>, at: &At<'_>, width: usize, nodes: &[Node; 2]) {
    let start = out.len();
    nodes[0].write(out, at);
    let (end, taken) = (out.len(), text::width(&out[start..]));
    out.resize(end + width.saturating_sub(taken).max(2), b' ');
    nodes[1].write(out, at);
    out.truncate(start + out[start..].trim_ascii_end().len());
    out.push(b'\n');
}

fn inside(out: &mut Vec<u8>, at: &At<'_>, slot: usize) {
    let Place { walk, bits, .. } = at.place;
    let bytes = at.column.span(at.row).len();
    let start = if walk.lost {
        0
    } else {
        (walk.at + bits).saturating_sub(8 * bytes)
    };
    for (node, mut packet) in at.sheet.packets(at, slot) {
        let offset = packet
            .column
            .children
            .get(1)
            .map_or(0, |offsets| offsets.whole(packet.row));
        packet.place.walk.at = start + 8 * offset as usize;
        packet.place.code = PREFIX;
        node.write(out, &packet);
    }
}

fn wherever(out: &mut Vec<u8>, place: Place, words: &[Vec<u8>; 5]) {
    let (start, bits) = (place.walk.at, place.bits);
    if bits == 0 || place.walk.lost {
        return;
    }
    let [byte, bytes, bit, several, to] = words;
    let last = start + bits - 1;
    let (from, until) = ((start / 8 + 1) as i128, (last / 8 + 1) as i128);
    let (high, low) = ((7 - start % 8) as i128, (7 - last % 8) as i128);
    let whole = start.is_multiple_of(8) && bits.is_multiple_of(8);
    let mut write = |word: &[u8], value| {
        out.extend_from_slice(word);
        number::whole(out, value);
    };
    write(if whole && from != until { bytes } else { byte }, from);
    match (whole, from == until) {
        (true, true) => {}
        (true, false) => write(b"-", until),
        (false, true) if bits == 1 => write(bit, high),
        (false, true) => {
            write(several, high);
            write(b"-", low);
        }
        (false, false) => {
            write(bit, high);
            write(to, until);
            write(bit, low);
        }
    }
}

fn elements(out: &mut Vec<u8>, at: &At<'_>, layout: &Layout, node: &Node) {
    let mut walk = at.place.walk;
    let cell = Some((at.column, at.row));
    let (count, inner) = layout.begin(&mut walk, cell, at.place.code);
    let (Layout::List { element, .. }, Some(column)) = (layout, at.column.children.first()) else {
        return;
    };
    for (index, row) in at.column.span(at.row).enumerate() {
        let code = if index + 1 == count { inner } else { PREFIX };
        let start = walk;
        element.walk(&mut walk, Layout::element(cell, index), code);
        let place = Place {
            walk: start,
            bits: walk.at - start.at,
            code,
            index,
            ..at.place
        };
        node.write(
            out,
            &At {
                column,
                row,
                place,
                ..*at
            },
        );
    }
}

fn octets(out: &mut Vec<u8>, at: &At<'_>, none: &[u8], around: &[Vec<u8>; 2]) {
    if let Some(column) = at.column.children.first() {
        let bytes: Vec<u8> = at.column.span(at.row).map(|row| column.whole(row) as u8).collect();
        text::hex(out, &bytes, b" ");
        out.extend_from_slice(if bytes.is_empty() { none } else { b"" });
        let said = bytes.split(|&byte| byte == 0).next().unwrap_or_default();
        if !said.is_empty() && said.iter().all(|byte| matches!(byte, b' '..=b'~')) {
            out.extend_from_slice(&around[0]);
            out.extend_from_slice(said);
            out.extend_from_slice(&around[1]);
        }
    }
}
