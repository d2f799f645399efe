//! Finds the session of a frame: an open-addressing table that a hostile capture cannot slow down.
#![forbid(unsafe_code)]

use std::collections::hash_map::RandomState;
use std::hash::{BuildHasher, Hasher};

/// Sessions beyond this many are not followed; their frames are foreign and marked.
pub const MAX_SESSIONS: usize = 65_536;

/// In place of a position.
const EMPTY: u32 = u32::MAX;

/// Keys to positions; keys are never removed.
pub struct Index {
    slots: Vec<(u32, u32)>,
    used: u32,
    seed: u64,
}

impl Default for Index {
    fn default() -> Self {
        Index {
            slots: vec![(0, EMPTY); 256],
            used: 0,
            seed: RandomState::new().build_hasher().finish(),
        }
    }
}

impl Index {
    /// The position of `key`.
    #[inline]
    pub fn find(&self, key: u32) -> Option<usize> {
        let mask = self.slots.len() - 1;
        let mut at = self.home(key);
        loop {
            let (there, position) = self.slots[at & mask];
            if there == key || position == EMPTY {
                return (position != EMPTY).then_some(position as usize);
            }
            at += 1;
        }
    }

    /// Gives a new `key` the next position; none when the table may not grow.
    pub fn insert(&mut self, key: u32) -> Option<usize> {
        if self.used as usize >= MAX_SESSIONS {
            return None;
        }
        if self.used as usize * 2 >= self.slots.len() {
            let larger = vec![(0, EMPTY); self.slots.len() * 2];
            let old = std::mem::replace(&mut self.slots, larger);
            for (key, position) in old.into_iter().filter(|&(_, position)| position != EMPTY) {
                self.put(key, position);
            }
        }
        let position = self.used;
        self.used += 1;
        self.put(key, position);
        Some(position as usize)
    }

    fn put(&mut self, key: u32, position: u32) {
        let mask = self.slots.len() - 1;
        let mut at = self.home(key) & mask;
        while self.slots[at].1 != EMPTY {
            at = (at + 1) & mask;
        }
        self.slots[at] = (key, position);
    }

    #[inline]
    fn home(&self, key: u32) -> usize {
        let mixed = (u64::from(key) ^ self.seed).wrapping_mul(0x9E37_79B9_7F4A_7C15);
        ((mixed ^ (mixed >> 29)).wrapping_mul(0xBF58_476D_1CE4_E5B9) >> 32) as usize
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_key_keeps_its_position_and_the_table_is_bounded() {
        let mut index = Index::default();
        for key in 0..MAX_SESSIONS as u32 {
            assert_eq!(index.find(key << 16), None);
            assert_eq!(index.insert(key << 16), Some(key as usize));
        }
        assert!((0..MAX_SESSIONS as u32).all(|key| index.find(key << 16) == Some(key as usize)));
        assert_eq!(index.insert(u32::MAX), None);
    }
}
