//! Hashes of numbers for tables that are asked for very many: faster than those of the standard library, and other ones
//! each time, so that no capture can be made to slow a table down.
#![forbid(unsafe_code)]

use std::collections::hash_map::RandomState;
use std::hash::{BuildHasher, Hasher};

pub const MIX: u64 = 0x9E37_79B9_7F4A_7C15;

/// A hash of one number: in another way each time.
#[derive(Clone, Copy, Debug)]
pub struct Seeded(u64);

impl Seeded {
    pub fn new() -> Self {
        Seeded(RandomState::new().build_hasher().finish())
    }
}

impl Default for Seeded {
    fn default() -> Self {
        Seeded::new()
    }
}

impl BuildHasher for Seeded {
    type Hasher = Self;

    fn build_hasher(&self) -> Self {
        *self
    }
}

impl Hasher for Seeded {
    fn finish(&self) -> u64 {
        // Tables go by the lowest and the highest bits: each depends on all of them.
        let all = (self.0 ^ self.0 >> 32).wrapping_mul(MIX);
        all ^ all >> 32
    }

    fn write_u64(&mut self, number: u64) {
        let wide = u128::from(number ^ MIX) * u128::from(self.0 | 1);
        self.0 = wide as u64 ^ (wide >> u64::BITS) as u64;
    }

    fn write_u16(&mut self, number: u16) {
        self.write_u64(number.into());
    }

    fn write_u32(&mut self, number: u32) {
        self.write_u64(number.into());
    }

    fn write_usize(&mut self, number: usize) {
        self.write_u64(number as u64);
    }

    fn write_i64(&mut self, number: i64) {
        self.write_u64(number as u64);
    }

    fn write(&mut self, bytes: &[u8]) {
        for &byte in bytes {
            self.write_u64(byte.into());
        }
    }
}

#[cfg(test)]
mod tests {
    use super::Seeded;
    use std::collections::HashSet;
    use std::hash::BuildHasher;

    #[test]
    fn equal_numbers_hash_alike_and_others_apart() {
        let seeded = Seeded::new();
        let hashes: HashSet<u64> = (-5000_i64..5000).map(|number| seeded.hash_one(number << 17)).collect();
        assert!(hashes.len() >= 9_999);
        assert_eq!(seeded.hash_one(7_i64), seeded.hash_one(7_u64));
        assert_ne!(Seeded::new().hash_one(7_u64), seeded.hash_one(7_u64));
    }

    #[test]
    fn regular_numbers_spread_over_a_table() {
        for seed in (0..500_u64).map(|k| k.wrapping_mul(0xD129_0B26_28C5_74B1)) {
            for shift in [0, 7, 8, 16, 24, 32, 40, 48] {
                let hashes = (0..2048_u64).map(|k| Seeded(seed).hash_one(k << shift));
                let places: HashSet<u64> = hashes.map(|hash| hash & 4095).collect();
                assert!(places.len() > 900, "{seed:#x} {shift} {}", places.len());
            }
        }
    }
}
