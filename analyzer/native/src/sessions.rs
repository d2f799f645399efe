//! Finds the session of a frame: an open-addressing table that a hostile capture cannot slow down.
#![forbid(unsafe_code)]

use std::collections::hash_map::RandomState;
use std::hash::{BuildHasher, Hasher};

/// Sessions beyond this many are not followed; their frames are foreign and marked.
pub const MAX_SESSIONS: usize = 65_536;

const EMPTY: u64 = u64::MAX;

/// Keys to positions; keys are never removed.
pub struct Index {
    slots: Vec<(u64, u32)>,
    used: u32,
    seed: u64,
}

impl Default for Index {
    fn default() -> Self {
        Index {
            slots: vec![(EMPTY, 0); 256],
            used: 0,
            seed: RandomState::new().build_hasher().finish(),
        }
    }
}

impl Index {
    /// The position of `key` (below `u64::MAX`).
    #[inline]
    pub fn find(&self, key: u64) -> Option<usize> {
        let mask = self.slots.len() - 1;
        let mut at = self.home(key);
        loop {
            let (there, position) = self.slots[at & mask];
            if there == key {
                return Some(position as usize);
            }
            if there == EMPTY {
                return None;
            }
            at += 1;
        }
    }

    /// Gives a new `key` the next position; none when the table may not grow.
    pub fn insert(&mut self, key: u64) -> Option<usize> {
        if self.used as usize >= MAX_SESSIONS {
            return None;
        }
        if self.used as usize * 2 >= self.slots.len() {
            let larger = vec![(EMPTY, 0); self.slots.len() * 2];
            let old = std::mem::replace(&mut self.slots, larger);
            for (key, position) in old.into_iter().filter(|&(key, _)| key != EMPTY) {
                self.put(key, position);
            }
        }
        let position = self.used;
        self.used += 1;
        self.put(key, position);
        Some(position as usize)
    }

    fn put(&mut self, key: u64, position: u32) {
        let mask = self.slots.len() - 1;
        let mut at = self.home(key) & mask;
        while self.slots[at].0 != EMPTY {
            at = (at + 1) & mask;
        }
        self.slots[at] = (key, position);
    }

    #[inline]
    fn home(&self, key: u64) -> usize {
        let mixed = (key ^ self.seed).wrapping_mul(0x9E37_79B9_7F4A_7C15);
        ((mixed ^ (mixed >> 29)).wrapping_mul(0xBF58_476D_1CE4_E5B9) >> 32) as usize
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_key_keeps_its_position_and_the_table_is_bounded() {
        let mut index = Index::default();
        for key in 0..MAX_SESSIONS as u64 {
            assert_eq!(index.find(key << 7), None);
            assert_eq!(index.insert(key << 7), Some(key as usize));
        }
        assert!((0..MAX_SESSIONS as u64).all(|key| index.find(key << 7) == Some(key as usize)));
        assert_eq!(index.insert(1), None);
    }
}
