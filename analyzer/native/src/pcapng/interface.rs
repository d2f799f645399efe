//! What a section says of an interface: its link type, its name, and how its time stamps count.
#![forbid(unsafe_code)]

use super::names::Names;
use super::options::Options;
use crate::binary::Order;
use crate::frames::NO_TIME;
use crate::link::Link;
use crate::reader::Rows;
use crate::stamp::Stamps;

const SECOND: u64 = 1_000_000_000;
/// Longer names are cut.
const MAX_NAME: usize = 64;
const NAME: u16 = 2;
const DESCRIPTION: u16 = 3;
const RESOLUTION: u16 = 9;
const OFFSET: u16 = 14;

/// The description of an interface whose packets have stamps only because the format wants them: captures without times
/// are written so. Packets without stamps ("simple" ones) would not do, as all of them belong to the first interface.
pub const NO_STAMPS: &[u8] = b"tailbyte: no time stamps";

#[derive(Default)]
pub struct Interface {
    /// `None`: it carries no CAN frames, or its description is lost.
    pub link: Option<Link>,
    clock: Clock,
    /// Its stamps say nothing.
    untimed: bool,
    /// Bytes captured of a packet at most.
    pub limit: usize,
    /// Packets that the statistics so far call lost.
    pub dropped: u64,
    unknown: bool,
    index: usize,
    /// As it is stated; empty if it is not.
    name: Vec<u8>,
    /// What the rows call it.
    called: Option<Vec<u8>>,
    bus: Option<u8>,
}

impl Interface {
    /// Reads the body of an interface description.
    pub fn read(body: &[u8], order: Order, index: usize, names: &mut Names) -> Option<Interface> {
        let options = Options::new(body.get(8..)?, order);
        let limit = match order.u32(body, 4) {
            0 => usize::MAX,
            limit => limit as usize,
        };
        let mut interface = Interface {
            link: Link::of(order.u16(body, 0)),
            limit,
            index,
            ..Interface::default()
        };
        for (code, value) in options {
            match (code, value) {
                (NAME, [_, ..]) => interface.name = trimmed(value).to_vec(),
                (DESCRIPTION, _) => interface.untimed = trimmed(value) == NO_STAMPS,
                (RESOLUTION, [exponent, ..]) => interface.clock.unit = Unit::of(*exponent),
                (OFFSET, [_, _, _, _, _, _, _, _]) => interface.clock.offset = order.u64(value, 0) as i64,
                _ => {}
            }
        }
        if !interface.name.is_empty() {
            names.state(&interface.name);
        }
        Some(interface)
    }

    /// Stands for an interface whose description cannot be read.
    pub fn unknown() -> Interface {
        Interface {
            unknown: true,
            ..Interface::default()
        }
    }

    pub fn is_unknown(&self) -> bool {
        self.unknown
    }

    /// The time of a stamp, [`NO_TIME`] if stamps say nothing here; `None` if it is out of range.
    pub fn time(&self, stamp: u64) -> Option<i64> {
        if self.untimed {
            Some(NO_TIME)
        } else {
            self.clock.time(stamp)
        }
    }

    /// How finely stamps resolve time.
    pub fn resolution(&self) -> Stamps {
        self.clock.resolution()
    }

    /// The index in the rows; `None` when there are too many.
    pub fn bus(&mut self, names: &mut Names, rows: &mut Rows) -> Option<u8> {
        if self.bus.is_none() {
            let called = self.called.get_or_insert_with(|| names.choose(&self.name, self.index));
            self.bus = rows.bus(called);
        }
        self.bus
    }
}

/// Some writers end a name with a zero byte.
fn trimmed(name: &[u8]) -> &[u8] {
    let end = name.iter().position(|byte| *byte == 0).unwrap_or(name.len());
    &name[..end.min(MAX_NAME)]
}

/// How the time stamps of an interface count.
#[derive(Clone, Copy, Default)]
struct Clock {
    unit: Unit,
    /// Seconds that stamps count from.
    offset: i64,
}

#[derive(Clone, Copy)]
enum Unit {
    /// So many nanoseconds.
    Of(u64),
    /// So many of them are a nanosecond; 0 stands for more than 64 bits can count.
    Part(u64),
    /// 2 to this power of them are a second.
    Binary(u32),
}

impl Default for Unit {
    fn default() -> Self {
        Unit::Of(1000)
    }
}

impl Unit {
    /// The highest bit says whether 2 or 10 is raised to the power.
    fn of(exponent: u8) -> Unit {
        let power = u32::from(exponent & 0x7F);
        if exponent & 0x80 != 0 {
            Unit::Binary(power)
        } else if power <= 9 {
            Unit::Of(10_u64.pow(9 - power))
        } else {
            Unit::Part(10_u64.checked_pow(power - 9).unwrap_or(0))
        }
    }
}

impl Clock {
    /// Nanoseconds, those of finer stamps cut; `None` if they do not fit 64 bits.
    fn time(self, stamp: u64) -> Option<i64> {
        let ns = match self.unit {
            Unit::Of(factor) => u128::from(stamp) * u128::from(factor),
            Unit::Part(divisor) => u128::from(stamp.checked_div(divisor).unwrap_or(0)),
            Unit::Binary(power) => (u128::from(stamp) * u128::from(SECOND)) >> power,
        };
        let ns = i128::try_from(ns).ok()? + i128::from(self.offset) * i128::from(SECOND);
        i64::try_from(ns).ok().filter(|ns| *ns != NO_TIME)
    }

    fn resolution(self) -> Stamps {
        match self.unit {
            Unit::Of(1000..) | Unit::Binary(..20) => Stamps::MICROSECONDS,
            _ => Stamps::NANOSECONDS,
        }
    }
}
