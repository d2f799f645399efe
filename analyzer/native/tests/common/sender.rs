//! A sender that shares no code with the core: payloads to the data of CAN frames.
//! Layouts and CRC are those of TM-UAVCAN V2.2 clauses 4.1.2, 4.1.3 and 5.1.

/// The types with a definition: (is a service, data type ID, signatures). Two types share the ID 1033.
pub const KNOWN: [(bool, u16, &[u64]); 6] = [
    (false, 1, &[0x0B2A_8126_20A1_1D40]),
    (false, 341, &[0x0F08_68D0_C1A7_C6F1]),
    (false, 1030, &[0x217F_5C87_D7EC_951D]),
    (false, 1033, &[0x948F_5E0B_33E0_EDEE, 0x4628_75A0_ED87_4302]),
    (false, 1034, &[0xA9AF_28AE_A2FB_B254]),
    (true, 1, &[0xEE46_8A81_21C4_6A9E]),
];
/// What the nodes know that the analyzer does not: the signature of every other type.
const SECRET: u64 = 0x0123_4567_89AB_CDEF;

pub fn signatures(service: bool, type_id: u16) -> Vec<u64> {
    let known = KNOWN.iter().find(|known| (known.0, known.1) == (service, type_id));
    known.map_or(vec![], |known| known.2.to_vec())
}

pub fn message_id(type_id: u16, src: u8) -> u32 {
    (16 << 24) | (u32::from(type_id) << 8) | u32::from(src)
}

/// The sender has no node ID yet: a random number stands for it.
pub fn anonymous_id(type_id: u8, random: u16) -> u32 {
    (30 << 24) | (u32::from(random & 0x3FFF) << 10) | (u32::from(type_id & 3) << 8)
}

pub fn service_id(type_id: u8, request: bool, src: u8, dst: u8) -> u32 {
    (24 << 24) | (u32::from(type_id) << 16) | (u32::from(request) << 15) | (u32::from(dst) << 8) | 0x80 | u32::from(src)
}

/// The signature that a sender uses with an identifier; of types that share an ID each node has its own.
pub fn signature_of(id: u32) -> u64 {
    let (service, type_id) = match id & 0xFF {
        0 => (false, (id >> 8) as u16 & 3),
        1..=0x7F => (false, (id >> 8) as u16),
        _ => (true, (id >> 16) as u16 & 0xFF),
    };
    let known = signatures(service, type_id);
    let own = (id & 0x7F) as usize % known.len().max(1);
    known.get(own).copied().unwrap_or(SECRET)
}

/// Clause 5.1, bit by bit: the signature, least significant byte first, then the payload.
pub fn crc(signature: u64, payload: &[u8]) -> u16 {
    let bytes = signature.to_le_bytes();
    bytes.iter().chain(payload).fold(0xFFFF, |value, &byte| {
        (0..8).fold(value ^ (u16::from(byte) << 8), |value, _| {
            (value << 1) ^ (0x1021 * (value >> 15))
        })
    })
}

/// The data fields of one transfer.
pub fn cut(id: u32, transfer_id: u8, payload: &[u8], fd: bool) -> Vec<Vec<u8>> {
    let room = if fd { 63 } else { 7 };
    let mut payload = payload.to_vec();
    let crc_bytes = |payload: &[u8]| if payload.len() > room { 2 } else { 0 };
    while fd && !fits_a_length_code((payload.len() + crc_bytes(&payload)) % room) {
        payload.push(0);
    }
    if payload.len() > room {
        let crc = crc(signature_of(id), &payload);
        payload.splice(0..0, crc.to_le_bytes());
    }
    let mut parts: Vec<Vec<u8>> = payload.chunks(room).map(<[u8]>::to_vec).collect();
    if parts.is_empty() {
        parts.push(vec![]);
    }
    let last = parts.len() - 1;
    for (at, part) in parts.iter_mut().enumerate() {
        let (start, end, toggle) = (u8::from(at == 0), u8::from(at == last), (at % 2) as u8);
        part.push((start << 7) | (end << 6) | (toggle << 5) | (transfer_id & 31));
    }
    parts
}

/// Whether a CAN FD frame can hold so many bytes and a tail byte.
fn fits_a_length_code(body: usize) -> bool {
    body < 8 || [11, 15, 19, 23, 31, 47].contains(&body)
}
