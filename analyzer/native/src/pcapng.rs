//! pcapng as dumpcap, tcpdump and Wireshark write it: sections of either byte order, several interfaces in each.
//!
//! Every block is one record. Blocks without CAN frames count as `other`; of comments those are kept that our own writer
//! writes ([`journal`]). Of a damaged
//! block the two lengths around it disagree; behind it, the next is where the type is known and the lengths agree.
#![forbid(unsafe_code)]

mod interface;
pub(crate) mod journal;
mod names;
mod options;

use crate::binary::{Binary, Format, Order, Start, Step};
use crate::frames::{NO_TIME, RX, TX};
use crate::line::Reason;
use crate::link::{self, Content, Numbered};
use crate::reader::Rows;
use crate::stamp::Stamps;

use interface::Interface;
pub(crate) use interface::NO_STAMPS;
use names::Names;
use options::Options;

/// pcapng data to rows.
pub type Pcapng = Binary<PcapngFormat>;

const SECTION: u32 = 0x0A0D_0D0A;
const BYTE_ORDER: u32 = 0x1A2B_3C4D;
const INTERFACE: u32 = 1;
const PACKET: u32 = 2;
const SIMPLE_PACKET: u32 = 3;
const STATISTICS: u32 = 5;
const ENHANCED_PACKET: u32 = 6;
const JOURNAL: u32 = 9;
/// Types by which a block is recognised behind damage: those above, name resolution, decryption secrets, and custom
/// blocks.
const KNOWN: [u32; 11] = [
    SECTION,
    INTERFACE,
    PACKET,
    SIMPLE_PACKET,
    STATISTICS,
    ENHANCED_PACKET,
    JOURNAL,
    4,
    0xA,
    0xBAD,
    0x4000_0BAD,
];
/// Bytes of a block without a body: type, and its length before and behind.
const FRAME: usize = 12;
/// A longer block is passed over like a damaged one.
const MAX_BLOCK: usize = 1 << 24;
/// A longer block is not looked for behind damage.
const MAX_FOUND: usize = 1 << 16;
/// Interfaces of a section; each takes memory.
const MAX_INTERFACES: usize = 1 << 16;
/// Options of the blocks with packets, and of the statistics.
const PACKET_FLAGS: u16 = 2;
const DROPPED_BY_INTERFACE: u16 = 5;
const DROPPED_BY_SYSTEM: u16 = 7;

#[derive(Default)]
pub struct PcapngFormat {
    order: Order,
    /// The first section has begun.
    begun: bool,
    interfaces: Vec<Interface>,
    /// Of those interfaces.
    names: Names,
    numbered: Numbered,
    links: Links,
}

/// The link types of all interfaces so far.
#[derive(Default)]
struct Links {
    /// There may be frames: an interface carries CAN, or something cannot be read.
    can: bool,
    /// The first one that does not carry CAN.
    other: Option<u16>,
    /// That is not the only one.
    several: bool,
}

/// A packet as its block has it.
struct Packet<'a> {
    interface: usize,
    /// In units of the interface.
    stamp: Option<u64>,
    bytes: &'a [u8],
    original: usize,
    options: &'a [u8],
}

impl Format for PcapngFormat {
    const NAME: &'static str = "pcapng data";

    fn record(&mut self, bytes: &[u8], _: bool, rows: &mut Rows) -> Step {
        let Some((kind, order)) = self.head(bytes) else {
            return Step::Need(FRAME);
        };
        if !self.begun && (kind != SECTION || order.is_none()) {
            return Step::Stop("not pcapng data".into());
        }
        let Some(order) = order else {
            return self.damaged(kind, "section of unknown byte order".into());
        };
        let length = order.u32(bytes, 4) as usize;
        if length < FRAME || !length.is_multiple_of(4) || length > MAX_BLOCK {
            return self.damaged(kind, format!("block of {length} bytes").into());
        }
        if bytes.len() < length {
            return Step::Need(length);
        }
        let behind = order.u32(bytes, length - 4) as usize;
        if behind != length {
            return self.damaged(
                kind,
                format!("block of {length} bytes that ends as one of {behind}").into(),
            );
        }
        if kind == SECTION {
            (self.order, self.begun) = (order, true);
            self.next_section();
        }
        if let Err((t, reason)) = self.block(kind, &bytes[8..length - 4], rows) {
            self.links.can = true;
            rows.unreadable(t, None, &reason);
        }
        Step::Used(length)
    }

    fn starts(&self, bytes: &[u8], _: bool) -> Start {
        let Some((kind, order)) = self.head(bytes) else {
            return Start::Need(FRAME);
        };
        let Some(order) = order.filter(|_| self.begun && KNOWN.contains(&kind)) else {
            return Start::Not;
        };
        let length = order.u32(bytes, 4) as usize;
        if length < FRAME || !length.is_multiple_of(4) || length > MAX_FOUND {
            Start::Not
        } else if bytes.len() < length {
            Start::Need(length)
        } else if order.u32(bytes, length - 4) as usize == length {
            Start::Here
        } else {
            Start::Not
        }
    }

    fn lacks(&self) -> Option<String> {
        self.links.lack()
    }
}

impl Links {
    fn add(&mut self, number: u16, interface: &Interface) {
        if interface.link.is_some() {
            self.can = true;
        } else {
            self.several |= *self.other.get_or_insert(number) != number;
        }
    }

    /// Why there can be no frame, if so.
    fn lack(&self) -> Option<String> {
        match self.other {
            Some(_) if self.can => None,
            Some(_) if self.several => Some("no interface carries CAN frames".into()),
            number => number.map(link::without_can),
        }
    }
}

impl PcapngFormat {
    /// The type of a block and its byte order, which a section states and may state wrong.
    fn head(&self, bytes: &[u8]) -> Option<(u32, Option<Order>)> {
        let head: &[u8; FRAME] = bytes.first_chunk()?;
        let kind = self.order.u32(head, 0);
        if kind != SECTION {
            return Some((kind, Some(self.order)));
        }
        let order = [Order::Little, Order::Big]
            .into_iter()
            .find(|order| order.u32(head, 8) == BYTE_ORDER);
        Some((kind, order))
    }

    /// A block whose end is unknown. Interfaces are numbered by their blocks: those behind it keep their numbers.
    fn damaged(&mut self, kind: u32, reason: Reason) -> Step {
        match kind {
            SECTION => self.next_section(),
            INTERFACE if self.interfaces.len() < MAX_INTERFACES => self.interfaces.push(Interface::unknown()),
            _ => {}
        }
        self.links.can = true;
        Step::Damaged(reason)
    }

    fn next_section(&mut self) {
        self.interfaces.clear();
        self.names = Names::default();
    }

    fn block(&mut self, kind: u32, body: &[u8], rows: &mut Rows) -> Result<(), (i64, Reason)> {
        let order = self.order;
        let short = |name| (NO_TIME, Reason::from(format!("{name} of {} bytes", FRAME + body.len())));
        let packet = match kind {
            INTERFACE => {
                let index = self.interfaces.len();
                if index == MAX_INTERFACES {
                    return Err((NO_TIME, format!("more than {MAX_INTERFACES} interfaces").into()));
                }
                let interface = Interface::read(body, order, index, &mut self.names);
                if let Some(interface) = &interface {
                    self.links.add(order.u16(body, 0), interface);
                }
                let read = interface.is_some().then(|| rows.other(1));
                self.interfaces.push(interface.unwrap_or_else(Interface::unknown));
                return read.ok_or_else(|| short("interface description"));
            }
            STATISTICS => return self.statistics(body, rows),
            ENHANCED_PACKET => Packet::enhanced(body, order.u32(body, 0), order),
            PACKET => Packet::enhanced(body, order.u16(body, 0).into(), order),
            SIMPLE_PACKET => Packet::simple(body, self.interfaces.first(), order),
            kind => {
                match journal::read(body).filter(|_| kind == JOURNAL) {
                    Some((t, text)) => rows.comment(t, &text),
                    None => rows.other(1),
                }
                return Ok(());
            }
        };
        self.packet(&packet.ok_or_else(|| short("packet block"))?, rows)
    }

    fn packet(&mut self, packet: &Packet<'_>, rows: &mut Rows) -> Result<(), (i64, Reason)> {
        let interface = self.interfaces.get_mut(packet.interface);
        let interface = interface.ok_or_else(|| undescribed(packet.interface))?;
        if interface.is_unknown() {
            return Err(undescribed(packet.interface));
        }
        let Some(link) = interface.link else {
            rows.other(1);
            return Ok(());
        };
        let t = match packet.stamp {
            None => NO_TIME,
            Some(stamp) => {
                let far = (NO_TIME, Reason::from("time stamp out of range"));
                interface.time(stamp).ok_or(far)?
            }
        };
        let captured = packet.bytes.len();
        let content = link.read(packet.bytes, packet.original, self.order);
        let content = content.map_err(|reason| (t, link::reason(reason, captured, packet.original)))?;
        let Content::Frame(mut frame, number) = content else {
            rows.other(1);
            return Ok(());
        };
        let bus = match number {
            Some(number) => self.numbered.bus(number, rows),
            None => interface.bus(&mut self.names, rows),
        };
        let bus = bus.ok_or_else(|| (t, Rows::too_many_buses().into()))?;
        let flags = Options::new(packet.options, self.order).find(|(code, _)| *code == PACKET_FLAGS);
        frame.flags |= match flags.map(|(_, value)| self.order.u32(value, 0) & 3) {
            Some(1) => RX,
            Some(2) => TX,
            _ => 0,
        };
        if t != NO_TIME {
            rows.stamp(Stamps::ABSOLUTE);
            rows.stamp(interface.resolution());
        }
        if let Some(text) = Options::new(packet.options, self.order).comments() {
            rows.frame_comment(t, bus, &text);
        }
        frame.push(t, bus, rows);
        Ok(())
    }

    /// Counts of lost packets since the capture began; what came on top of the last ones is new.
    fn statistics(&mut self, body: &[u8], rows: &mut Rows) -> Result<(), (i64, Reason)> {
        let order = self.order;
        let number = order.u32(body, 0) as usize;
        let interface = self.interfaces.get_mut(number).ok_or_else(|| undescribed(number))?;
        let options = || Options::new(body.get(12..).unwrap_or_default(), order);
        let count = |wanted| {
            let found = options().find(|(code, value)| *code == wanted && value.len() >= 8);
            found.map_or(0, |(_, value)| order.u64(value, 0))
        };
        let (by_interface, by_system) = (count(DROPPED_BY_INTERFACE), count(DROPPED_BY_SYSTEM));
        let all = by_interface.saturating_add(by_system);
        let new = all.saturating_sub(interface.dropped);
        if interface.link.is_none() || new == 0 {
            rows.other(1);
            return Ok(());
        }
        interface.dropped = all;
        let t = interface.time(stamp(body, order)).unwrap_or(NO_TIME);
        let bus = interface.bus(&mut self.names, rows);
        let text = format!("{by_interface} frames dropped by the interface, {by_system} by the system so far");
        rows.drops(t, bus, u32::try_from(new).unwrap_or(u32::MAX), &text);
        Ok(())
    }
}

impl<'a> Packet<'a> {
    fn enhanced(body: &'a [u8], interface: u32, order: Order) -> Option<Packet<'a>> {
        let captured = order.u32(body, 12) as usize;
        let rest = body.get(20..)?;
        let bytes = rest.get(..captured)?;
        Some(Packet {
            interface: interface as usize,
            stamp: Some(stamp(body, order)),
            bytes,
            original: order.u32(body, 16) as usize,
            options: rest.get(captured.next_multiple_of(4)..).unwrap_or_default(),
        })
    }

    /// The format has neither a time nor a captured length for this packet, and it belongs to the first interface.
    fn simple(body: &'a [u8], interface: Option<&Interface>, order: Order) -> Option<Packet<'a>> {
        let rest = body.get(4..)?;
        let original = order.u32(body, 0) as usize;
        let limit = interface.map_or(usize::MAX, |interface| interface.limit);
        Some(Packet {
            interface: 0,
            stamp: None,
            bytes: rest.get(..original.min(limit))?,
            original,
            options: &[],
        })
    }
}

/// The time of a block, whose halves stand at the same place in all blocks that have one.
fn stamp(body: &[u8], order: Order) -> u64 {
    u64::from(order.u32(body, 4)) << 32 | u64::from(order.u32(body, 8))
}

fn undescribed(interface: usize) -> (i64, Reason) {
    (NO_TIME, format!("interface {interface} is not described").into())
}
