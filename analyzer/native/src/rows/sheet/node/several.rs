//! Several texts behind each other, with something in between.

#![forbid(unsafe_code)]

use super::{At, Node};
use crate::rows::number;
use crate::rows::text;

pub(super) fn joined<T>(
    out: &mut Vec<u8>,
    between: &[u8],
    pieces: impl Iterator<Item = T>,
    write: impl Fn(&mut Vec<u8>, T),
) {
    let mut some = false;
    for piece in pieces {
        let start = out.len();
        out.extend_from_slice(if some { between } else { b"" });
        let inner = out.len();
        write(out, piece);
        if out.len() == inner {
            out.truncate(start);
        } else {
            some = true;
        }
    }
}

pub(super) fn each(out: &mut Vec<u8>, at: &At<'_>, (between, most, more): (&[u8], usize, &[u8]), node: &Node) {
    let (Some(column), span) = (at.column.children.first(), at.column.span(at.row)) else {
        return;
    };
    for (k, row) in span.clone().take(most).enumerate() {
        out.extend_from_slice(if k > 0 { between } else { b"" });
        node.write(out, &At { column, row, ..*at });
    }
    if span.len() > most && !more.is_empty() {
        out.extend_from_slice(more);
        number::whole(out, span.len() as i128);
    }
}

pub(super) fn hex(
    out: &mut Vec<u8>,
    bytes: &[u8],
    (between, most): (&[u8], usize),
    (none, more): (&[u8], &[Vec<u8>; 2]),
) {
    if bytes.is_empty() {
        out.extend_from_slice(none);
        return;
    }
    text::hex(out, &bytes[..most.min(bytes.len())], between);
    if bytes.len() > most {
        out.extend_from_slice(&more[0]);
        number::whole(out, bytes.len() as i128);
        out.extend_from_slice(&more[1]);
    }
}
