//! What came first of each key, as long as there is room for it.
#![forbid(unsafe_code)]

use std::collections::HashMap;

use crate::seeded::Seeded;

/// A time, and the number of a frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct First {
    pub t: i64,
    pub number: i64,
}

/// The first one of each key; further keys than `most` are left out.
#[derive(Clone, Debug)]
pub struct Firsts {
    known: HashMap<i64, First, Seeded>,
    most: usize,
}

impl Firsts {
    pub fn new(most: usize) -> Self {
        Firsts {
            known: HashMap::default(),
            most,
        }
    }

    /// Whether a key is new, and has its first one now.
    pub fn add(&mut self, key: i64, first: First) -> bool {
        let new = self.known.len() < self.most && !self.known.contains_key(&key);
        if new {
            self.known.insert(key, first);
        }
        new
    }

    pub fn find(&self, key: i64) -> Option<First> {
        self.known.get(&key).copied()
    }

    pub fn has(&self, key: i64) -> bool {
        self.known.contains_key(&key)
    }
}

#[cfg(test)]
mod tests {
    use super::{First, Firsts};

    #[test]
    fn the_first_of_each_key_stays() {
        let mut firsts = Firsts::new(2);
        let first = |t| First { t, number: 10 * t };
        assert!(firsts.add(7, first(1)));
        assert!(!firsts.add(7, first(2)));
        assert!(firsts.add(8, first(3)));
        assert!(!firsts.add(9, first(4)), "there is no room");
        assert_eq!(
            [7, 8, 9].map(|key| firsts.find(key)),
            [Some(first(1)), Some(first(3)), None]
        );
        assert_eq!([7, 8, 9].map(|key| firsts.has(key)), [true, true, false]);
    }
}
