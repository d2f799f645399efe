//! The code of a session: bus, sender, whether it is a service, and its type; of a service also whether it asks, and whom.
#![forbid(unsafe_code)]

const NODE_BITS: u32 = 17;
const BUS_BITS: u32 = 24;
const SERVICE: i64 = 1 << 16;
const ASKS: i64 = 1 << 7;

/// That of messages of a type.
pub fn of_message(bus: u8, node: u8, type_id: i64) -> i64 {
    (i64::from(bus) << BUS_BITS) | (i64::from(node & 0x7F) << NODE_BITS) | type_id
}

/// That of a service, by its type, whether it asks, and the other node.
pub fn of_service(bus: u8, node: u8, type_id: i64, asks: bool, other: u8) -> i64 {
    let asks = if asks { ASKS } else { 0 };
    of_message(bus, node, SERVICE | (type_id << 8) | asks | i64::from(other))
}

/// That of frames by what their identifiers have above the sender: a bit that says whether it is a service, and the rest.
pub fn of_bits(bus: u8, node: u8, bits: i64) -> i64 {
    let service = if bits & 1 == 0 { 0 } else { SERVICE };
    of_message(bus, node, service | (bits >> 1))
}

pub fn bus_of(code: i64) -> u8 {
    (code >> BUS_BITS) as u8
}

pub fn node_of(code: i64) -> u32 {
    (code >> NODE_BITS & 0x7F) as u32
}

pub fn is_service(code: i64) -> bool {
    code & SERVICE != 0
}

/// Whether its transfers are answers.
pub fn is_response(code: i64) -> bool {
    code & (SERVICE | ASKS) == SERVICE
}

#[cfg(test)]
mod tests {
    use super::{bus_of, is_response, is_service, node_of, of_bits, of_message, of_service};

    #[test]
    fn identifiers_and_transfers_have_one_code() {
        assert_eq!(of_bits(2, 11, 0x3E9 << 1), of_message(2, 11, 0x3E9));
        assert_eq!(of_bits(2, 11, 0x0B8C << 1 | 1), of_service(2, 11, 0x0B, true, 12));
        assert_eq!(of_bits(2, 11, 0x0B0C << 1 | 1), of_service(2, 11, 0x0B, false, 12));
    }

    #[test]
    fn a_code_says_what_it_is_of() {
        let (message, asks, answers) = (
            of_message(2, 11, 9),
            of_service(2, 11, 9, true, 3),
            of_service(2, 11, 9, false, 3),
        );
        assert_eq!([message, asks, answers].map(is_service), [false, true, true]);
        assert_eq!([message, asks, answers].map(is_response), [false, false, true]);
        assert_eq!((bus_of(asks), node_of(asks)), (2, 11));
    }
}
