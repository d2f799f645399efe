//! Bytes in hexadecimal, cut into pieces with labels and colours, in lines of so many bytes.

#![forbid(unsafe_code)]

use super::At;
use crate::rows::text;

/// Some of the bytes: which of them they are is told by the length of each piece.
#[derive(Debug)]
pub struct Piece {
    /// The member of the structure that says how many bytes it has; one without any is left out.
    pub length: usize,
    /// Its label, what stands before the bytes of a line, and what behind them.
    pub around: [Vec<u8>; 3],
}

/// The bytes of a member of a structure; lines behind the first are moved to the right, below its bytes.
#[derive(Debug)]
pub struct Dump {
    pub data: usize,
    pub between: Vec<u8>,
    pub per_line: usize,
    pub pieces: Vec<Piece>,
}

impl Dump {
    pub fn write(&self, out: &mut Vec<u8>, at: &At<'_>) {
        let members = &at.column.children;
        let Some(mut rest) = members.get(self.data).map(|column| column.bytes(at.row)) else {
            return;
        };
        let line = out.iter().rposition(|&byte| byte == b'\n').map_or(0, |end| end + 1);
        let (indent, mut filled, mut some) = (text::width(&out[line..]), 0, false);
        for Piece { length, around } in &self.pieces {
            let length = members.get(*length).map_or(0, |column| column.whole(at.row));
            let (mut piece, behind) = rest.split_at(rest.len().min(usize::try_from(length).unwrap_or(0)));
            rest = behind;
            if piece.is_empty() {
                continue;
            }
            out.extend_from_slice(if some { &self.between } else { b"" });
            out.extend_from_slice(&around[0]);
            some = true;
            while !piece.is_empty() {
                if filled == self.per_line {
                    out.truncate(out.trim_ascii_end().len());
                    out.push(b'\n');
                    out.resize(out.len() + indent, b' ');
                    filled = 0;
                }
                let (now, later) = piece.split_at(piece.len().min(self.per_line - filled));
                out.extend_from_slice(&around[1]);
                text::hex(out, now, b" ");
                out.extend_from_slice(&around[2]);
                filled += now.len();
                piece = later;
            }
        }
    }
}
