//! What is known of a channel: its layout, and the interface names that its messages use.
#![forbid(unsafe_code)]

use std::collections::HashSet;

use super::can::Can;
use super::texts::Text;
use super::{Layout, Role};
use crate::frames::{BRS, DLC_SHIFT, ESI, FD, MAX_CLASSIC, RX, TX};
use crate::line::Reason;
use crate::reader::Rows;

/// What ROS drivers write as the name of every interface.
const ANY: &[u8] = b"can";
/// The bits of a length code.
const CODE: u16 = 15 << DLC_SHIFT;
/// Identifiers remembered as those of CAN FD frames.
const MAX_IDS: usize = 1 << 16;

pub(super) struct Channel {
    pub layout: Layout,
    pub names: Names,
    /// How identifiers and data in text are coded.
    pub id: Text,
    pub data: Text,
    /// What all frames have beside what they state: a direction, that they are CAN FD, its flags, a raw length code.
    pub flags: u16,
    /// Whether its messages, or the recorder, state times.
    pub timed: bool,
    /// Identifiers that have had more data than a classic frame holds.
    long: HashSet<u32>,
    /// Messages so far.
    pub messages: u64,
}

impl Channel {
    pub fn new(bus: &str, layout: Layout, messages: u64) -> Self {
        let announced = bus.as_bytes().to_vec();
        let names = Names { announced, last: None };
        Channel {
            id: Text::new(layout.has(Role::IdText)),
            data: Text::new(layout.has(Role::DataText)),
            layout,
            names,
            flags: 0,
            timed: true,
            long: HashSet::new(),
            messages,
        }
    }

    /// The flags of a frame with those of the channel, which hold unless it states a direction.
    pub fn flagged(&self, flags: u16) -> u16 {
        let unless = |stated: u16| if flags & stated == 0 { self.flags & stated } else { 0 };
        let code = self.flags & CODE;
        (if code == 0 { flags } else { flags & !CODE | code }) | unless(TX | RX) | self.flags & (BRS | ESI)
    }

    /// Whether a frame of an interface in CAN FD mode is one, where the message does not say: if it is long, or if its
    /// identifier has been that of a long one, as a transfer may end in a short frame.
    pub fn is_fd(&mut self, can: &Can<'_>) -> bool {
        let long = can.data.len() > MAX_CLASSIC;
        if long && self.long.len() < MAX_IDS {
            self.long.insert(can.id);
        }
        long || self.flags & FD != 0 || (!self.long.is_empty() && self.long.contains(&can.id))
    }
}

/// Messages of a channel mostly name the same interface: the look-up is saved for those that change it.
pub(super) struct Names {
    announced: Vec<u8>,
    last: Option<(Vec<u8>, u8)>,
}

impl Names {
    /// The index of an interface; that of the announced one when `name` is empty, or as good as that.
    pub fn bus(&mut self, name: &[u8], rows: &mut Rows) -> Result<u8, Reason> {
        let name = if name.is_empty() || name == ANY {
            &self.announced
        } else {
            name
        };
        if let Some((_, bus)) = self.last.as_ref().filter(|(last, _)| last == name) {
            return Ok(*bus);
        }
        let bus = rows.bus(name).ok_or_else(Rows::too_many_buses)?;
        let mut kept = self.last.take().map_or_else(Vec::new, |(kept, _)| kept);
        kept.clear();
        kept.extend_from_slice(name);
        self.last = Some((kept, bus));
        Ok(bus)
    }
}
