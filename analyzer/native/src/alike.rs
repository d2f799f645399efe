//! Frames that are equal but for their tail bytes: told by one number each, and whether they came before.
#![forbid(unsafe_code)]

use std::collections::hash_map::{HashMap, RandomState};
use std::hash::{BuildHasher, Hasher};

const MIX: u64 = 0x9E37_79B9_7F4A_7C15;
const WORD: usize = 8;
const ID: u8 = 31;
/// Bits of a key that leave few frames but those that are equal, to as many as are asked about: most of them, and how
/// many places of the sieve each of these gets. More take memory, with fewer too many other frames come through.
const SIEVE: u32 = 20;
const SPARSE: usize = 64;

/// Places numbers that are mixed already: in another way each time, so that no capture can be made to slow it down.
#[derive(Clone, Copy)]
struct Seeded(u64);

impl Seeded {
    fn new() -> Self {
        Seeded(RandomState::new().build_hasher().finish())
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
        self.0
    }

    fn write_u64(&mut self, number: u64) {
        let wide = u128::from(number ^ MIX) * u128::from(self.0 | 1);
        self.0 = wide as u64 ^ (wide >> u64::BITS) as u64;
    }

    fn write(&mut self, bytes: &[u8]) {
        for &byte in bytes {
            self.write_u64(byte.into());
        }
    }
}

type Places = HashMap<u64, Vec<u32>, Seeded>;

/// Frames in columns; `offsets` says where the data field of each begins in `data`, one more than there are frames.
#[derive(Debug)]
pub struct Columns<'a> {
    pub bus: &'a [u8],
    pub id: &'a [u32],
    pub offsets: &'a [i32],
    pub data: &'a [u8],
}

impl Columns<'_> {
    /// A number for each frame, and its tail byte, -1 without one. Numbers are equal if interface, identifier, length and
    /// the bytes before the tail are; other ones are equal once in 2^64 pairs. None if columns do not fit together.
    pub fn identities(&self) -> Option<(Vec<u64>, Vec<i16>)> {
        if self.bus.len() != self.id.len() || self.offsets.len() != self.id.len() + 1 {
            return None;
        }
        let (mut keys, mut tails) = (Vec::with_capacity(self.id.len()), Vec::with_capacity(self.id.len()));
        for (k, ends) in self.offsets.windows(2).enumerate() {
            let field = self.data.get(ends[0] as usize..ends[1] as usize)?;
            let whose = u64::from(self.bus[k]) << 32 | u64::from(self.id[k]);
            let mut key = mixed(whose, field.len() as u64);
            let (tail, body) = field
                .split_last()
                .map_or((-1, field), |(&tail, body)| (i16::from(tail), body));
            for part in body.chunks(WORD) {
                let mut word = [0; WORD];
                word[..part.len()].copy_from_slice(part);
                key = mixed(key, u64::from_le_bytes(word));
            }
            keys.push(key);
            tails.push(tail);
        }
        Some((keys, tails))
    }
}

/// A number that depends on both, however alike these are.
fn mixed(key: u64, more: u64) -> u64 {
    let mut mixed = (key ^ more).wrapping_mul(MIX);
    mixed ^= mixed >> 32;
    mixed = mixed.wrapping_mul(MIX);
    mixed ^ mixed >> 29
}

/// What a frame is by those before it that are equal but for the tail byte.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub enum Kind {
    /// None has its tail byte.
    New,
    /// Some have.
    Seen,
    /// One has, of few whose transfer IDs follow each other.
    Once,
}

/// How many frames before one are looked at, and how many are few.
#[derive(Clone, Copy, Debug)]
pub struct Limits {
    pub look: u32,
    pub few: usize,
}

/// What the frames at some places are; None if there are no such places.
pub fn kinds(keys: &[u64], tails: &[i16], places: &[u32], limits: Limits) -> Option<Vec<Kind>> {
    let bits = (places.len() * SPARSE + 2).ilog2().min(SIEVE);
    let place_of = |key: u64| (key >> (u64::BITS - bits)) as usize;
    let mut sieve = vec![false; 1 << bits];
    let seeded = Seeded::new();
    let (mut alike, mut equal) = (Places::with_hasher(seeded), Places::with_hasher(seeded));
    let with = |key, tail: i16| mixed(key, u64::from(tail as u16));
    for &place in places {
        let (&key, &tail) = (keys.get(place as usize)?, tails.get(place as usize)?);
        sieve[place_of(key)] = true;
        alike.entry(key).or_default();
        equal.entry(with(key, tail)).or_default();
    }
    for (place, (&key, &tail)) in (0..).zip(keys.iter().zip(tails)) {
        if sieve[place_of(key)] {
            if let Some(found) = alike.get_mut(&key) {
                found.push(place);
                if let Some(found) = equal.get_mut(&with(key, tail)) {
                    found.push(place);
                }
            }
        }
    }
    let kind = |&place: &u32| {
        let (key, tail) = (keys[place as usize], tails[place as usize]);
        let near = |all: &Vec<u32>| {
            let low = all.partition_point(|&one| one < place.saturating_sub(limits.look));
            (low, all.partition_point(|&one| one < place))
        };
        let (low, high) = equal.get(&with(key, tail)).map_or((0, 0), near);
        if low == high {
            return Kind::New;
        }
        let others = alike.get(&key).map_or(&[][..], |all| {
            let (low, high) = near(all);
            &all[low..high]
        });
        let once = high - low == 1 && others.len() <= limits.few && in_a_row(others, tails);
        if once {
            Kind::Once
        } else {
            Kind::Seen
        }
    };
    Some(places.iter().map(kind).collect())
}

/// Whether the transfer IDs of frames are different, and follow each other.
fn in_a_row(places: &[u32], tails: &[i16]) -> bool {
    let bit = |&place: &u32| 1_u32 << (tails[place as usize] as u8 & ID);
    let ids = places.iter().fold(0, |ids, place| ids | bit(place));
    let breaks = ids & !ids.rotate_right(1);
    ids.count_ones() as usize == places.len() && breaks.count_ones() <= 1
}

#[cfg(test)]
mod tests {
    use super::*;

    const LIMITS: Limits = Limits { look: 10, few: 3 };

    fn kinds_of(tails: &[i16], places: &[u32]) -> Vec<Kind> {
        kinds(&vec![7; tails.len()], tails, places, LIMITS).unwrap()
    }

    #[test]
    fn numbers_tell_all_but_the_tail() {
        let frames: [(u8, u32, &[u8]); 8] = [
            (0, 5, b"abcdefg\xc0"),
            (0, 5, b"abcdefg\xc1"),
            (1, 5, b"abcdefg\xc0"),
            (0, 6, b"abcdefg\xc0"),
            (0, 5, b"abcdefh\xc0"),
            (0, 5, b"abcdefg\0\xc0"),
            (0, 5, b"\xc0"),
            (0, 5, b""),
        ];
        let data: Vec<u8> = frames.iter().flat_map(|one| one.2.iter().copied()).collect();
        let ends = frames.iter().scan(0, |end, one| {
            *end += one.2.len() as i32;
            Some(*end)
        });
        let columns = Columns {
            bus: &frames.map(|one| one.0),
            id: &frames.map(|one| one.1),
            offsets: &std::iter::once(0).chain(ends).collect::<Vec<_>>(),
            data: &data,
        };
        let (mut keys, tails) = columns.identities().unwrap();
        assert_eq!(tails, [0xC0, 0xC1, 0xC0, 0xC0, 0xC0, 0xC0, 0xC0, -1]);
        assert_eq!(keys[0], keys[1]);
        keys.sort_unstable();
        keys.dedup();
        assert_eq!(keys.len(), 7);
        assert_eq!(Columns { bus: &[0], ..columns }.identities(), None);
    }

    #[test]
    fn a_frame_is_new_or_seen_or_came_once() {
        assert_eq!(kinds_of(&[1, 2, 3, 1], &[0, 3]), [Kind::New, Kind::Once]);
        assert_eq!(kinds_of(&[1, 2, 1, 1], &[3]), [Kind::Seen], "twice before");
        assert_eq!(kinds_of(&[1, 3, 1], &[2]), [Kind::Seen], "others not in a row");
        assert_eq!(kinds_of(&[31, 0, 31], &[2]), [Kind::Once], "IDs come round");
        assert_eq!(kinds_of(&[1, 2, 3, 4, 1], &[4]), [Kind::Seen], "among more than few");
        assert_eq!(
            kinds_of(&[&[1][..], &[2; 10], &[1]].concat(), &[11]),
            [Kind::New],
            "too long ago"
        );
        assert_eq!(
            kinds(&[1, 2], &[1, 1], &[1], LIMITS),
            Some(vec![Kind::New]),
            "another key"
        );
        assert_eq!(kinds(&[1], &[1], &[1], LIMITS), None);
    }
}
