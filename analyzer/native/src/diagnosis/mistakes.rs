//! Wrong CRCs that a usual mistake of a sender may give: a quick look at many, so that rules look closely at few.
#![forbid(unsafe_code)]

use super::CRC_BYTES;
use crate::wire::{crc, crc_start_from};

/// Zeros that a last frame may have been filled up with.
const MOST_PADDING: usize = 63;

/// Values from which the CRC of a type starts, and from which it does by mistake.
#[derive(Clone, Debug, Default)]
pub struct Starts {
    pub right: Vec<u16>,
    pub mistaken: Vec<u16>,
}

impl Starts {
    /// Whether any mistake gives the CRC `wire` of a payload: another start, bytes turned or swapped, a CRC behind the
    /// payload, zeros that were not counted.
    pub fn may_give(&self, wire: u16, payload: &[u8]) -> bool {
        if self.mistaken.contains(&crc_start_from(wire, payload)) {
            return true;
        }
        self.right.iter().any(|&start| {
            let here = crc(start, payload);
            here == !wire
                || here == wire.swap_bytes()
                || is_behind(start, wire, payload)
                || is_padded(start, wire, payload)
        })
    }
}

/// Whether the last two bytes are the CRC of those before them, the two in front among these.
fn is_behind(start: u16, wire: u16, payload: &[u8]) -> bool {
    let front = wire.to_le_bytes();
    if let Some((body, behind)) = payload.split_last_chunk::<CRC_BYTES>() {
        crc(crc(start, &front), body) == u16::from_le_bytes(*behind)
    } else {
        let joined = [&front[..], payload].concat();
        let (body, behind) = joined.split_at(joined.len() - CRC_BYTES);
        crc(start, body).to_le_bytes()[..] == *behind
    }
}

/// Whether it is the CRC without some of the zeros at the end.
fn is_padded(start: u16, wire: u16, payload: &[u8]) -> bool {
    let zeros = payload
        .iter()
        .rev()
        .take(MOST_PADDING)
        .take_while(|&&byte| byte == 0)
        .count();
    let mut here = crc(start, &payload[..payload.len() - zeros]);
    (0..zeros).any(|_| {
        let fits = here == wire;
        here = crc(here, &[0]);
        fits
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn known() -> Starts {
        Starts {
            right: vec![0x1234],
            mistaken: vec![0x4321, 0],
        }
    }

    #[test]
    fn mistakes_are_seen_and_nothing_else() {
        let payload = [1, 2, 3, 4, 5, 6, 7, 8, 9];
        let good = crc(0x1234, &payload);
        assert!(!known().may_give(good ^ 0x10, &payload));
        assert!(!known().may_give(good, &payload), "it is right");
        assert!(known().may_give(crc(0x4321, &payload), &payload));
        assert!(known().may_give(crc(0, &payload), &payload));
        assert!(known().may_give(!good, &payload));
        assert!(known().may_give(good.swap_bytes(), &payload));
    }

    #[test]
    fn a_crc_behind_the_payload_is_seen_in_the_shortest_one() {
        for payload in [&[][..], &[7], &[7, 9], &[1, 2, 3, 4, 5]] {
            let behind = crc(0x1234, payload).to_le_bytes();
            let joined = [payload, &behind[..]].concat();
            let (front, rest) = joined.split_at(CRC_BYTES);
            let wire = u16::from_le_bytes([front[0], front[1]]);
            assert!(known().may_give(wire, rest), "{payload:?}");
        }
    }

    #[test]
    fn so_many_zeros_at_the_end_are_padding() {
        let body = [5, 4, 3, 2, 1];
        let wire = crc(0x1234, &body);
        let padded = |zeros: usize| [&body[..], &vec![0; zeros]].concat();
        assert!((1..=MOST_PADDING).all(|zeros| known().may_give(wire, &padded(zeros))));
        assert!(!known().may_give(wire, &padded(MOST_PADDING + 1)));
        assert!(known().may_give(crc(0x1234, &[]), &[0; 3]), "nothing but zeros");
    }
}
