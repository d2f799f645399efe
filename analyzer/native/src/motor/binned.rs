//! Numbers and sums of each kind by slot of time and bin, where there are any: noise names many ESCs, and hardly any of
//! them reports twice.
#![forbid(unsafe_code)]

/// Stretches of time; when they are full, two become one.
pub const SLOTS: usize = 128;
/// Bins of the command, or of the logarithm of the speed.
pub const BINS: usize = 40;
/// Kinds of sums by bins: speed by command and volt, speed by command, power by speed, current by speed.
pub const KINDS: usize = 4;
type Bins = [f64; BINS];
/// Numbers, and sums.
type Page = [Bins; 2];

/// A page for each slot of the first kind, then of the next, none before its first number.
#[derive(Debug)]
pub struct Binned(Vec<Option<Box<Page>>>);

impl Default for Binned {
    fn default() -> Self {
        Binned(vec![None; KINDS * SLOTS])
    }
}

impl Binned {
    pub(super) fn add(&mut self, kind: usize, slot: usize, bin: usize, value: f64) {
        let page = self.0[kind * SLOTS + slot].get_or_insert_with(|| Box::new([[0.0; BINS]; 2]));
        page[0][bin] += 1.0;
        page[1][bin] += value;
    }

    /// Numbers, for each slot of the first kind, then of the next.
    pub fn count(&self) -> Vec<Bins> {
        self.all(0)
    }

    /// The sums of what these count.
    pub fn total(&self) -> Vec<Bins> {
        self.all(1)
    }

    fn all(&self, which: usize) -> Vec<Bins> {
        let bins = |page: &Option<Box<Page>>| page.as_ref().map_or([0.0; BINS], |page| page[which]);
        self.0.iter().map(bins).collect()
    }

    /// Makes one slot of two.
    pub(super) fn halve(&mut self) {
        for pages in self.0.chunks_mut(SLOTS) {
            for slot in 0..SLOTS {
                pages[slot] = match 2 * slot {
                    even if even < SLOTS => both(pages[even].take(), pages[even + 1].take()),
                    _ => None,
                };
            }
        }
    }
}

fn both(one: Option<Box<Page>>, other: Option<Box<Page>>) -> Option<Box<Page>> {
    let (mut sum, more) = match (one, other) {
        (Some(one), Some(other)) => (one, other),
        (one, other) => return one.or(other),
    };
    for (cell, more) in sum.as_flattened_mut().iter_mut().zip(more.as_flattened()) {
        *cell += more;
    }
    Some(sum)
}
