//! Counters that start again at 0 behind their largest value, continued.
#![forbid(unsafe_code)]

use std::collections::{BTreeMap, HashMap};

use crate::seeded::Seeded;

/// One field of `bits` bits of many senders: what each last showed, and how far it has wrapped.
///
/// A value that is lower than the one before it by more than half of the range has wrapped. Any other lower one is a
/// restart: the counter goes on from the value itself, without the wraps so far.
#[derive(Clone, Debug, Default)]
pub struct Unwrapper {
    last: HashMap<u32, State, Seeded>,
}

/// The raw value, and the sum of the wraps before it.
type State = (u64, u64);

impl Unwrapper {
    /// Counters remembered; one above that number is not, from one call to the next.
    pub const MAX_COUNTERS: usize = 65_536;

    /// Raw values, in the order sent, continued; `counters` tell whose each is.
    pub fn follow(&mut self, bits: u32, counters: &[u32], raw: &[u64]) -> Vec<u64> {
        let range = 1 << bits.min(63);
        // In the order in which they are remembered.
        let mut new: BTreeMap<u32, State> = BTreeMap::new();
        let mut next = |(counter, &value): (&u32, &u64)| {
            let state = match self.last.get_mut(counter) {
                Some(state) => state,
                None => new.entry(*counter).or_insert((value, 0)),
            };
            let drop = state.0.saturating_sub(value);
            if drop > range / 2 {
                state.1 += range;
            } else if drop > 0 {
                state.1 = 0;
            }
            state.0 = value;
            value.wrapping_add(state.1)
        };
        let out = counters.iter().zip(raw).map(&mut next).collect();
        let room = Self::MAX_COUNTERS.saturating_sub(self.last.len());
        self.last.extend(new.into_iter().take(room));
        out
    }
}
