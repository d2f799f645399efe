//! MCAP messages that carry CAN frames to rows, one record after the other, without I/O.
//!
//! Chunks, schemas, channels and checksums are the business of the caller: it announces what the messages of a channel
//! look like ([`Layout`]) and hands over stretches of records. Every message of a stretch is one frame or event, or `other`.
#![forbid(unsafe_code)]

mod bytes;
mod can;
mod channel;
mod decimal;
mod found;
mod held;
mod json;
mod layout;
mod protobuf;
mod remarks;
mod role;
mod ros;
mod texts;
mod tree;
mod value;

pub use layout::{Kind, Layout, Wire};
pub use protobuf::Form;
pub use role::Role;

use crate::frame_batch::FrameBatch;
use crate::frames::NO_TIME;
use crate::line::Reason;
use crate::reader::Rows;
use crate::stamp::Stamps;
use can::Row;
use channel::Channel;
use found::Found;
use held::Held;
use layout::Read;

const MESSAGE: u8 = 5;
/// Opcode and length in front of each record.
const PREFIX: usize = 9;
/// Channel, sequence, log time and publish time in front of the data of a message.
const HEADER: usize = 22;
/// No message is longer.
const MAX_RECORD: u64 = 1 << 32;
/// Rows that may wait at most; their columns stay within 32-bit offsets.
pub const MAX_WAITING: usize = 1 << 22;
const OUT_OF_RANGE: &str = "time stamp out of range";

/// Why a walk stopped.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub enum Stop {
    /// Everything is walked.
    End = 0,
    /// A record that is not a message.
    Opcode = 1,
    /// A record that is not there as a whole.
    Incomplete = 2,
    /// A message whose stated length is below its header or absurd.
    Broken = 3,
    /// As many rows wait as the caller wants.
    Full = 4,
    /// A message of a channel that is neither announced nor ignored, if the walk [`asks`](Walk::asks).
    Unknown = 5,
}

/// A message of the layout it was announced with, before the rules of CAN are applied.
struct Message<'a> {
    /// Nanoseconds; `None` when the message states none.
    stamp: Option<i64>,
    /// The interface; empty when the message names none.
    name: &'a [u8],
    can: can::Can<'a>,
}

/// Message records to rows.
#[derive(Default)]
pub struct Walk {
    /// By channel ID.
    channels: Vec<Option<Box<Channel>>>,
    ignored: Vec<bool>,
    /// Whether a message of an unknown channel stops the walk; else it is `other`.
    pub asks: bool,
    /// Where the last message began that the last walk took.
    pub last: usize,
    /// The one message of a channel that is neither announced nor ignored which is `other`.
    passed: Option<u16>,
    /// The fields of the message at hand.
    found: Found,
    held: Held,
    /// Channels and fields (`data`, `id`) whose text was read as hex, and as decimal, though no message showed it.
    pub assumed: Vec<(u16, &'static str)>,
    pub rows: Rows,
    /// Frames and error frames with the recorder's time, for want of their own.
    pub log_times: u64,
    /// Frames and error frames with the time that their message states.
    pub header_times: u64,
    /// Frames and error frames of channels without times.
    pub absent_times: u64,
}

/// Who says when a frame was on the bus.
#[derive(Clone, Copy)]
enum Clock {
    Message,
    Recorder,
    Nobody,
}

impl Walk {
    /// Says what the messages of a channel look like; `bus` names the interface of those that name none.
    pub fn channel(&mut self, id: u16, bus: &str, layout: Layout) {
        let at = usize::from(id);
        self.forget(at);
        if self.channels.len() <= at {
            self.channels.resize_with(at + 1, || None);
        }
        let messages = self.channels[at].as_ref().map_or(0, |channel| channel.messages);
        self.channels[at] = Some(Box::new(Channel::new(bus, layout, messages)));
    }

    /// Marks all frames of an announced channel with what they do not state: flag bits of [`crate::frames`].
    pub fn mark(&mut self, id: u16, flags: u16) {
        if let Some(Some(channel)) = self.channels.get_mut(usize::from(id)) {
            channel.flags = flags;
        }
    }

    /// Says that nothing in the messages of an announced channel is a time: neither their stamps nor the log time.
    pub fn untimed(&mut self, id: u16) {
        if let Some(Some(channel)) = self.channels.get_mut(usize::from(id)) {
            channel.timed = false;
        }
    }

    /// The messages of this channel are `other`.
    pub fn ignore(&mut self, id: u16) {
        let at = usize::from(id);
        if self.ignored.len() <= at {
            self.ignored.resize(at + 1, false);
        }
        self.ignored[at] = true;
        self.forget(at);
        if let Some(channel) = self.channels.get_mut(at) {
            *channel = None;
        }
    }

    /// A channel means something else from here on: messages of it may wait.
    fn forget(&mut self, at: usize) {
        if self.channels.get(at).is_some_and(Option::is_some) {
            self.finish();
        }
    }

    /// The next message of this channel, which is neither announced nor ignored, is `other`.
    pub fn pass(&mut self, id: u16) {
        self.passed = Some(id);
    }

    /// Takes the message records from `start` on, until `limit` rows wait (at most [`MAX_WAITING`]). Returns where it
    /// stopped, always in front of a record, and why.
    pub fn walk(&mut self, data: &[u8], start: usize, limit: usize) -> (usize, Stop) {
        let limit = limit.min(MAX_WAITING);
        let mut at = start.min(data.len());
        loop {
            let rest = &data[at..];
            match rest.first() {
                None => return (at, Stop::End),
                Some(&MESSAGE) => {}
                Some(_) => return (at, Stop::Opcode),
            }
            let Some(length) = rest.get(1..PREFIX).and_then(|bytes| bytes.try_into().ok()) else {
                return (at, Stop::Incomplete);
            };
            let length = u64::from_le_bytes(length);
            if !(HEADER as u64..=MAX_RECORD).contains(&length) {
                return (at, Stop::Broken);
            }
            let Some(record) = rest[PREFIX..].get(..length as usize) else {
                return (at, Stop::Incomplete);
            };
            if self.rows.waiting() >= limit {
                return (at, Stop::Full);
            }
            if !self.message(record) {
                return (at, Stop::Unknown);
            }
            self.last = at;
            at += PREFIX + record.len();
        }
    }

    pub fn take(&mut self) -> FrameBatch {
        self.rows.take()
    }

    /// False if it is not taken.
    fn message(&mut self, record: &[u8]) -> bool {
        let id = channel_of(record);
        let Some(Some(channel)) = self.channels.get(usize::from(id)) else {
            let ignored = || self.ignored.get(usize::from(id)) == Some(&true);
            let taken = !self.asks || self.passed.take_if(|passed| *passed == id).is_some() || ignored();
            if taken {
                self.other(1);
            }
            return taken;
        };
        if channel.is_open() || !self.held.is_empty() {
            self.wait(id, record);
        } else {
            self.add(record);
        }
        true
    }

    /// Adds the row of a message of an announced channel.
    fn add(&mut self, record: &[u8]) {
        let (header, data) = record.split_at(HEADER);
        let id = channel_of(record);
        let Some(Some(channel)) = self.channels.get_mut(usize::from(id)) else {
            return;
        };
        channel.messages += 1;
        let mut log_time = [0; 8];
        log_time.copy_from_slice(&header[6..14]);
        match channel.add(data, u64::from_le_bytes(log_time), &mut self.found, &mut self.rows) {
            Ok(Some(Clock::Message)) => self.header_times += 1,
            Ok(Some(Clock::Recorder)) => self.log_times += 1,
            Ok(Some(Clock::Nobody)) => self.absent_times += 1,
            Ok(None) => {}
            Err(reason) => {
                let text = format!("message {} of channel {id}: {reason}", channel.messages);
                self.rows.unreadable(NO_TIME, None, &text);
            }
        }
    }
}

fn channel_of(record: &[u8]) -> u16 {
    u16::from_le_bytes([record[0], record[1]])
}

impl Channel {
    /// Adds the row of a message.
    fn add(&mut self, data: &[u8], log_time: u64, found: &mut Found, rows: &mut Rows) -> Result<Option<Clock>, Reason> {
        let mut message = match &self.layout.0 {
            Read::Comments | Read::Drops => return self.remark(data, log_time, rows).map(|()| None),
            Read::Ros(wire, kind) => ros::read(*wire, *kind, data)?,
            Read::Json(fields) => {
                found.clear();
                json::read(fields, data, found)?;
                found.decode(self.id.coding, self.data.coding)?;
                found.message()?
            }
            Read::Protobuf(fields, defaults) => {
                found.clear();
                protobuf::read(fields, defaults, data, found)?;
                found.decode(self.id.coding, self.data.coding)?;
                found.message()?
            }
        };
        if matches!(self.layout.0, Read::Ros(_, Kind::SocketCanFd)) {
            message.can.fd = self.is_fd(&message.can);
        }
        let row = message.can.row()?;
        let (t, clock) = self.time(message.stamp, log_time)?;
        let bus = self.names.bus(message.name, rows)?;
        if self.timed {
            rows.stamp(Stamps::ABSOLUTE);
            rows.stamp(Stamps::NANOSECONDS);
        }
        match row {
            Row::Frame { id, flags, data } => rows.frame(t, bus, id, self.flagged(flags), data),
            Row::Error { class, flags, data } => rows.error_frame(t, bus, class, self.flagged(flags), data),
        }
        Ok(Some(clock))
    }

    /// The time of a message that states `stamp`, and who says so.
    fn time(&self, stamp: Option<i64>, log_time: u64) -> Result<(i64, Clock), Reason> {
        Ok(match stamp {
            _ if !self.timed => (NO_TIME, Clock::Nobody),
            Some(t) => (t, Clock::Message),
            None => (i64::try_from(log_time).map_err(|_| OUT_OF_RANGE)?, Clock::Recorder),
        })
    }
}
