//! pcapng with one section: packets of `LINKTYPE_CAN_SOCKETCAN`, each interface described where it first appears.
//! Packets without times are those of a second interface of the same name, whose description says so ([`NO_STAMPS`]).
//! Comments are entries of a system journal, which Wireshark lists among the packets.
#![forbid(unsafe_code)]

use super::{bus_of, kind_of, name, Account, Loss, Stamper, Writer};
use crate::events::EventKind;
use crate::frame_batch::FrameBatch;
use crate::frames::{
    BRS, DLC_SHIFT, ESI, FD, MAX_CLASSIC, MAX_DATA, NO_TIME, REMOTE, RX, TX, WORD_ERROR, WORD_EXTENDED, WORD_REMOTE,
};
use crate::pcapng::{journal, NO_STAMPS};

const SECTION: u32 = 0x0A0D_0D0A;
const INTERFACE: u32 = 1;
const STATISTICS: u32 = 5;
const PACKET: u32 = 6;
const JOURNAL: u32 = 9;
const LINK_CAN: u16 = 227;
/// Options: of a section, an interface, a packet, statistics; a comment may be one of each.
const COMMENT: u16 = 1;
const APPLICATION: u16 = 4;
const INTERFACE_NAME: u16 = 2;
const DESCRIPTION: u16 = 3;
const RESOLUTION: u16 = 9;
const PACKET_FLAGS: u16 = 2;
const DROPPED: u16 = 5;
/// Values of `PACKET_FLAGS`.
const INBOUND: u32 = 1;
const OUTBOUND: u32 = 2;
/// Stamps count nanoseconds: 10 to this negative power of a second.
const NANOSECONDS: u8 = 9;
/// Bits of the flags byte of `struct canfd_frame`.
const FLAG_BRS: u8 = 1;
const FLAG_ESI: u8 = 2;
const FLAG_FD: u8 = 4;

/// Blocks in the byte order of most machines, little endian.
#[derive(Default)]
pub struct Pcapng {
    /// Numbers of the interfaces in the file by bus: the one without times, and the one with.
    numbers: Vec<[Option<u32>; 2]>,
    /// By number.
    interfaces: Vec<Described>,
    stamper: Stamper,
    account: Account,
    /// On the next frame.
    comment: String,
    /// On the frame or error frame of a record of the capture: its line, and the text.
    said: Option<(u32, String)>,
}

struct Described {
    timed: bool,
    /// Frames lost so far.
    dropped: u64,
}

/// What a packet says of one frame.
struct Packet<'a> {
    t: i64,
    interface: u32,
    word: u32,
    /// Length of the data, or of the data that a remote frame asks for.
    length: u8,
    marks: u8,
    raw: u8,
    /// Bytes that the kernel's structure has for data.
    room: usize,
    data: &'a [u8],
    direction: u32,
    comment: &'a str,
}

impl Writer for Pcapng {
    fn start(&self, out: &mut Vec<u8>) {
        block(SECTION, out, |out| {
            out.extend(0x1A2B_3C4D_u32.to_le_bytes());
            out.extend([1, 0, 0, 0]); // version 1.0
            out.extend((-1_i64).to_le_bytes()); // length not stated
            option(APPLICATION, b"tailbyte", out);
            option(0, &[], out);
        });
    }

    fn look_ahead(&mut self, batch: &FrameBatch) -> usize {
        self.stamper.look_ahead(batch);
        64
    }

    fn frame(&mut self, batch: &FrameBatch, row: usize, out: &mut Vec<u8>) {
        let (frames, data) = (&batch.frames, batch.frames.data_of(row));
        let mut comment = std::mem::take(&mut self.comment);
        let said = self.said_of(frames.line[row]);
        if comment.is_empty() {
            comment = said;
        }
        let (id, flags) = (frames.id[row], frames.flags[row]);
        let set = |bit, value: u8| if flags & bit != 0 { value } else { 0 };
        let is_fd = flags & FD != 0;
        if !is_fd && data.len() > MAX_CLASSIC {
            return self.account.add(Loss::LongFrame);
        }
        self.account.frames += 1;
        let code = (flags >> DLC_SHIFT) as u8 & 15;
        let length = match flags & (FD | REMOTE) {
            REMOTE => code.min(MAX_CLASSIC as u8),
            _ => data.len() as u8,
        };
        let raw = if !is_fd && usize::from(code) > MAX_CLASSIC {
            code
        } else {
            0
        };
        if raw != 0 && usize::from(length) != MAX_CLASSIC {
            self.account.add(Loss::RawCode);
        }
        let extended = self.account.takes(id, flags);
        let packet = Packet {
            t: frames.t[row],
            interface: self.interface(batch, frames.bus[row], frames.t[row], out),
            word: id
                | if extended { WORD_EXTENDED } else { 0 }
                | if flags & (REMOTE | FD) == REMOTE {
                    WORD_REMOTE
                } else {
                    0
                },
            length,
            marks: if is_fd {
                FLAG_FD | set(BRS, FLAG_BRS) | set(ESI, FLAG_ESI)
            } else {
                0
            },
            raw: if usize::from(length) == MAX_CLASSIC { raw } else { 0 },
            room: if is_fd { MAX_DATA } else { MAX_CLASSIC },
            data,
            direction: direction(flags),
            comment: &comment,
        };
        self.packet(&packet, out);
    }

    fn event(&mut self, batch: &FrameBatch, row: usize, out: &mut Vec<u8>) {
        let (events, data) = (&batch.events, batch.events.data_of(row));
        match kind_of(events, row) {
            EventKind::ErrorFrame if data.len() > MAX_CLASSIC => self.account.add(Loss::LongError),
            EventKind::ErrorFrame => {
                let comment = self.said_of(events.line[row]);
                let packet = Packet {
                    t: events.t[row],
                    interface: self.interface(batch, events.bus[row], events.t[row], out),
                    word: events.class[row] | WORD_ERROR,
                    length: data.len() as u8,
                    marks: 0,
                    raw: 0,
                    room: MAX_CLASSIC,
                    data,
                    direction: direction(events.flags[row]),
                    comment: &comment,
                };
                self.packet(&packet, out);
            }
            EventKind::Drop => self.drop_count(batch, row, out),
            EventKind::Unreadable => {}
            EventKind::FrameComment => self.said = Some((events.line[row], events.text_of(row))),
            EventKind::Comment | EventKind::Gap => {
                if events.t[row] != NO_TIME && !Stamper::holds(events.t[row]) {
                    self.account.add(Loss::EarlyTime);
                }
                block(JOURNAL, out, |out| {
                    journal::write(events.t[row], &events.text_of(row), out);
                });
            }
        }
    }

    fn comment(&mut self, text: &str) {
        text.clone_into(&mut self.comment);
    }

    fn account(&self) -> &Account {
        &self.account
    }
}

impl Pcapng {
    /// Takes what the capture says of a record.
    fn said_of(&mut self, line: u32) -> String {
        let said = self.said.take().filter(|(of, _)| *of == line);
        said.map(|(_, text)| text).unwrap_or_default()
    }

    fn packet(&mut self, packet: &Packet<'_>, out: &mut Vec<u8>) {
        let stamp = self.stamper.stamp(packet.t, &mut self.account);
        let size = 8 + packet.room as u32;
        let mut head = [0; 36];
        head[..4].copy_from_slice(&packet.interface.to_le_bytes());
        head[4..8].copy_from_slice(&((stamp >> 32) as u32).to_le_bytes());
        head[8..12].copy_from_slice(&(stamp as u32).to_le_bytes());
        head[12..16].copy_from_slice(&size.to_le_bytes());
        head[16..20].copy_from_slice(&size.to_le_bytes());
        head[20..24].copy_from_slice(&packet.word.to_be_bytes());
        head[24..28].copy_from_slice(&[packet.length, packet.marks, 0, packet.raw]);
        block(PACKET, out, |out| {
            out.extend_from_slice(&head[..28]);
            let mut data = [0; MAX_DATA];
            data[..packet.data.len()].copy_from_slice(packet.data);
            out.extend_from_slice(&data[..packet.room]);
            if !packet.comment.is_empty() {
                option(COMMENT, short(packet.comment).as_bytes(), out);
            }
            if packet.direction != 0 {
                option(PACKET_FLAGS, &packet.direction.to_le_bytes(), out);
            }
            if packet.direction != 0 || !packet.comment.is_empty() {
                option(0, &[], out);
            }
        });
    }

    /// Statistics count from the start of the capture. A count without a time gets that of the record before, one without
    /// an interface goes to the first one.
    fn drop_count(&mut self, batch: &FrameBatch, row: usize, out: &mut Vec<u8>) {
        let events = &batch.events;
        let t = match events.t[row] {
            NO_TIME => self.stamper.last(),
            t => t,
        };
        let interface = if let Some(bus) = bus_of(events, row) {
            self.interface(batch, bus, t, out)
        } else {
            self.account.add(Loss::DropBus);
            let timed = Stamper::holds(t);
            let first = self.interfaces.iter().position(|one| one.timed == timed);
            first.map_or_else(|| self.describe(b"any", timed, out), |first| first as u32)
        };
        let stamp = self.stamper.stamp(t, &mut self.account);
        let dropped = &mut self.interfaces[interface as usize].dropped;
        *dropped += u64::from(events.class[row]);
        let dropped = dropped.to_le_bytes();
        block(STATISTICS, out, |out| {
            out.extend(interface.to_le_bytes());
            out.extend(((stamp >> 32) as u32).to_le_bytes());
            out.extend((stamp as u32).to_le_bytes());
            option(DROPPED, &dropped, out);
            option(0, &[], out);
        });
    }

    /// The number of the interface for a row of this time, which is described now if it was not before.
    fn interface(&mut self, batch: &FrameBatch, bus: u8, t: i64, out: &mut Vec<u8>) -> u32 {
        let (at, timed) = (usize::from(bus), Stamper::holds(t));
        if self.numbers.len() <= at {
            self.numbers.resize(at + 1, [None; 2]);
        }
        if let Some(number) = self.numbers[at][usize::from(timed)] {
            return number;
        }
        // Without a name, readers would take the two interfaces of a bus for two buses.
        let name = Some(name(batch, bus)).filter(|name| !name.is_empty()).unwrap_or("can");
        let number = self.describe(name.as_bytes(), timed, out);
        self.numbers[at][usize::from(timed)] = Some(number);
        number
    }

    fn describe(&mut self, name: &[u8], timed: bool, out: &mut Vec<u8>) -> u32 {
        block(INTERFACE, out, |out| {
            out.extend(LINK_CAN.to_le_bytes());
            out.extend([0; 6]); // reserved; packets of any size
            option(INTERFACE_NAME, name, out);
            if !timed {
                option(DESCRIPTION, NO_STAMPS, out);
            }
            option(RESOLUTION, &[NANOSECONDS], out);
            option(0, &[], out);
        });
        self.interfaces.push(Described { timed, dropped: 0 });
        self.interfaces.len() as u32 - 1
    }
}

/// As much of a text as an option holds.
fn short(text: &str) -> &str {
    let most = usize::from(u16::MAX);
    let end = (0..=text.len().min(most)).rev().find(|&at| text.is_char_boundary(at));
    &text[..end.unwrap_or(0)]
}

/// The value of `PACKET_FLAGS`; 0 if the direction is not known.
fn direction(flags: u16) -> u32 {
    match flags & (TX | RX) {
        0 => 0,
        RX => INBOUND,
        _ => OUTBOUND,
    }
}

/// A block around what `body` appends, which comes in whole words.
fn block(kind: u32, out: &mut Vec<u8>, body: impl FnOnce(&mut Vec<u8>)) {
    let start = out.len();
    out.extend_from_slice(&kind.to_le_bytes());
    out.extend_from_slice(&[0; 4]);
    body(out);
    let length = ((out.len() - start + 4) as u32).to_le_bytes();
    out[start + 4..start + 8].copy_from_slice(&length);
    out.extend_from_slice(&length);
}

fn option(code: u16, value: &[u8], out: &mut Vec<u8>) {
    out.extend_from_slice(&code.to_le_bytes());
    out.extend_from_slice(&(value.len() as u16).to_le_bytes());
    out.extend_from_slice(value);
    out.resize(out.len() + value.len().next_multiple_of(4) - value.len(), 0);
}
