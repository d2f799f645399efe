//! What stands before a CAN frame in a packet capture: nothing, or the header of a "cooked" capture of any interface.
#![forbid(unsafe_code)]

use crate::binary::Order;
use crate::frames::TX;
use crate::line::Reason;
use crate::reader::Rows;
use crate::socketcan::{Frame, LONGEST};

/// The longest packet that can hold one CAN frame.
pub const LONGEST_PACKET: usize = LONGEST + COOKED2;

const COOKED: usize = 16;
const COOKED2: usize = 20;
const PROTOCOL_CAN: u16 = 0x000C;
const PROTOCOL_FD: u16 = 0x000D;
const OUTGOING: u8 = 4;

/// The link types that can carry CAN.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Link {
    /// `LINKTYPE_CAN_SOCKETCAN`
    Can,
    /// `LINKTYPE_LINUX_SLL`
    Cooked,
    /// `LINKTYPE_LINUX_SLL2`
    Cooked2,
}

/// What a packet holds.
pub enum Content<'a> {
    /// A frame, and the number of its interface if the packet has one.
    Frame(Frame<'a>, Option<u32>),
    /// Another protocol.
    Other,
}

impl Link {
    /// The link type of a file or an interface.
    pub fn of(number: u16) -> Option<Link> {
        match number {
            113 => Some(Link::Cooked),
            227 => Some(Link::Can),
            276 => Some(Link::Cooked2),
            _ => None,
        }
    }

    /// Reads a packet that had `original` bytes before it was captured. The identifier of a bare frame is in network
    /// order; behind a cooked header the kernel's own word stands, in the order of the capturing machine, which is
    /// that of the file. libpcap and Wireshark swap it the same way.
    ///
    /// # Errors
    /// What is wrong with it.
    pub fn read(self, packet: &[u8], original: usize, order: Order) -> Result<Content<'_>, Reason> {
        let (header, number) = match self {
            Link::Can => return Ok(Content::Frame(Frame::read(packet, original, Order::Big, false)?, None)),
            Link::Cooked => (COOKED, None),
            Link::Cooked2 => (COOKED2, Some(Order::Big.u32(packet, 4))),
        };
        let Some((head, frame)) = packet.split_at_checked(header) else {
            return Err(format!("packet of {} bytes, shorter than its header", packet.len()).into());
        };
        let (protocol, kind) = if self == Link::Cooked {
            (Order::Big.u16(head, 14), head[1])
        } else {
            (Order::Big.u16(head, 0), head[10])
        };
        if protocol != PROTOCOL_CAN && protocol != PROTOCOL_FD {
            return Ok(Content::Other);
        }
        let mut frame = Frame::read(frame, original.saturating_sub(header), order, protocol == PROTOCOL_FD)?;
        if kind == OUTGOING {
            frame.flags |= TX;
        }
        Ok(Content::Frame(frame, number))
    }
}

/// Interfaces that a capture numbers and does not name: `if3` for number 3.
#[derive(Default)]
pub struct Numbered(Vec<(u32, u8)>);

impl Numbered {
    /// The index of the interface in the rows; `None` when there are too many.
    pub fn bus(&mut self, number: u32, rows: &mut Rows) -> Option<u8> {
        if let Some((_, bus)) = self.0.iter().find(|(known, _)| *known == number) {
            return Some(*bus);
        }
        let bus = rows.bus(format!("if{number}").as_bytes())?;
        self.0.push((number, bus));
        Some(bus)
    }
}

/// The reason why there are no frames to read.
pub fn without_can(number: u16) -> String {
    format!("link type {number} carries no CAN frames")
}

/// The reason why a packet cannot be read, or that it was captured in part, if so.
pub fn reason(reason: Reason, captured: usize, original: usize) -> Reason {
    if captured < original {
        return format!("{captured} of {original} bytes captured").into();
    }
    reason
}
