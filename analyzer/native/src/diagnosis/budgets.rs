//! How many causes are searched of each sender, and which ones were found: what it does again and again is told like
//! that.
#![forbid(unsafe_code)]

use std::collections::HashMap;

use crate::seeded::Seeded;

/// Searches that each sender has left.
#[derive(Clone, Debug)]
pub struct Budget {
    spent: HashMap<i64, u32, Seeded>,
    searches: u32,
    senders: usize,
}

impl Budget {
    /// Of each sender `searches` may be made; so many `senders` are counted, further ones have none.
    pub fn new(searches: u32, senders: usize) -> Self {
        Budget {
            spent: HashMap::default(),
            searches,
            senders,
        }
    }

    pub fn left(&self, sender: i64) -> u32 {
        match self.spent.get(&sender) {
            Some(&spent) => self.searches.saturating_sub(spent),
            None if self.spent.len() < self.senders => self.searches,
            None => 0,
        }
    }

    /// Notes a search, whether or not any is left.
    pub fn spend(&mut self, sender: i64) {
        *self.spent.entry(sender).or_default() += 1;
    }

    /// For which of these, in their order, a search may be made as things stand: senders that are new do not count.
    pub fn allows(&self, senders: &[i64]) -> Vec<u8> {
        let mut asked: HashMap<i64, u32, Seeded> = HashMap::default();
        let allowed = senders.iter().map(|&sender| {
            let left = asked.entry(sender).or_insert_with(|| self.left(sender));
            let one = u8::from(*left > 0);
            *left = left.saturating_sub(1);
            one
        });
        allowed.collect()
    }

    /// For which of these, in their order, a search may be made; these searches are noted.
    pub fn take(&mut self, senders: &[i64]) -> Vec<u8> {
        let allowed = senders.iter().map(|&sender| {
            let left = self.left(sender) > 0;
            if left {
                self.spend(sender);
            }
            u8::from(left)
        });
        allowed.collect()
    }
}

/// A cause, and of how many transfers of a shape it was; None counts all shapes.
#[derive(Clone, Copy, Debug)]
struct Found {
    shape: Option<i64>,
    cause: u32,
    count: u32,
}

/// What was found of a sender, and how many shapes are kept apart.
#[derive(Clone, Debug, Default)]
struct Known {
    counts: Vec<Found>,
    apart: usize,
}

/// The causes that were found for each sender, by the shape of its transfers.
#[derive(Clone, Debug)]
pub struct Causes {
    known: HashMap<i64, Known, Seeded>,
    senders: usize,
    shapes: usize,
}

impl Causes {
    /// So many `senders` are known at most, and of each so many `shapes` are kept apart.
    pub fn new(senders: usize, shapes: usize) -> Self {
        Causes {
            known: HashMap::default(),
            senders,
            shapes,
        }
    }

    /// Notes one more that was found.
    pub fn note(&mut self, sender: i64, shape: i64, cause: u32) {
        if self.known.len() >= self.senders && !self.known.contains_key(&sender) {
            return;
        }
        let Known { counts, apart } = self.known.entry(sender).or_default();
        add(counts, None, cause);
        let new = !counts.iter().any(|one| one.shape == Some(shape));
        if !new || *apart < self.shapes {
            *apart += usize::from(new);
            add(counts, Some(shape), cause);
        }
    }

    /// The cause of at least such a part of all that had this shape, or else of all of its sender.
    pub fn like(&self, sender: i64, shape: i64, part: f64) -> Option<u32> {
        let Known { counts, .. } = self.known.get(&sender)?;
        let of = Some(shape).filter(|_| counts.iter().any(|one| one.shape == Some(shape)));
        let own = || counts.iter().filter(|one| one.shape == of);
        let all: f64 = own().map(|one| f64::from(one.count)).sum();
        let most = own().max_by_key(|one| one.count)?;
        (f64::from(most.count) >= part * all).then_some(most.cause)
    }
}

fn add(counts: &mut Vec<Found>, shape: Option<i64>, cause: u32) {
    match counts.iter_mut().find(|one| (one.shape, one.cause) == (shape, cause)) {
        Some(one) => one.count = one.count.saturating_add(1),
        None => counts.push(Found { shape, cause, count: 1 }),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn searches_are_counted_in_order() {
        let mut budget = Budget::new(3, 2);
        let senders = [7, 8, 7, 7, 7, 8, 9];
        assert_eq!(budget.allows(&senders), [1, 1, 1, 1, 0, 1, 1]);
        assert_eq!(budget.take(&senders), [1, 1, 1, 1, 0, 1, 0], "too many senders");
        assert_eq!(budget.take(&senders), [0, 1, 0, 0, 0, 0, 0]);
        assert_eq!([budget.left(7), budget.left(8), budget.left(9)], [0, 0, 0]);
    }

    #[test]
    fn what_was_found_of_a_shape_holds_for_it() {
        let mut causes = Causes::new(2, 2);
        let like = |causes: &Causes, shape| causes.like(1, shape, 0.9);
        assert_eq!(like(&causes, 3), None);
        (0..20).for_each(|_| causes.note(1, 3, 5));
        assert_eq!(like(&causes, 3), Some(5));
        assert_eq!(like(&causes, 4), Some(5), "of a shape that was never seen");
        (0..3).for_each(|_| causes.note(1, 4, 6));
        assert_eq!(like(&causes, 4), Some(6));
        assert_eq!(like(&causes, 9), None, "20 of 23 are too few");
        (0..40).for_each(|_| causes.note(1, 9, 5));
        assert_eq!(
            like(&causes, 9),
            Some(5),
            "as with all: there is no room for another shape"
        );
        assert_eq!(
            causes.known[&1]
                .counts
                .iter()
                .filter(|one| one.shape == Some(9))
                .count(),
            0
        );
        (2..9).for_each(|sender| causes.note(sender, 3, 5));
        assert_eq!(causes.known.len(), 2);
    }
}
