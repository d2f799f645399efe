//! A CAN frame as Linux lays it out: the identifier word, `struct can_frame`, `struct canfd_frame`.
#![forbid(unsafe_code)]

use crate::binary::Order;
use crate::frames::{
    BRS, DLC_SHIFT, ERROR, ESI, EXTENDED, FD, ID_MASK, MAX_STANDARD, REMOTE, WORD_ERROR, WORD_EXTENDED, WORD_REMOTE,
};
use crate::line::Reason;
use crate::reader::Rows;

/// Bytes of `struct canfd_frame`.
pub const LONGEST: usize = 72;

/// Bits of the flags byte of `struct canfd_frame`, and of the length byte of CAN XL.
const FLAG_BRS: u8 = 1;
const FLAG_ESI: u8 = 2;
const FLAG_FD: u8 = 4;
const FLAG_XL: u8 = 0x80;
const MAX_CODE: u8 = 15;
const MAX_CLASSIC: u8 = crate::frames::MAX_CLASSIC as u8;
/// Data bytes by the length code of a CAN FD frame.
const FD_LENGTHS: [usize; 16] = [0, 1, 2, 3, 4, 5, 6, 7, 8, 12, 16, 20, 24, 32, 48, 64];

/// A frame of the first table, or an error frame (`ERROR` in its flags, class bits as its identifier).
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Frame<'a> {
    pub id: u32,
    /// Bits of [`crate::frames`].
    pub flags: u16,
    pub data: &'a [u8],
}

impl<'a> Frame<'a> {
    /// Reads a captured `can_frame` or `canfd_frame`, possibly without its last padding. It is CAN FD if `fd` says so,
    /// if its flags do, if the whole packet had `original` = 72 bytes, or if classic CAN could not carry its data:
    /// older writers leave the flag out. Other bits of the flags and reserved bytes are uninitialised in old captures
    /// and make the flags void.
    ///
    /// # Errors
    /// What is wrong with it.
    pub fn read(packet: &'a [u8], original: usize, order: Order, fd: bool) -> Result<Frame<'a>, Reason> {
        let Some(([_, _, _, _, length, flags, reserved, code], data)) = packet.split_first_chunk() else {
            return Err(format!(
                "packet of {} bytes, shorter than the header of a CAN frame",
                packet.len()
            )
            .into());
        };
        if length & FLAG_XL != 0 {
            return Err("CAN XL frame".into());
        }
        if packet.len() > LONGEST {
            return Err(format!("packet of {} bytes, longer than a CAN frame", packet.len()).into());
        }
        let word = order.u32(packet, 0);
        let stated =
            flags & !(FLAG_FD | FLAG_BRS | FLAG_ESI) == 0 && (*reserved, *code) == (0, 0) && flags & FLAG_FD != 0;
        if fd || stated || original == LONGEST || *length > MAX_CLASSIC {
            let data = data.get(..usize::from(*length)).ok_or_else(|| missing(*length))?;
            let flag = |bit, set| if flags & bit != 0 { set } else { 0 };
            return Frame::fd(word, flag(FLAG_BRS, BRS) | flag(FLAG_ESI, ESI), data);
        }
        let raw = *length == MAX_CLASSIC && (MAX_CLASSIC..=MAX_CODE).contains(code) && (*flags, *reserved) == (0, 0);
        Frame::classic(word, if raw { *code } else { *length }, data)
    }

    /// A classic frame with its raw length code, 0 to 15; `data` holds at least as many bytes as it has.
    ///
    /// # Errors
    /// What is wrong with it.
    pub fn classic(word: u32, code: u8, data: &'a [u8]) -> Result<Frame<'a>, Reason> {
        if code > MAX_CODE {
            return Err(format!("length code {code}").into());
        }
        let (id, flags) = identifier(word)?;
        let shown = u16::from(code) << DLC_SHIFT;
        if flags & REMOTE != 0 {
            return Ok(Frame {
                id,
                flags: flags | shown,
                data: &[],
            });
        }
        let length = code.min(MAX_CLASSIC);
        let data = data.get(..usize::from(length)).ok_or_else(|| missing(length))?;
        let flags = if code > MAX_CLASSIC { flags | shown } else { flags };
        Ok(Frame { id, flags, data })
    }

    /// A CAN FD frame with its flags `BRS` and `ESI`.
    ///
    /// # Errors
    /// What is wrong with it.
    pub fn fd(word: u32, flags: u16, data: &'a [u8]) -> Result<Frame<'a>, Reason> {
        let (id, more) = identifier(word)?;
        if more & (REMOTE | ERROR) != 0 {
            return Err("CAN FD frame marked as remote or error frame".into());
        }
        if data.len() > LONGEST - 8 {
            return Err(format!("{} bytes of data", data.len()).into());
        }
        Ok(Frame {
            id,
            flags: flags | more | FD,
            data,
        })
    }

    /// Makes its row.
    pub fn push(&self, t: i64, bus: u8, rows: &mut Rows) {
        if self.flags & ERROR != 0 {
            rows.error_frame(t, bus, self.id, self.flags, self.data);
        } else {
            rows.frame(t, bus, self.id, self.flags, self.data);
        }
    }
}

/// The identifier alone, and `EXTENDED`, `REMOTE` and `ERROR` from the bits above it; of an error frame its class.
///
/// # Errors
/// What is wrong with it.
pub fn identifier(word: u32) -> Result<(u32, u16), Reason> {
    let id = word & ID_MASK;
    if word & WORD_ERROR != 0 {
        return Ok((id, ERROR));
    }
    let remote = if word & WORD_REMOTE != 0 { REMOTE } else { 0 };
    if word & WORD_EXTENDED != 0 {
        Ok((id, remote | EXTENDED))
    } else if id <= MAX_STANDARD {
        Ok((id, remote))
    } else {
        Err("standard identifier above 7FF".into())
    }
}

/// The bytes of data that a length code of CAN FD stands for.
pub fn fd_length(code: u8) -> Option<usize> {
    FD_LENGTHS.get(usize::from(code)).copied()
}

fn missing(length: u8) -> Reason {
    format!("less than its {length} bytes of data").into()
}
