//! Rows by key: those of one sender, type or device together, as it is asked of every batch.
#![forbid(unsafe_code)]

/// Distinct keys that are told apart by looking them up; more are sorted.
const FEW: usize = 1 << 10;
/// Slots of the table that they are looked up in.
const SLOTS: usize = 4 * FEW;
/// Looks of a row in the mean: keys that were made to meet in one place are sorted, too.
const LOOKS: usize = 4;
const DIGIT: u32 = 11;

/// A key as a number; none is negative.
pub trait Key: Copy + Ord {
    fn number(self) -> u64;
}

impl Key for u32 {
    fn number(self) -> u64 {
        u64::from(self)
    }
}

impl Key for i64 {
    fn number(self) -> u64 {
        self as u64
    }
}

/// The rows in the order of their keys, those of one key in order, and where in that each key begins.
pub fn grouped<K: Key>(keys: &[K]) -> (Vec<i64>, Vec<i64>) {
    counted(keys).unwrap_or_else(|| sorted(keys))
}

/// Counts the rows of each key, and puts every row into its place; None if there are too many keys for that.
fn counted<K: Key>(keys: &[K]) -> Option<(Vec<i64>, Vec<i64>)> {
    let mut slots = vec![u16::MAX; SLOTS];
    let mut known: Vec<(K, u32)> = Vec::with_capacity(64);
    let mut which: Vec<u16> = Vec::with_capacity(keys.len());
    let mut looks = LOOKS * (keys.len() + FEW);
    let mut last = None;
    for &key in keys {
        let place = match last {
            Some((before, place)) if before == key => place,
            _ => find(&mut slots, &mut known, key, &mut looks)?,
        };
        last = Some((key, place));
        known[usize::from(place)].1 += 1;
        which.push(place);
    }
    let mut ranks: Vec<u16> = (0..known.len() as u16).collect();
    ranks.sort_unstable_by_key(|&place| known[usize::from(place)].0);
    let mut begins = Vec::with_capacity(known.len());
    let mut next = vec![0_u32; known.len()];
    let mut total = 0;
    for place in ranks.into_iter().map(usize::from) {
        begins.push(i64::from(total));
        next[place] = total;
        total += known[place].1;
    }
    let mut order = vec![0_i64; keys.len()];
    for (row, place) in (0..).zip(which) {
        let next = &mut next[usize::from(place)];
        order[*next as usize] = row;
        *next += 1;
    }
    Some((order, begins))
}

/// The place of a key among those that are known, to which it is added; None if they are too many, or looked for too long.
fn find<K: Key>(slots: &mut [u16], known: &mut Vec<(K, u32)>, key: K, looks: &mut usize) -> Option<u16> {
    const SPREAD: u64 = 0x9E37_79B9_7F4A_7C15;
    let mut slot = (key.number().wrapping_mul(SPREAD) >> (64 - SLOTS.ilog2())) as usize;
    loop {
        *looks = looks.checked_sub(1)?;
        let place = slots[slot];
        if place == u16::MAX {
            if known.len() == FEW {
                return None;
            }
            slots[slot] = known.len() as u16;
            known.push((key, 0));
            return Some(slots[slot]);
        }
        if known[usize::from(place)].0 == key {
            return Some(place);
        }
        slot = (slot + 1) % SLOTS;
    }
}

/// Sorts the rows by some bits of their keys at a time, lowest first.
fn sorted<K: Key>(keys: &[K]) -> (Vec<i64>, Vec<i64>) {
    let first = keys.first().map_or(0, |key| key.number());
    let differ = keys.iter().fold(0, |bits, key| bits | (key.number() ^ first));
    let mut order: Vec<i64> = (0..keys.len() as i64).collect();
    let mut other = vec![0; keys.len()];
    for shift in (0..u64::BITS).step_by(DIGIT as usize) {
        let digit = |row: i64| (keys[row as usize].number() >> shift) as usize & ((1 << DIGIT) - 1);
        if differ >> shift & ((1 << DIGIT) - 1) == 0 {
            continue;
        }
        let mut next = [0_usize; 1 << DIGIT];
        for &row in &order {
            next[digit(row)] += 1;
        }
        let mut total = 0;
        for place in &mut next {
            total += std::mem::replace(place, total);
        }
        for &row in &order {
            let next = &mut next[digit(row)];
            other[*next] = row;
            *next += 1;
        }
        std::mem::swap(&mut order, &mut other);
    }
    let key = |at: usize| keys[order[at] as usize].number();
    let begins = (0..order.len()).filter(|&at| at == 0 || key(at) != key(at - 1));
    let begins = begins.map(|at| at as i64).collect();
    (order, begins)
}

#[cfg(test)]
mod tests {
    use super::{counted, grouped, sorted, Key, FEW};

    /// The same by comparing.
    fn plain<K: Key>(keys: &[K]) -> (Vec<i64>, Vec<i64>) {
        let mut order: Vec<i64> = (0..keys.len() as i64).collect();
        order.sort_by_key(|&row| keys[row as usize]);
        let key = |at: usize| keys[order[at] as usize];
        let begins = (0..order.len()).filter(|&at| at == 0 || key(at) != key(at - 1));
        let begins = begins.map(|at| at as i64).collect();
        (order, begins)
    }

    fn noise(count: usize) -> impl Iterator<Item = u64> {
        let step = |&one: &u64| Some(one.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1));
        std::iter::successors(Some(7), step).map(|one| one >> 20).take(count)
    }

    #[test]
    fn rows_of_one_key_stand_together_in_their_order() {
        let keys = [5_u32, 3, 5, 5, 3, 9];
        assert_eq!(grouped(&keys), (vec![1, 4, 0, 2, 3, 5], vec![0, 2, 5]));
        assert_eq!(grouped::<i64>(&[]), (vec![], vec![]));
    }

    #[test]
    fn both_ways_give_what_comparing_gives() {
        for most in [1, 3, 40, FEW as u64] {
            let keys: Vec<i64> = noise(5000)
                .map(|one| (((one % most) << 40) | (one % 7)) as i64)
                .collect();
            let few: Vec<i64> = keys.iter().map(|key| key >> 40).collect();
            assert_eq!(counted(&few), Some(plain(&few)));
            for keys in [few, keys] {
                assert_eq!(sorted(&keys), plain(&keys));
                assert_eq!(grouped(&keys), plain(&keys));
            }
        }
    }

    #[test]
    fn many_keys_are_sorted() {
        let keys: Vec<u32> = noise(3 * FEW).map(|one| one as u32).collect();
        assert_eq!(counted(&keys), None);
        assert_eq!(grouped(&keys), plain(&keys));
    }

    #[test]
    fn keys_that_meet_in_one_place_are_not_looked_for_without_end() {
        let back = 0xF1DE_83E1_9937_733D_u64; // the multiplier's inverse: these keys begin in one slot
        let meet: Vec<i64> = (0..FEW as u64)
            .map(|k| (k.wrapping_mul(back) & (u64::MAX >> 1)) as i64)
            .collect();
        let keys: Vec<i64> = meet.iter().rev().chain(&meet).copied().cycle().take(64 * FEW).collect();
        assert_eq!(counted(&keys), None);
        assert_eq!(grouped(&keys), plain(&keys));
    }
}
