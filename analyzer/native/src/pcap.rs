//! Classic pcap of CAN interfaces, as tcpdump writes it.
//!
//! A file header of 24 bytes (not a record), then records of a header of 16 bytes (seconds, fraction, captured length,
//! original length) and the packet. The format has no mark between records: behind a damaged one, the next is where
//! the header and a CAN frame make sense together and a header or the end follows.
#![forbid(unsafe_code)]

use crate::binary::{Binary, Format, Order, Start, Step};
use crate::line::Reason;
use crate::link::{self, Content, Link, Numbered, LONGEST_PACKET};
use crate::reader::Rows;
use crate::stamp::Stamps;

/// pcap data to rows.
pub type Pcap = Binary<PcapFormat>;

const FILE_HEADER: usize = 24;
const HEADER: usize = 16;
const SECOND: i64 = 1_000_000_000;
const MICROSECONDS: u32 = 0xA1B2_C3D4;
const NANOSECONDS: u32 = 0xA1B2_3C4D;
/// The most that capturing programs take of one packet.
const MAX_CAPTURED: usize = 262_144;
/// The header of a CAN frame.
const SHORTEST_PACKET: usize = 8;
/// The format names no interface.
const NAME: &[u8] = b"can0";

#[derive(Default)]
pub struct PcapFormat {
    /// Known behind the file header.
    file: Option<File>,
    bus: Option<u8>,
    numbered: Numbered,
}

#[derive(Clone, Copy)]
struct File {
    order: Order,
    link: Link,
    /// Nanoseconds of a unit of the fraction.
    unit: i64,
}

struct Header {
    t: i64,
    /// The fraction is less than a second.
    proper: bool,
    captured: usize,
    original: usize,
}

impl File {
    fn header(self, bytes: &[u8]) -> Option<Header> {
        let head: &[u8; HEADER] = bytes.first_chunk()?;
        let word = |at| self.order.u32(head, at);
        let fraction = i64::from(word(4)) * self.unit;
        Some(Header {
            t: i64::from(word(0)) * SECOND + fraction,
            proper: fraction < SECOND,
            captured: word(8) as usize,
            original: word(12) as usize,
        })
    }

    fn resolution(self) -> Stamps {
        if self.unit == 1 {
            Stamps::NANOSECONDS
        } else {
            Stamps::MICROSECONDS
        }
    }

    /// Whether a header or the end may be here.
    fn goes_on(self, bytes: &[u8]) -> bool {
        self.header(bytes).is_none_or(|header| header.is_plausible())
    }
}

impl Header {
    fn is_plausible(&self) -> bool {
        self.proper && (SHORTEST_PACKET..=self.original.min(MAX_CAPTURED)).contains(&self.captured)
    }
}

impl Format for PcapFormat {
    const NAME: &'static str = "pcap data";

    fn record(&mut self, bytes: &[u8], at_end: bool, rows: &mut Rows) -> Step {
        let Some(file) = self.file else {
            return self.file_header(bytes);
        };
        let Some(header) = file.header(bytes) else {
            return Step::Need(HEADER);
        };
        if header.captured > MAX_CAPTURED {
            return Step::Damaged(format!("packet of {} bytes", header.captured).into());
        }
        let end = HEADER + header.captured;
        let Some(packet) = bytes.get(HEADER..end) else {
            return Step::Need(end);
        };
        let problem: Option<Reason> = match file.link.read(packet, header.original, file.order) {
            Ok(Content::Other) => None,
            Ok(Content::Frame(frame, number)) => match self.bus(number, rows) {
                Some(bus) => {
                    rows.stamp(Stamps::ABSOLUTE);
                    rows.stamp(file.resolution());
                    frame.push(header.t, bus, rows);
                    return Step::Used(end);
                }
                None => Some(Rows::too_many_buses().into()),
            },
            Err(reason) => Some(link::reason(reason, header.captured, header.original)),
        };
        // A length that is wrong would take sound records along.
        let plausible = header.is_plausible();
        if plausible && bytes.len() < end + HEADER && !at_end {
            return Step::Need(end + HEADER);
        }
        let sound = plausible && file.goes_on(&bytes[end..]);
        match problem {
            None if sound => rows.other(1),
            Some(reason) if sound => rows.unreadable(header.t, None, &reason),
            None => return Step::Damaged("packet without a record behind it".into()),
            Some(reason) => return Step::Damaged(reason),
        }
        Step::Used(end)
    }

    fn starts(&self, bytes: &[u8], at_end: bool) -> Start {
        let Some(file) = self.file else { return Start::Not };
        let Some(header) = file.header(bytes) else {
            return Start::Need(HEADER);
        };
        if !header.is_plausible() || header.captured != header.original || header.captured > LONGEST_PACKET {
            return Start::Not;
        }
        let end = HEADER + header.captured;
        if bytes.len() < end + HEADER && (!at_end || bytes.len() < end) {
            return Start::Need(end + HEADER);
        }
        let content = file.link.read(&bytes[HEADER..end], header.original, file.order);
        if matches!(content, Ok(Content::Frame(..))) && file.goes_on(&bytes[end..]) {
            Start::Here
        } else {
            Start::Not
        }
    }
}

impl PcapFormat {
    fn file_header(&mut self, bytes: &[u8]) -> Step {
        if bytes.len() < FILE_HEADER {
            return Step::Need(FILE_HEADER);
        }
        let found = [Order::Little, Order::Big]
            .into_iter()
            .find_map(|order| match order.u32(bytes, 0) {
                MICROSECONDS => Some((order, 1000)),
                NANOSECONDS => Some((order, 1)),
                _ => None,
            });
        let Some((order, unit)) = found else {
            return Step::Stop("not pcap data".into());
        };
        // The upper half says how long the frame check sequences are.
        let number = order.u32(bytes, 20) as u16;
        let Some(link) = Link::of(number) else {
            return Step::Stop(link::without_can(number).into());
        };
        self.file = Some(File { order, link, unit });
        Step::Used(FILE_HEADER)
    }

    fn bus(&mut self, number: Option<u32>, rows: &mut Rows) -> Option<u8> {
        if let Some(number) = number {
            return self.numbered.bus(number, rows);
        }
        self.bus = self.bus.or_else(|| rows.bus(NAME));
        self.bus
    }
}
