//! The log of pydronecan's `filein:` driver: for each frame a mark, microseconds of a monotonic clock, the CRC of the
//! data, its length, flags, the identifier, and the data, all little-endian.
//!
//! It says neither the direction of a frame nor the bus. Behind a damaged record, the next is where a mark, a sound
//! header and the right CRC come together.
#![forbid(unsafe_code)]

use crate::binary::{Binary, Format, Order, Start, Step};
use crate::frames::{EXTENDED, FD, MAX_DATA, NO_TIME};
use crate::line::Reason;
use crate::reader::Rows;
use crate::socketcan;
use crate::stamp::Stamps;
use crate::wire;

/// Logs of pydronecan to rows.
pub type DronecanLog = Binary<DronecanLogFormat>;

const MARK: [u8; 2] = [0x34, 0x29];
const HEADER: usize = 20;
const FLAG_FD: u16 = 1;
const NAME: &[u8] = b"can0";

#[derive(Default)]
pub struct DronecanLogFormat {
    bus: Option<u8>,
}

struct Header {
    stamp: u64,
    crc: u16,
    length: usize,
    flags: u16,
    word: u32,
}

impl Header {
    /// The header in front of at least `HEADER` bytes.
    fn read(bytes: &[u8]) -> Result<Header, Reason> {
        if !bytes.starts_with(&MARK) {
            return Err("no mark of a record".into());
        }
        let order = Order::Little;
        let header = Header {
            stamp: order.u64(bytes, 2),
            crc: order.u16(bytes, 10),
            length: order.u16(bytes, 12).into(),
            flags: order.u16(bytes, 14),
            word: order.u32(bytes, 16),
        };
        if header.length > MAX_DATA {
            return Err(format!("{} bytes of data", header.length).into());
        }
        Ok(header)
    }

    fn end(&self) -> usize {
        HEADER + self.length
    }

    /// The data, if the CRC is right.
    fn data<'a>(&self, bytes: &'a [u8]) -> Option<&'a [u8]> {
        let data = &bytes[HEADER..self.end()];
        (wire::crc(0xFFFF, data) == self.crc).then_some(data)
    }

    /// Time, identifier and flags of the frame.
    fn meaning(&self) -> Result<(i64, u32, u16), Reason> {
        let ns = i64::try_from(self.stamp).ok().and_then(|us| us.checked_mul(1000));
        let t = ns.ok_or("time stamp out of range")?;
        let (id, mut flags) = socketcan::identifier(self.word)?;
        if flags & !EXTENDED != 0 {
            return Err("unknown bits above the identifier".into());
        }
        flags |= match self.flags {
            0 => 0,
            FLAG_FD => FD,
            flags => return Err(format!("unknown flags {flags:X}").into()),
        };
        Ok((t, id, flags))
    }
}

impl Format for DronecanLogFormat {
    const NAME: &'static str = "pydronecan log";

    fn record(&mut self, bytes: &[u8], at_end: bool, rows: &mut Rows) -> Step {
        if bytes.len() < HEADER {
            return Step::Need(HEADER);
        }
        let header = match Header::read(bytes) {
            Ok(header) => header,
            Err(reason) => return Step::Damaged(reason),
        };
        let end = header.end();
        if bytes.len() < end {
            return Step::Need(end);
        }
        let read = match header.data(bytes) {
            Some(data) => header.meaning().map(|meaning| (meaning, data)),
            None => Err("wrong CRC".into()),
        };
        match read {
            Ok(((t, id, flags), data)) => {
                // No other name ever asks for an index.
                self.bus = self.bus.or_else(|| rows.bus(NAME));
                rows.stamp(Stamps::ZERO);
                rows.stamp(Stamps::MICROSECONDS);
                rows.frame(t, self.bus.unwrap_or(0), id, flags, data);
                Step::Used(end)
            }
            // With a record right behind it, its length at least was sound.
            Err(_) if bytes.len() < end + MARK.len() && !at_end => Step::Need(end + MARK.len()),
            Err(reason) if MARK.starts_with(&bytes[end..bytes.len().min(end + MARK.len())]) => {
                rows.unreadable(NO_TIME, None, &reason);
                Step::Used(end)
            }
            Err(reason) => Step::Damaged(reason),
        }
    }

    fn starts(&self, bytes: &[u8], _: bool) -> Start {
        if bytes.len() < HEADER {
            return Start::Need(HEADER);
        }
        match Header::read(bytes) {
            Ok(header) if bytes.len() < header.end() => Start::Need(header.end()),
            Ok(header) if header.data(bytes).is_some() && header.meaning().is_ok() => Start::Here,
            _ => Start::Not,
        }
    }
}
