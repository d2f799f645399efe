//! Stuff bits: after five equal bits one of the other kind (ISO 11898-1), counted byte by byte from tables.
#![forbid(unsafe_code)]

/// A state is 2 * run + bit: how many equal bits were sent last, and which.
const START: u8 = 0;
const STATES: usize = 10;

/// For every state and byte: the next state times 8, and the stuff bits (at most 2).
const STUFF: [[u8; 256]; STATES] = stuff_table();
/// The same from the start of a frame, by count, for what is left over when the rest is whole bytes.
const FIRST: [[u8; 128]; 8] = first_table();

/// State times 8 plus stuff bits after the `count` (at most 8) low bits of `bits`.
const fn walk(state: u8, bits: usize, count: u32) -> u8 {
    let (mut run, mut last, mut stuffed, mut left) = (state >> 1, state & 1, 0, count);
    while left > 0 {
        left -= 1;
        let bit = (bits >> left & 1) as u8;
        run = if run > 0 && bit == last { run + 1 } else { 1 };
        last = bit;
        if run == 5 {
            run = 1;
            last = 1 - last;
            stuffed += 1;
        }
    }
    (run << 1 | last) << 3 | stuffed
}

const fn stuff_table() -> [[u8; 256]; STATES] {
    let mut table = [[0; 256]; STATES];
    let mut state = 0;
    while state < STATES {
        let mut byte = 0;
        while byte < 256 {
            table[state][byte] = walk(state as u8, byte, 8);
            byte += 1;
        }
        state += 1;
    }
    table
}

const fn first_table() -> [[u8; 128]; 8] {
    let mut table = [[0; 128]; 8];
    let mut count = 0;
    while count < 8 {
        let mut bits = 0;
        while bits < 1 << count {
            table[count][bits] = walk(START, bits, count as u32);
            bits += 1;
        }
        count += 1;
    }
    table
}

/// Counts stuff bits as a frame goes by.
#[derive(Default)]
pub struct Stuffing {
    state: u8,
    pub stuffed: u32,
}

impl Stuffing {
    /// The next `count` bits.
    pub fn bits(&mut self, bits: u128, count: u32) {
        let odd = count % 8;
        let top = (bits >> (count - odd)) as usize & ((1 << odd) - 1);
        self.step(if self.state == START {
            FIRST[odd as usize][top]
        } else {
            walk(self.state, top, odd)
        });
        for at in (0..count / 8).rev() {
            self.byte((bits >> (8 * at)) as u8);
        }
    }

    #[inline]
    pub fn byte(&mut self, byte: u8) {
        self.step(STUFF[usize::from(self.state)][usize::from(byte)]);
    }

    #[inline]
    fn step(&mut self, found: u8) {
        self.state = found >> 3;
        self.stuffed += u32::from(found & 7);
    }
}

/// Bits and stuff bits of rows of `count` bits that have equally many whole bytes. They are counted side by side: each
/// byte of a row waits for the one before it, but not for those of other rows.
pub fn lengths<const N: usize>(rows: [(u128, u32); N]) -> [u32; N] {
    let whole = rows[0].1 / 8;
    let bytes = rows.map(|(bits, _)| (bits << (128 - 8 * whole)).to_be_bytes());
    let mut found = rows.map(|(bits, count)| {
        let odd = count % 8;
        FIRST[odd as usize][(bits >> (count - odd)) as usize & ((1 << odd) - 1)]
    });
    let mut lengths = rows.map(|(_, count)| count);
    for at in 0..whole as usize {
        for lane in 0..N {
            lengths[lane] += u32::from(found[lane] & 7);
            found[lane] = STUFF[usize::from(found[lane] >> 3)][usize::from(bytes[lane][at])];
        }
    }
    for lane in 0..N {
        lengths[lane] += u32::from(found[lane] & 7);
    }
    lengths
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The worst case: five equal bits, then four of the other kind each time, which the stuff bit makes five.
    #[test]
    fn at_most_every_fourth_bit_is_stuffed() {
        let bits = (0..28).fold(0_u128, |bits, four| bits << 4 | if four % 2 == 0 { 0xF } else { 0 });
        let mut stuffing = Stuffing::default();
        stuffing.bits(bits, 5 + 4 * 28);
        assert_eq!(stuffing.stuffed, 1 + 28);
        let mut zeros = Stuffing::default();
        zeros.bits(0, 118);
        assert_eq!(zeros.stuffed, 118 / 5);
    }
}
