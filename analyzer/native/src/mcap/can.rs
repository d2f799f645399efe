//! The fields of a message to a frame: identifier words, flags and lengths mean here what they mean in candump text.
#![forbid(unsafe_code)]

use crate::frames::{
    DLC_SHIFT, EXTENDED, FD, ID_MASK, MAX_CLASSIC, MAX_DATA, MAX_STANDARD, REMOTE, WORD_ERROR, WORD_EXTENDED,
    WORD_REMOTE,
};
use crate::line::Reason;

/// What a message says.
pub(super) struct Can<'a> {
    /// Identifier, perhaps with the kernel's flag bits.
    pub id: u32,
    /// `None`: the message does not say; the identifier shows it.
    pub extended: Option<bool>,
    pub remote: bool,
    pub error: bool,
    pub fd: bool,
    /// Further bits of [`crate::frames`].
    pub marks: u16,
    /// Length of a remote frame, raw length code above 8 of a classic data frame, else 0.
    pub code: u8,
    pub data: &'a [u8],
}

pub(super) enum Row<'a> {
    Frame { id: u32, flags: u16, data: &'a [u8] },
    Error { class: u32, flags: u16, data: &'a [u8] },
}

impl<'a> Can<'a> {
    /// # Errors
    /// The reason why no such frame can be on a bus.
    pub fn row(&self) -> Result<Row<'a>, Reason> {
        let (id, mut data) = (self.id & ID_MASK, self.data);
        if self.error || self.id & WORD_ERROR != 0 {
            within(data.len(), MAX_CLASSIC)?;
            let flags = self.marks;
            return Ok(Row::Error { class: id, flags, data });
        }
        within(data.len(), MAX_DATA)?;
        let mut flags = self.marks | if self.fd { FD } else { 0 };
        if self.id & WORD_EXTENDED != 0 || self.extended.unwrap_or(id > MAX_STANDARD) {
            flags |= EXTENDED;
        } else if id > MAX_STANDARD {
            return Err("standard identifier above 7FF".into());
        }
        if self.remote || self.id & WORD_REMOTE != 0 {
            if self.fd {
                return Err("remote request on a CAN FD frame".into());
            }
            within(data.len(), MAX_CLASSIC)?;
            flags |= REMOTE;
            data = &[];
        }
        if flags & REMOTE != 0 || usize::from(self.code) > MAX_CLASSIC {
            flags |= u16::from(self.code & 15) << DLC_SHIFT;
        }
        Ok(Row::Frame { id, flags, data })
    }
}

/// # Errors
/// That `length` bytes of data are more than `limit`.
pub(super) fn within(length: usize, limit: usize) -> Result<usize, Reason> {
    if length > limit {
        return Err(format!("data longer than {limit} bytes").into());
    }
    Ok(length)
}
