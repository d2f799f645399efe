//! CAN frames in the bytes of ROS, JSON and protobuf messages, and messages in MCAP records.

use _native::frames::{BRS, DLC_SHIFT, ERROR, ESI, EXTENDED, FD, REMOTE, RX, TX};
use _native::mcap::{Form, Kind, Role};

use super::Sent;

pub const SECOND: i64 = 1_000_000_000;

/// Flags of the described layouts.
pub const MARKS: [(Role, &str, u16); 6] = [
    (Role::Extended, "extended", EXTENDED),
    (Role::Remote, "rtr", REMOTE),
    (Role::Error, "error", ERROR),
    (Role::Fd, "fd", FD),
    (Role::Brs, "brs", BRS),
    (Role::Esi, "esi", ESI),
];

fn dlc(sent: &Sent) -> u8 {
    if sent.flags & REMOTE == 0 {
        sent.data.len() as u8
    } else {
        (sent.flags >> DLC_SHIFT) as u8
    }
}

pub fn ros(kind: Kind, sent: &Sent, aligned: bool, big: bool) -> Vec<u8> {
    let mut to = Packed {
        bytes: vec![],
        aligned,
        big,
    };
    if !aligned {
        to.word(77);
    }
    to.word((sent.t / SECOND) as u32);
    to.word((sent.t % SECOND) as u32);
    let nul = usize::from(aligned);
    to.word((sent.name.len() + nul) as u32);
    to.bytes.extend(sent.name.bytes().chain(std::iter::repeat_n(0, nul)));
    to.word(sent.id);
    let flag = |bit: u16| u8::from(sent.flags & bit != 0);
    if kind != Kind::SocketCanFd {
        to.bytes.push(flag(REMOTE));
    }
    to.bytes.extend([flag(EXTENDED), flag(ERROR)]);
    if kind == Kind::SocketCan {
        to.bytes.push(flag(FD));
    }
    to.bytes.push(dlc(sent));
    let size = match kind {
        Kind::CanMsgs => 8,
        Kind::SocketCan => 64,
        Kind::SocketCanFd => {
            to.word(sent.data.len() as u32);
            sent.data.len()
        }
    };
    to.bytes
        .extend(sent.data.iter().copied().chain(std::iter::repeat(0xEE)).take(size));
    let head: &[u8] = if aligned { &[0, u8::from(!big), 0, 0] } else { &[] };
    [head, &to.bytes].concat()
}

struct Packed {
    bytes: Vec<u8>,
    aligned: bool,
    big: bool,
}

impl Packed {
    fn word(&mut self, word: u32) {
        while self.aligned && !self.bytes.len().is_multiple_of(4) {
            self.bytes.push(0xAA);
        }
        self.bytes.extend(if self.big {
            word.to_be_bytes()
        } else {
            word.to_le_bytes()
        });
    }
}

pub fn json(role: Role, sent: &Sent) -> String {
    let text =
        |separator: &str, byte: fn(&u8) -> String| sent.data.iter().map(byte).collect::<Vec<_>>().join(separator);
    let data = match role {
        Role::DataHex => format!("\"{}\"", text(" ", |byte| format!("{byte:02X}"))),
        Role::DataBase64 => format!("\"{}\"", base64(&sent.data)),
        _ => format!("[{}]", text(", ", u8::to_string)),
    };
    let mut fields = vec![
        "\"more\": [{\"id\": 5, \"\": \"\\\"}\\u005d\"}, [], null, -1.5e-3]".to_owned(),
        format!("\"id\": {}, \"dlc\":{}", sent.id, dlc(sent)),
        format!("\"data\": {data}"),
    ];
    if sent.t != 0 {
        fields.push(format!(
            "\"head\" : {{\"id\": 1, \"stamp\": {{\"sec\": {}, \"nsec\": \"{}\"}}}}",
            sent.t / SECOND,
            sent.t % SECOND
        ));
    }
    if !sent.name.is_empty() {
        fields.push(format!("\"bus\": \"{}\"", sent.name));
    }
    if sent.flags & (TX | RX) != 0 {
        let direction = if sent.flags & TX == 0 { "Rx" } else { "Tx" };
        fields.push(format!("\"direction\": \"{direction}\""));
    }
    fields.extend(MARKS.map(|(_, name, bit)| format!("\"{name}\":{}", sent.flags & bit != 0)));
    format!(" {{{}}}\n", fields.join(", "))
}

fn base64(data: &[u8]) -> String {
    const LETTERS: &[u8; 64] = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    let mut text = String::new();
    for group in data.chunks(3) {
        let word = (0..3).fold(0, |word, at| word << 8 | u32::from(group.get(at).copied().unwrap_or(0)));
        for at in 0..4 {
            let letter = LETTERS[(word >> (18 - 6 * at)) as usize & 63];
            text.push(if at > group.len() { '=' } else { char::from(letter) });
        }
    }
    text
}

pub fn protobuf(data: Form, sent: &Sent) -> Vec<u8> {
    let mut message = field(9, 3, &field(9, 4, &[])); // a group
    message.splice(1..1, field(3, 2, &[1, 9]));
    if sent.t != 0 {
        let stamp = [
            field(1, 0, &varint((sent.t / SECOND) as u64)),
            field(2, 5, &((sent.t % SECOND) as u32).to_le_bytes()),
        ];
        message.extend(nested(1, &nested(2, &stamp.concat())));
    }
    message.extend(field(2, 0, &varint(sent.id.into())));
    if data == Form::Bytes {
        message.extend(nested(3, &sent.data));
    } else {
        let (packed, single) = sent.data.split_at(sent.data.len() / 2);
        let packed: Vec<u8> = packed.iter().flat_map(|&byte| varint(byte.into())).collect();
        message.extend(nested(3, &packed));
        message.extend(single.iter().flat_map(|&byte| field(3, 0, &varint(byte.into()))));
    }
    message.extend(nested(4, sent.name.as_bytes()));
    message.extend(field(5, 0, &varint(u64::from(dlc(sent)) << 1)));
    if sent.flags & TX != 0 {
        message.extend(field(6, 0, &[1]));
    }
    for ((_, _, bit), number) in MARKS.iter().zip(16..) {
        if sent.flags & bit != 0 {
            message.extend(field(number, 0, &[1]));
        }
    }
    message
}

pub fn varint(mut value: u64) -> Vec<u8> {
    let mut bytes = vec![];
    while value > 0x7F {
        bytes.push(value as u8 | 0x80);
        value >>= 7;
    }
    bytes.push(value as u8);
    bytes
}

/// A field of a message, from its number, wire type and the bytes behind.
pub fn field(number: u64, kind: u64, value: &[u8]) -> Vec<u8> {
    [&varint(number << 3 | kind), value].concat()
}

pub fn nested(number: u64, value: &[u8]) -> Vec<u8> {
    field(number, 2, &[&varint(value.len() as u64), value].concat())
}

/// A Message record.
pub fn record(channel: u16, log_time: u64, message: &[u8]) -> Vec<u8> {
    let mut record = vec![5];
    record.extend((22 + message.len() as u64).to_le_bytes());
    record.extend(channel.to_le_bytes());
    record.extend(7_u32.to_le_bytes());
    record.extend(log_time.to_le_bytes());
    record.extend([0; 8]);
    record.extend(message);
    record
}
