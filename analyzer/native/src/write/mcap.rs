//! MCAP message records as ROS 2 has them: `can_msgs/msg/Frame` for classic frames, `ros2_socketcan_msgs/msg/FdFrame`
//! for CAN FD, `rcl_interfaces/msg/Log` for comments, all in little-endian CDR. What these cannot say is said of a whole
//! channel ([`Content`]). Chunks, channels and the summary are the business of the caller.
#![forbid(unsafe_code)]

mod content;
mod log;

pub use content::{Content, Direction};

use super::{bus_of, kind_of, name, Account, InOrder, Loss, Row, Stamper};
use crate::events::EventKind;
use crate::frame_batch::FrameBatch;
use crate::frames::{DLC_SHIFT, FD, MAX_CLASSIC, NO_TIME, REMOTE};

pub(super) const MESSAGE: u8 = 5;
const MESSAGE_INDEX: u8 = 7;
const SECOND: i64 = 1_000_000_000;
/// Places in a message record: its length, sequence number, both times, and the stamp in its data.
const LENGTH: usize = 1;
const SEQUENCE: usize = 11;
const LOG_TIME: usize = 15;
const PUBLISH_TIME: usize = 23;
const DATA: usize = 31;
const STAMP: usize = DATA + 4;
/// Bytes of a record in front of what its length counts.
const PREFIX: usize = 9;
/// Plain CDR, little endian.
const ENCAPSULATION: [u8; 4] = [0, 1, 0, 0];
/// A drop count is an error frame that says so to everybody: class "controller", receive overflow. The number of frames
/// follows in the bytes that this class leaves free, for those who know from the channel that it is there.
const CONTROLLER: u32 = 4;
const OVERFLOW: [u8; 4] = [0, 1, 0, 0];

/// Messages of one bus, direction and content, with times or without; its ID is its place in [`Messages::channels`]
/// plus 1.
#[derive(Clone, Debug)]
pub struct Channel {
    /// Empty for comments, which have none.
    pub bus: String,
    pub direction: Direction,
    pub content: Content,
    /// Without times there is no stamp in the messages, and the log time is that of the message before.
    pub timed: bool,
    /// Messages so far, in all chunks.
    pub messages: u64,
    /// What all its records start with; times and lengths are filled in.
    start: Vec<u8>,
    /// Time and place of each message in the open chunk.
    index: Vec<u8>,
}

/// What a chunk holds, taken from [`Messages`].
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Chunk {
    pub messages: Vec<u8>,
    /// Channel ID, message index record, and number of messages of the channels that occur.
    pub indexes: Vec<(u16, Vec<u8>, u64)>,
    /// First and last time.
    pub span: (u64, u64),
}

/// The messages of the chunk that is open.
#[derive(Default)]
pub struct Messages {
    channels: Vec<Channel>,
    /// Channel IDs by bus, lack of times, direction and content; 0 is none.
    known: Vec<u16>,
    out: Vec<u8>,
    span: Option<(u64, u64)>,
    /// Of the last row: drop counts may have neither a time nor a bus.
    stamper: Stamper,
    bus: u8,
    account: Account,
}

/// What a message says.
struct Can<'a> {
    t: i64,
    bus: u8,
    direction: Direction,
    content: Content,
    id: u32,
    /// Remote, extended, error.
    flags: [bool; 3],
    length: u8,
    data: &'a [u8],
}

impl Messages {
    /// Appends rows of a batch, from row `start` on in the order of its records, until `limit` bytes are waiting.
    /// Returns the row to go on with, `None` at the end of the batch.
    pub fn add(&mut self, batch: &FrameBatch, start: usize, limit: usize) -> Option<usize> {
        self.stamper.look_ahead(batch);
        for (at, row) in InOrder::new(batch).enumerate().skip(start) {
            if self.out.len() >= limit {
                return Some(at);
            }
            match row {
                Row::Frame(row) => self.frame(batch, row),
                Row::Event(row) => self.event(batch, row),
            }
        }
        None
    }

    /// Bytes that wait for [`Messages::take`].
    pub fn waiting(&self) -> usize {
        self.out.len()
    }

    pub fn channels(&self) -> &[Channel] {
        &self.channels
    }

    pub fn account(&self) -> &Account {
        &self.account
    }

    /// The messages since the last call, which will stand behind `before` further bytes in their chunk; `None` if there
    /// are none.
    pub fn take(&mut self, before: u64) -> Option<Chunk> {
        let span = self.span.take()?;
        let mut indexes = vec![];
        for (channel, id) in self.channels.iter_mut().zip(1..) {
            if channel.index.is_empty() {
                continue;
            }
            let size = channel.index.len();
            let record = index_record(id, &mut channel.index, before);
            indexes.push((id, record, size as u64 / 16));
        }
        let room = self.out.capacity();
        Some(Chunk {
            messages: std::mem::replace(&mut self.out, Vec::with_capacity(room)),
            indexes,
            span,
        })
    }

    fn frame(&mut self, batch: &FrameBatch, row: usize) {
        let (frames, data) = (&batch.frames, batch.frames.data_of(row));
        let (flags, code) = (frames.flags[row], (frames.flags[row] >> DLC_SHIFT) as u8 & 15);
        let (fd, remote) = (flags & FD != 0, flags & (FD | REMOTE) == REMOTE);
        if !fd && data.len() > MAX_CLASSIC {
            return self.account.add(Loss::LongFrame);
        }
        self.account.frames += 1;
        let extended = self.account.takes(frames.id[row], flags);
        let can = Can {
            t: frames.t[row],
            bus: frames.bus[row],
            direction: Direction::of(flags),
            content: Content::of(flags),
            id: frames.id[row],
            flags: [remote, extended, false],
            length: if remote {
                code.min(MAX_CLASSIC as u8)
            } else {
                data.len() as u8
            },
            data,
        };
        self.message(batch, &can);
    }

    fn event(&mut self, batch: &FrameBatch, row: usize) {
        let (events, data) = (&batch.events, batch.events.data_of(row));
        let (t, bus) = (events.t[row], events.bus[row]);
        let mut dropped = [0; 8];
        let (t, bus, content, id, data) = match kind_of(events, row) {
            EventKind::ErrorFrame if data.len() > MAX_CLASSIC => return self.account.add(Loss::LongError),
            EventKind::ErrorFrame => (t, bus, Content::of(0), events.class[row], data),
            EventKind::Drop => {
                let t = if t == NO_TIME { self.stamper.last() } else { t };
                let bus = bus_of(events, row).unwrap_or_else(|| {
                    self.account.add(Loss::DropBus);
                    self.bus
                });
                dropped[..4].copy_from_slice(&OVERFLOW);
                dropped[4..].copy_from_slice(&events.class[row].to_le_bytes());
                (t, bus, Content::Drops, CONTROLLER, &dropped[..])
            }
            EventKind::Unreadable => return,
            EventKind::Comment | EventKind::FrameComment | EventKind::Gap => {
                return self.comment(batch, t, &events.text_of(row))
            }
        };
        let can = Can {
            t,
            bus,
            direction: Direction::of(events.flags[row]),
            content,
            id,
            flags: [false, false, true],
            length: data.len() as u8,
            data,
        };
        self.message(batch, &can);
    }

    fn message(&mut self, batch: &FrameBatch, can: &Can<'_>) {
        self.bus = can.bus;
        let channel = self.channel(batch, can.t, can.bus, can.direction, can.content);
        let start = self.open(channel);
        self.out.extend_from_slice(&can.id.to_le_bytes());
        if can.content.is_fd() {
            let [_, extended, error] = can.flags.map(u8::from);
            let tail = [extended, error, can.length, 0, can.length, 0, 0, 0]; // a byte to align the count
            self.out.extend_from_slice(&tail);
            self.out.extend_from_slice(can.data);
        } else {
            let [remote, extended, error] = can.flags.map(u8::from);
            let mut tail = [remote, extended, error, can.length, 0, 0, 0, 0, 0, 0, 0, 0];
            tail[4..4 + can.data.len()].copy_from_slice(can.data);
            self.out.extend_from_slice(&tail);
        }
        self.close(channel, start, can.t);
    }

    fn comment(&mut self, batch: &FrameBatch, t: i64, text: &str) {
        let channel = self.channel(batch, t, 0, Direction::Unknown, Content::Comments);
        let start = self.open(channel);
        log::write(text, &mut self.out);
        self.close(channel, start, t);
    }

    /// Begins a record of a channel; the place where it starts.
    fn open(&mut self, channel: usize) -> usize {
        let start = self.out.len();
        self.out.extend_from_slice(&self.channels[channel].start);
        start
    }

    /// Fills in what is known once the record is whole.
    fn close(&mut self, channel: usize, start: usize, t: i64) {
        let time = self.stamper.stamp(t, &mut self.account);
        let channel = &mut self.channels[channel];
        channel.index.extend_from_slice(&time.to_le_bytes());
        channel.index.extend_from_slice(&(start as u64).to_le_bytes());
        let record = &mut self.out[start..];
        let length = (record.len() - PREFIX) as u64;
        record[LENGTH..PREFIX].copy_from_slice(&length.to_le_bytes());
        record[SEQUENCE..LOG_TIME].copy_from_slice(&(channel.messages as u32).to_le_bytes());
        record[LOG_TIME..PUBLISH_TIME].copy_from_slice(&time.to_le_bytes());
        record[PUBLISH_TIME..DATA].copy_from_slice(&time.to_le_bytes());
        // Beyond the signed seconds of ROS the stamp is left out, and the log time holds alone.
        if let (true, Ok(seconds)) = (channel.timed, i32::try_from(time as i64 / SECOND)) {
            record[STAMP..STAMP + 4].copy_from_slice(&seconds.to_le_bytes());
            record[STAMP + 4..STAMP + 8].copy_from_slice(&((time as i64 % SECOND) as u32).to_le_bytes());
        }
        channel.messages += 1;
        let (first, last) = self.span.unwrap_or((time, time));
        self.span = Some((first.min(time), last.max(time)));
    }

    /// The place of the channel for such messages, which is new if need be.
    fn channel(&mut self, batch: &FrameBatch, t: i64, bus: u8, direction: Direction, content: Content) -> usize {
        let timed = Stamper::holds(t);
        let key =
            (usize::from(bus) << 3 | usize::from(!timed) << 2 | direction as usize) * Content::COUNT + content.index();
        if self.known.len() <= key {
            self.known.resize(key + 1, 0);
        }
        if self.known[key] == 0 {
            let id = self.channels.len() as u16 + 1;
            let (bus, start) = if content == Content::Comments {
                ("", log::start(beginning(id)))
            } else {
                let name = name(batch, bus);
                (name, named(beginning(id), name.as_bytes()))
            };
            self.known[key] = id;
            self.channels.push(Channel {
                bus: bus.to_owned(),
                direction,
                content,
                timed,
                messages: 0,
                start,
                index: vec![],
            });
        }
        usize::from(self.known[key]) - 1
    }
}

/// A message index record; `index` holds time and place of each message and is emptied. The messages will stand behind
/// `before` further bytes in their chunk.
pub(super) fn index_record(channel: u16, index: &mut Vec<u8>, before: u64) -> Vec<u8> {
    for place in index.chunks_exact_mut(16).map(|entry| &mut entry[8..]) {
        let moved = u64::from_le_bytes([
            place[0], place[1], place[2], place[3], place[4], place[5], place[6], place[7],
        ]);
        place.copy_from_slice(&(moved + before).to_le_bytes());
    }
    let size = index.len();
    let mut record = Vec::with_capacity(PREFIX + 6 + size);
    record.push(MESSAGE_INDEX);
    record.extend((size as u64 + 6).to_le_bytes());
    record.extend(channel.to_le_bytes());
    record.extend((size as u32).to_le_bytes());
    record.append(index);
    record
}

/// A message record up to the stamp.
fn beginning(channel: u16) -> Vec<u8> {
    let mut start = vec![0; STAMP + 8];
    start[0] = MESSAGE;
    start[PREFIX..SEQUENCE].copy_from_slice(&channel.to_le_bytes());
    start[DATA..STAMP].copy_from_slice(&ENCAPSULATION);
    start
}

/// The same up to the identifier.
fn named(mut start: Vec<u8>, name: &[u8]) -> Vec<u8> {
    string(name, &mut start, DATA);
    align(&mut start, DATA);
    start
}

/// Appends a text of CDR to data that begins at `from`.
fn string(text: &[u8], out: &mut Vec<u8>, from: usize) {
    align(out, from);
    out.extend((text.len() as u32 + 1).to_le_bytes());
    out.extend(text);
    out.push(0);
}

/// Fills up to whole words.
fn align(out: &mut Vec<u8>, from: usize) {
    out.resize(from + (out.len() - from).next_multiple_of(4), 0);
}
