//! CAN frames as MCAP messages of every layout that the walk reads.

use _native::frame_batch::FrameBatch;
use _native::frames::{BRS, DLC_SHIFT, ERROR, ESI, EXTENDED, FD, REMOTE, RX, TX};
use _native::mcap::{Form, Kind, Layout, Role, Walk, Wire};

#[path = "messages.rs"]
pub mod messages;

use messages::{MARKS, SECOND};

const KINDS: [Kind; 3] = [Kind::CanMsgs, Kind::SocketCanFd, Kind::SocketCan];

/// One frame or error frame, by the meaning of the columns; of an error frame `flags` is `ERROR` alone.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Sent {
    /// 0: the message states no time.
    pub t: i64,
    /// Empty: the message names no interface.
    pub name: String,
    pub id: u32,
    pub flags: u16,
    pub data: Vec<u8>,
}

/// How messages are written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Shape {
    Cdr(Kind, bool),
    Ros1(Kind),
    /// With the role of the data.
    Json(Role),
    Protobuf(Form),
}

pub fn shapes() -> Vec<Shape> {
    let ros = KINDS.map(|kind| [Shape::Cdr(kind, false), Shape::Cdr(kind, true), Shape::Ros1(kind)]);
    let json = [Role::Data, Role::DataHex, Role::DataBase64].map(Shape::Json);
    let protobuf = [Form::Bytes, Form::Repeated].map(Shape::Protobuf);
    ros.into_iter().flatten().chain(json).chain(protobuf).collect()
}

impl Shape {
    pub fn layout(self) -> Layout {
        let stamp = ["head", "stamp"];
        match self {
            Shape::Cdr(kind, _) => Layout::ros(Wire::Cdr, kind),
            Shape::Ros1(kind) => Layout::ros(Wire::Ros1, kind),
            Shape::Json(data) => {
                let mut fields = vec![
                    (data, vec!["data".to_owned()]),
                    (
                        Role::Seconds,
                        [&stamp[..], &["sec"]]
                            .concat()
                            .iter()
                            .map(ToString::to_string)
                            .collect(),
                    ),
                    (
                        Role::Nanoseconds,
                        [&stamp[..], &["nsec"]]
                            .concat()
                            .iter()
                            .map(ToString::to_string)
                            .collect(),
                    ),
                ];
                let flat = MARKS.iter().map(|&(role, name, _)| (role, vec![name.to_owned()]));
                fields.extend(flat);
                fields.extend(
                    [
                        (Role::Id, "id"),
                        (Role::Bus, "bus"),
                        (Role::Dlc, "dlc"),
                        (Role::Sent, "direction"),
                    ]
                    .map(|(role, name)| (role, vec![name.to_owned()])),
                );
                Layout::json(fields).unwrap()
            }
            Shape::Protobuf(data) => {
                let mut fields = vec![
                    (Role::Seconds, vec![1, 2, 1], Form::Varint),
                    (Role::Nanoseconds, vec![1, 2, 2], Form::Fixed32),
                    (Role::Id, vec![2], Form::Varint),
                    (Role::Data, vec![3], data),
                    (Role::Bus, vec![4], Form::String),
                    (Role::Dlc, vec![5], Form::ZigZag),
                    (Role::Sent, vec![6], Form::Varint),
                ];
                let marks = MARKS
                    .iter()
                    .zip(16..)
                    .map(|(&(role, ..), number)| (role, vec![number], Form::Varint));
                fields.extend(marks);
                Layout::protobuf(fields).unwrap()
            }
        }
    }

    /// What the channel of such messages is marked with, so that all frames come back as they were sent.
    pub fn marks(self) -> u16 {
        match self {
            Shape::Cdr(Kind::SocketCanFd, _) | Shape::Ros1(Kind::SocketCanFd) => FD,
            _ => 0,
        }
    }

    /// What is left of a frame in a message of this shape.
    pub fn carried(self, sent: &Sent) -> Sent {
        let mut left = sent.clone();
        let kind = match self {
            Shape::Cdr(kind, _) | Shape::Ros1(kind) => Some(kind),
            _ => None,
        };
        left.t = left.t.clamp(0, i64::from(i32::MAX) * SECOND);
        left.flags &= match kind {
            Some(Kind::CanMsgs) => EXTENDED | REMOTE | ERROR,
            Some(Kind::SocketCanFd) => EXTENDED | ERROR,
            Some(Kind::SocketCan) => EXTENDED | REMOTE | ERROR | FD,
            None => EXTENDED | REMOTE | ERROR | FD | BRS | ESI | TX,
        };
        let mut longest = if left.flags & FD == 0 { 8 } else { 64 };
        if left.flags & FD == 0 {
            left.flags &= !(BRS | ESI);
        }
        if left.flags & ERROR != 0 {
            (left.flags, longest) = (ERROR, 8);
        } else if left.flags & REMOTE != 0 {
            let length = sent.data.len() as u16 % 9;
            left.flags = (left.flags & (EXTENDED | REMOTE | TX)) | length << DLC_SHIFT;
            longest = 0;
        } else if kind == Some(Kind::SocketCanFd) {
            left.flags |= FD;
            longest = 64;
        }
        if kind.is_none() && left.flags & (TX | ERROR) == 0 {
            left.flags |= RX;
        }
        left.id &= if left.flags & (EXTENDED | ERROR) == 0 {
            0x7FF
        } else {
            0x1FFF_FFFF
        };
        left.data.truncate(longest);
        left
    }

    /// The message with a frame that this shape can carry.
    pub fn message(self, sent: &Sent) -> Vec<u8> {
        match self {
            Shape::Cdr(kind, big) => messages::ros(kind, sent, true, big),
            Shape::Ros1(kind) => messages::ros(kind, sent, false, false),
            Shape::Json(data) => messages::json(data, sent).into_bytes(),
            Shape::Protobuf(data) => messages::protobuf(data, sent),
        }
    }
}

/// Record number and what stands there; of an event that is no error frame its text.
pub type Row = (u32, Result<Sent, String>);

/// All rows so far in the order of their records, by way of the laws that hold for any input.
pub fn rows(walk: &mut Walk) -> (Vec<Row>, FrameBatch) {
    let waiting = walk.rows.waiting();
    let batch = walk.take();
    let (counts, frames, events) = (batch.counts, &batch.frames, &batch.events);
    assert_eq!(
        counts.lines,
        counts.frames + counts.error_frames + counts.unreadable + counts.other
    );
    assert_eq!(counts.frames, frames.len() as u64);
    assert_eq!(counts.error_frames + counts.unreadable, events.len() as u64);
    assert_eq!(waiting, frames.len() + events.len());
    let name = |bus: u8| batch.buses.names()[usize::from(bus)].clone();
    let mut rows: Vec<Row> = (0..frames.len())
        .map(|row| {
            let sent = Sent {
                t: frames.t[row],
                name: name(frames.bus[row]),
                id: frames.id[row],
                flags: frames.flags[row],
                data: frames.data_of(row).to_vec(),
            };
            (frames.line[row], Ok(sent))
        })
        .collect();
    let (mut data_from, mut text_from) = (0, 0);
    for row in 0..events.len() {
        let (data_to, text_to) = (events.data_end[row] as usize, events.text_end[row] as usize);
        let text = &events.text[text_from..text_to];
        assert!(
            text.len() < 500 && text.iter().all(|b| (b' '..=b'~').contains(b)),
            "{text:?}"
        );
        let what = if events.kind[row] == 0 {
            Ok(Sent {
                t: events.t[row],
                name: name(events.bus[row]),
                id: events.class[row],
                flags: ERROR,
                data: events.data[data_from..data_to].to_vec(),
            })
        } else {
            Err(String::from_utf8(text.to_vec()).unwrap())
        };
        rows.push((events.line[row], what));
        (data_from, text_from) = (data_to, text_to);
    }
    rows.sort_by_key(|(line, _)| *line);
    (rows, batch)
}
