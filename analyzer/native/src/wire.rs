//! What one CAN frame says about itself: the 29-bit identifier, the tail byte, the transfer CRC.
//!
//! Pure functions over plain integers; nothing here allocates, remembers or can fail.
//! Field positions: TM-UAVCAN V2.2 clauses 4.1.2 (identifier), 4.1.3 (tail byte) and 5.1 (CRC).
#![forbid(unsafe_code)]

/// The three identifier layouts of clause 4.1.2, services split by direction.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[repr(u8)]
pub enum Kind {
    Message = 0,
    Anonymous = 1,
    Request = 2,
    Response = 3,
}

impl Kind {
    pub fn is_service(self) -> bool {
        matches!(self, Kind::Request | Kind::Response)
    }
}

/// A decoded identifier. `dst` is 0 when the transfer is a broadcast.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Id {
    pub kind: Kind,
    pub type_id: u16,
    pub src: u8,
    pub dst: u8,
}

impl Id {
    /// A message of a sender without a node ID, which names its type in full: source 0 and more than the 2 bits that an
    /// anonymous message has for it.
    pub fn is_nameless(self) -> bool {
        self.kind == Kind::Message && self.src == 0
    }

    /// What [`session_bits`] and [`nameless_bits`] stand for.
    pub fn of_session(bits: u32) -> Self {
        let id = Id::parse(bits);
        if id.kind == Kind::Anonymous && bits > ANONYMOUS_TYPE {
            let (kind, type_id) = (Kind::Message, (bits >> 8) as u16);
            return Id { kind, type_id, ..id };
        }
        id
    }

    pub fn parse(raw: u32) -> Self {
        let src = (raw & 0x7F) as u8;
        if raw & 0x80 != 0 {
            let kind = if raw & 0x8000 == 0 {
                Kind::Response
            } else {
                Kind::Request
            };
            let dst = ((raw >> 8) & 0x7F) as u8;
            let type_id = ((raw >> 16) & 0xFF) as u16;
            Id {
                kind,
                type_id,
                src,
                dst,
            }
        } else if src == 0 {
            let type_id = ((raw >> 8) & 3) as u16;
            Id {
                kind: Kind::Anonymous,
                type_id,
                src,
                dst: 0,
            }
        } else {
            let type_id = (raw >> 8) as u16;
            Id {
                kind: Kind::Message,
                type_id,
                src,
                dst: 0,
            }
        }
    }
}

/// The bits of the type in the identifier of an anonymous message.
const ANONYMOUS_TYPE: u32 = 0x300;

/// The bits of an identifier that tell one session from another: all but the priority, and of an
/// anonymous frame not its random discriminator.
pub fn session_bits(raw: u32) -> u32 {
    if (raw as u8) == 0 {
        raw & ANONYMOUS_TYPE
    } else {
        raw & 0xFF_FFFF
    }
}

/// The same of an identifier without a source if all that stands above it is the type; none if it is no larger than an
/// anonymous message has room for.
pub fn nameless_bits(raw: u32) -> Option<u32> {
    let bits = raw & 0xFF_FFFF;
    (bits as u8 == 0 && bits > ANONYMOUS_TYPE).then_some(bits)
}

pub fn priority(raw: u32) -> u8 {
    ((raw >> 24) & 0x1F) as u8
}

/// The last byte of every frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Tail(pub u8);

impl Tail {
    pub fn start(self) -> bool {
        self.0 & 0x80 != 0
    }

    pub fn end(self) -> bool {
        self.0 & 0x40 != 0
    }

    pub fn toggle(self) -> bool {
        self.0 & 0x20 != 0
    }

    pub fn transfer_id(self) -> u8 {
        self.0 & 0x1F
    }
}

/// Bytes that are taken in one step; fewer than `LEAST` one by one.
const STEP: usize = 16;
const LEAST: usize = 10;
/// Table `k` advances a CRC by one byte followed by `k` zero bytes.
static TABLES: [[u16; 256]; STEP] = tables();

/// CRC-16/CCITT-FALSE. `crc_bitwise` in the tests is the clause it must match.
///
/// The value so far may be XORed into the next two bytes instead, after which leading zeros change nothing. So the last 16
/// bytes are one step, whether all of them are there or not.
#[inline]
pub fn crc(start: u16, bytes: &[u8]) -> u16 {
    let (mut value, mut rest) = (start, bytes);
    while let (true, Some((block, behind))) = (rest.len() > STEP, rest.split_first_chunk()) {
        value = advance(u64::from_be_bytes(*block) ^ (u64::from(value) << 48), 0);
        rest = behind;
    }
    if let (LEAST..=STEP, Some(front), Some(back)) = (rest.len(), rest.first_chunk(), rest.last_chunk()) {
        let front = (u64::from_be_bytes(*front) ^ (u64::from(value) << 48)) >> (8 * (STEP - rest.len()));
        return advance(front, 8) ^ advance(u64::from_be_bytes(*back), 0);
    }
    let step = |value: u16, &byte: &u8| (value << 8) ^ TABLES[0][usize::from((value >> 8) as u8 ^ byte)];
    rest.iter().fold(value, step)
}

/// The CRC of eight bytes and `zeros` zero bytes behind them, at most eight.
#[inline]
fn advance(block: u64, zeros: usize) -> u16 {
    let bytes = block.to_le_bytes();
    (0..8).fold(0, |value, at| value ^ TABLES[at + zeros][usize::from(bytes[at])])
}

/// The CRC after the 64-bit data type signature, least significant byte first (clause 5.1).
pub fn crc_start(signature: u64) -> u16 {
    crc(0xFFFF, &signature.to_le_bytes())
}

/// The start value from which `bytes` lead to `end`: the CRC run backwards. It names an unknown
/// type, because every intact transfer of the type has the same one.
pub fn crc_start_from(end: u16, bytes: &[u8]) -> u16 {
    bytes.iter().rev().fold(end, |value, &byte| {
        // The low byte of every entry of the first table is unique, so it names the index.
        let index = INDEX_OF_LOW[usize::from(value as u8)];
        let before_low = (value ^ TABLES[0][usize::from(index)]) >> 8;
        (u16::from(index ^ byte) << 8) | before_low
    })
}

static INDEX_OF_LOW: [u8; 256] = {
    let tables = tables();
    let mut index = [0; 256];
    let mut byte = 0;
    while byte < 256 {
        index[(tables[0][byte] & 0xFF) as usize] = byte as u8;
        byte += 1;
    }
    index
};

const fn tables() -> [[u16; 256]; STEP] {
    let mut tables = [[0; 256]; STEP];
    let mut byte = 0;
    while byte < 256 {
        let mut value = (byte as u16) << 8;
        let mut table = 0;
        while table < STEP {
            let mut bit = 0;
            while bit < 8 {
                value = if value & 0x8000 == 0 {
                    value << 1
                } else {
                    (value << 1) ^ 0x1021
                };
                bit += 1;
            }
            tables[table][byte] = value;
            table += 1;
        }
        byte += 1;
    }
    tables
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Clause 5.1, bit by bit.
    fn crc_bitwise(start: u16, bytes: &[u8]) -> u16 {
        bytes.iter().fold(start, |mut value, &byte| {
            value ^= u16::from(byte) << 8;
            for _ in 0..8 {
                value = if value & 0x8000 == 0 {
                    value << 1
                } else {
                    (value << 1) ^ 0x1021
                };
            }
            value
        })
    }

    #[test]
    fn check_value_of_clause_5_1() {
        assert_eq!(crc(0xFFFF, b"123456789"), 0x29B1);
    }

    #[test]
    fn every_length_matches_the_bitwise_clause_and_runs_backwards() {
        let bytes: Vec<u8> = (0..300_u32).map(|i| ((i * 7919) >> 3) as u8).collect();
        for length in 0..bytes.len() {
            for start in [0, 0xFFFF, 0x1591, (length * 977) as u16] {
                let end = crc_bitwise(start, &bytes[..length]);
                assert_eq!(crc(start, &bytes[..length]), end, "{length} bytes");
                assert_eq!(crc_start_from(end, &bytes[..length]), start, "{length} bytes");
            }
        }
    }

    #[test]
    fn start_values_of_the_six_types() {
        let signatures = [
            (0x217F_5C87_D7EC_951D, 0xE4B8),
            (0x948F_5E0B_33E0_EDEE, 0xD7B0),
            (0xA9AF_28AE_A2FB_B254, 0x1591),
            (0xCE2B_6D6B_6BDC_0AE8, 0x8A8E),
            (0xAACF_9B4B_2577_BC6E, 0xCE37),
            (0x4628_75A0_ED87_4302, 0xC322),
        ];
        for (signature, start) in signatures {
            assert_eq!(crc_start(signature), start);
        }
    }

    #[test]
    fn identifier_layouts_of_clause_4_1_2() {
        let message = Id::parse((31 << 24) | (1034 << 8) | 5);
        assert_eq!(
            message,
            Id {
                kind: Kind::Message,
                type_id: 1034,
                src: 5,
                dst: 0
            }
        );
        let request = Id::parse((3 << 24) | (0x0B << 16) | 0x8000 | (9 << 8) | 0x80 | 2);
        assert_eq!(
            request,
            Id {
                kind: Kind::Request,
                type_id: 11,
                src: 2,
                dst: 9
            }
        );
        let response = Id::parse(0x1801_018A);
        assert_eq!(
            response,
            Id {
                kind: Kind::Response,
                type_id: 1,
                src: 10,
                dst: 1
            }
        );
        let anonymous = Id::parse(0x1E21_4500);
        assert_eq!(
            anonymous,
            Id {
                kind: Kind::Anonymous,
                type_id: 1,
                src: 0,
                dst: 0
            }
        );
        assert_eq!(nameless_bits(0x1F04_0A00), Some(0x04_0A00));
        let nameless = Id::of_session(0x04_0A00);
        assert_eq!((nameless.kind, nameless.type_id), (Kind::Message, 1034));
        assert!(nameless.is_nameless() && !message.is_nameless() && !anonymous.is_nameless());
        assert_eq!(Id::of_session(session_bits(0x1E21_4500)), anonymous);
        assert_eq!(Id::of_session(session_bits(0x1F04_0A05)), message);
        for raw in [0x1F04_0A05, 0x1F04_0A80, 0x1F00_0300] {
            assert_eq!(nameless_bits(raw), None);
        }
        assert_eq!(session_bits(0x1E21_4500), session_bits(0x1FFF_FD00));
        assert_ne!(session_bits(0x1F04_0A05), session_bits(0x1F04_0A06));
        assert_eq!(session_bits(0x1F04_0A05), session_bits(0x0004_0A05));
    }
}
