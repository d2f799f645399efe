//! ROS messages: fields in the order of their definition, aligned (CDR) or packed (ROS 1).
#![forbid(unsafe_code)]

use super::can::{within, Can};
use super::{Kind, Message, Wire, OUT_OF_RANGE};
use crate::frames::{MAX_CLASSIC, MAX_DATA};
use crate::line::Reason;

const SECOND: u32 = 1_000_000_000;
/// CDR writers may fill up the last word.
const CDR_PADDING: usize = 3;
const ENDS_EARLY: Reason = Reason::Borrowed("data ends early");

/// # Errors
/// The reason why `data` is no such message.
pub(super) fn read(wire: Wire, kind: Kind, data: &[u8]) -> Result<Message<'_>, Reason> {
    if wire == Wire::Ros1 {
        return Fields::<false, false>::read(data, kind, 0);
    }
    let (head, data) = data.split_at_checked(4).ok_or(ENDS_EARLY)?;
    match head {
        // Plain CDR of either version: without fields of 8 bytes they are the same.
        [0, 1 | 7, _, _] => Fields::<true, false>::read(data, kind, CDR_PADDING),
        [0, 0 | 6, _, _] => Fields::<true, true>::read(data, kind, CDR_PADDING),
        _ => Err(format!("CDR encapsulation {:02X}{:02X} not understood", head[0], head[1]).into()),
    }
}

/// Time and text of a log message of ROS 2.
///
/// # Errors
/// The reason why `data` is none.
pub(super) fn log(data: &[u8]) -> Result<(Option<i64>, &[u8]), Reason> {
    let (head, data) = data.split_at_checked(4).ok_or(ENDS_EARLY)?;
    if !matches!(head, [0, 1 | 7, ..]) {
        return Err(format!("CDR encapsulation {:02X}{:02X} not understood", head[0], head[1]).into());
    }
    let mut fields = Fields::<true, false> { data, at: 0 };
    let stamp = fields.stamp()?;
    let [_level] = *fields.bytes::<1>()?;
    fields.string()?; // who says it
    Ok((stamp, fields.string()?))
}

/// What is left of a message. Alignment counts from its first field.
struct Fields<'a, const ALIGNED: bool, const BIG: bool> {
    data: &'a [u8],
    at: usize,
}

impl<'a, const ALIGNED: bool, const BIG: bool> Fields<'a, ALIGNED, BIG> {
    #[inline]
    fn read(data: &'a [u8], kind: Kind, padding: usize) -> Result<Message<'a>, Reason> {
        let mut fields = Self { data, at: 0 };
        let stamp = fields.stamp()?;
        let name = fields.string()?;
        let can = fields.can(kind)?;
        if data.len() - fields.at > padding {
            return Err(format!("{} bytes too many", data.len() - fields.at).into());
        }
        Ok(Message { stamp, name, can })
    }

    fn stamp(&mut self) -> Result<Option<i64>, Reason> {
        if !ALIGNED {
            self.word()?; // sequence number
        }
        let (seconds, nanoseconds) = (self.word()?, self.word()?);
        // ROS 2 has signed seconds, and no clock from before 1970.
        if nanoseconds >= SECOND || (ALIGNED && seconds > i32::MAX as u32) {
            return Err(OUT_OF_RANGE.into());
        }
        let t = i64::from(seconds) * i64::from(SECOND) + i64::from(nanoseconds);
        Ok((t != 0).then_some(t))
    }

    fn can(&mut self, kind: Kind) -> Result<Can<'a>, Reason> {
        let id = self.word()?;
        let remote = kind != Kind::SocketCanFd && self.flag()?;
        let (extended, error) = (self.flag()?, self.flag()?);
        let fd = kind == Kind::SocketCan && self.flag()?;
        let [stated] = *self.bytes::<1>()?;
        let length = usize::from(stated);
        let data: &[u8] = match kind {
            Kind::CanMsgs => {
                within(length, MAX_CLASSIC)?;
                self.bytes::<MAX_CLASSIC>()?
            }
            Kind::SocketCan => {
                within(length, MAX_DATA)?;
                self.bytes::<MAX_DATA>()?
            }
            Kind::SocketCanFd => {
                let count = within(self.word()? as usize, MAX_DATA)?;
                if count != length {
                    return Err(format!("says {length} bytes, has {count}").into());
                }
                self.slice(count)?
            }
        };
        Ok(Can {
            id,
            extended: Some(extended),
            remote,
            error,
            fd,
            marks: 0,
            code: if length > MAX_CLASSIC { 0 } else { stated },
            data: &data[..length],
        })
    }

    fn slice(&mut self, count: usize) -> Result<&'a [u8], Reason> {
        let slice = self.data[self.at..].get(..count).ok_or(ENDS_EARLY)?;
        self.at += count;
        Ok(slice)
    }

    fn bytes<const N: usize>(&mut self) -> Result<&'a [u8; N], Reason> {
        let bytes = self.data[self.at..].first_chunk().ok_or(ENDS_EARLY)?;
        self.at += N;
        Ok(bytes)
    }

    fn word(&mut self) -> Result<u32, Reason> {
        if ALIGNED {
            self.at = self.at.next_multiple_of(4).min(self.data.len());
        }
        let bytes = *self.bytes()?;
        Ok(if BIG {
            u32::from_be_bytes(bytes)
        } else {
            u32::from_le_bytes(bytes)
        })
    }

    fn flag(&mut self) -> Result<bool, Reason> {
        match self.bytes()? {
            [0] => Ok(false),
            [1] => Ok(true),
            [value] => Err(format!("flag with the value {value}").into()),
        }
    }

    /// Text without the NUL that ends it in CDR.
    fn string(&mut self) -> Result<&'a [u8], Reason> {
        let length = self.word()?;
        let text = self.slice(length as usize)?;
        Ok(text.strip_suffix(&[0]).unwrap_or(text))
    }
}
