//! How many bits values took in a payload: the layout walked once more, with the lengths and tags that were read.

#![forbid(unsafe_code)]

use super::column::{Column, Kind};
use crate::unpack::{BYTE_PREFIX, PREFIX, TAIL};

const TAIL_ELEMENT_BITS: usize = 8; // from which on an array at the end goes without its length

/// How the bits of a value lie in a payload, and which member of a structure holds what.
#[derive(Debug)]
pub enum Layout {
    Bits(usize),
    /// `count` elements, or as many as there are behind a length of so many bits.
    List {
        element: Box<Layout>,
        count: Option<usize>,
        length: usize,
        least: usize,
    },
    Struct(Vec<(Option<usize>, Layout)>),
    /// A tag of so many bits, and the one member that has a value.
    Union(usize, Vec<(Option<usize>, Layout)>),
}

/// A value, if there is one.
pub type Cell<'a> = Option<(&'a Column, usize)>;

/// Where a walk is: at which bit, and whether a tag without a member hides what follows.
#[derive(Clone, Copy, Debug, Default)]
pub struct Walk {
    pub at: usize,
    pub lost: bool,
}

/// Returns a member of a structure, if it has a value.
pub fn member(cell: Cell<'_>, place: Option<usize>) -> Cell<'_> {
    let (column, row) = cell.filter(|(column, row)| column.kind == Kind::Struct && column.has(*row))?;
    let child = column.children.get(place?)?;
    child.has(row).then_some((child, row))
}

impl Layout {
    /// Walks over a value; `code` is the layout code of what ends the payload.
    pub fn walk(&self, walk: &mut Walk, cell: Cell<'_>, code: u8) {
        match self {
            _ if walk.lost => {}
            Layout::Bits(bits) => walk.at += bits,
            Layout::Struct(members) => {
                for (k, (place, layout)) in members.iter().enumerate() {
                    let code = if k + 1 == members.len() { code } else { PREFIX };
                    layout.walk(walk, member(cell, *place), code);
                }
            }
            Layout::Union(tag, members) => {
                walk.at += tag;
                let active = members.iter().find(|(place, _)| member(cell, *place).is_some());
                match active {
                    Some((place, layout)) => layout.walk(walk, member(cell, *place), code),
                    None => walk.lost = true,
                }
            }
            Layout::List { element, .. } => {
                let (count, inner) = self.begin(walk, cell, code);
                if let Layout::Bits(bits) = **element {
                    walk.at += bits * count;
                    return;
                }
                for k in 0..count {
                    let code = if k + 1 == count { inner } else { PREFIX };
                    element.walk(walk, Layout::element(cell, k), code);
                }
            }
        }
    }

    /// Walks over the length of a list; returns how many elements it has, and the code of the last of them.
    pub fn begin(&self, walk: &mut Walk, cell: Cell<'_>, code: u8) -> (usize, u8) {
        let Layout::List {
            count, length, least, ..
        } = self
        else {
            return (0, code);
        };
        if let Some(count) = count {
            return (*count, code);
        }
        let (own, inner) = if *least >= TAIL_ELEMENT_BITS {
            (code, PREFIX)
        } else {
            (PREFIX, code)
        };
        if own != TAIL {
            walk.at += if own == BYTE_PREFIX { 8 } else { *length };
        }
        let held = cell.filter(|(column, row)| column.kind == Kind::List && column.has(*row));
        (held.map_or(0, |(column, row)| column.span(row).len()), inner)
    }

    /// Returns an element of a list, if it is there.
    pub fn element(cell: Cell<'_>, place: usize) -> Cell<'_> {
        let (column, row) = cell.filter(|(column, row)| column.kind == Kind::List && column.has(*row))?;
        let (child, span) = (column.children.first()?, column.span(row));
        let at = span.start + place;
        (at < span.end && child.has(at)).then_some((child, at))
    }
}

/// Returns the unsigned number in some bits of a payload as DroneCAN orders them: the low-order byte first, what is left
/// of a byte last; `turned`, whole bytes the other way round. None if the payload ends before.
pub fn raw(payload: &[u8], start: usize, bits: usize, turned: bool) -> Option<u64> {
    if bits == 0 || bits > 64 || start + bits > payload.len() * 8 {
        return None;
    }
    let (first, last) = (start / 8, (start + bits - 1) / 8);
    let word = payload[first..=last]
        .iter()
        .fold(0_u128, |word, &byte| word << 8 | u128::from(byte));
    let found = (word >> ((last + 1) * 8 - start - bits)) as u64 & (u64::MAX >> (64 - bits));
    let (whole, rest) = (bits / 8, bits % 8);
    if turned && rest == 0 && whole > 1 {
        return Some(found);
    }
    let value = found & !(u64::MAX << rest);
    Some((0..whole).fold(value, |value, byte| value << 8 | found >> (rest + 8 * byte) & 0xFF))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_in_bits() {
        let payload = [0b1010_0101, 0xFF, 0x34, 0x12];
        assert_eq!(raw(&payload, 0, 4, false), Some(0b1010));
        assert_eq!(raw(&payload, 16, 16, false), Some(0x1234));
        assert_eq!(raw(&payload, 16, 16, true), Some(0x3412));
        assert_eq!(raw(&payload, 0, 12, false), Some(0xFA5));
        assert_eq!(raw(&payload, 24, 16, false), None);
    }
}
