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

/// One of several batches: its place in all of them, and what [`Identities`] say of it.
#[derive(Clone, Copy, Debug)]
struct Frame {
    place: u32,
    key: u64,
    tail: i16,
}

impl Frame {
    /// A number for all of it.
    fn whole(&self) -> u64 {
        mixed(self.key, u64::from(self.tail as u16))
    }
}

type Places = HashMap<u64, Vec<Frame>, Seeded>;

/// Frames in columns; `offsets` says where the data field of each begins in `data`, one more than there are frames.
#[derive(Debug)]
pub struct Columns<'a> {
    pub bus: &'a [u8],
    pub id: &'a [u32],
    pub offsets: &'a [i32],
    pub data: &'a [u8],
}

/// A number for each frame of a batch, and its tail byte, -1 without one. Numbers are equal if interface, identifier, length
/// and the bytes before the tail are; other ones are equal once in 2^64 pairs.
#[derive(Debug, Default, PartialEq, Eq)]
pub struct Identities {
    pub keys: Vec<u64>,
    pub tails: Vec<i16>,
}

impl Columns<'_> {
    /// The frames by number; none if columns do not fit together.
    pub fn identities(&self) -> Option<Identities> {
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
        Some(Identities { keys, tails })
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

/// What the frames at some places are, counted through batches that follow each other. One that is in none of them, or has
/// no tail byte, is new.
pub fn kinds(batches: &[&Identities], places: &[i64], limits: Limits) -> Vec<Kind> {
    let asked: Vec<Option<Frame>> = places.iter().map(|&place| frame_at(batches, place)).collect();
    let bits = (places.len() * SPARSE + 2).ilog2().min(SIEVE);
    let place_of = |key: u64| (key >> (u64::BITS - bits)) as usize;
    let mut sieve = vec![false; 1 << bits];
    let seeded = Seeded::new();
    let (mut alike, mut equal) = (Places::with_hasher(seeded), Places::with_hasher(seeded));
    for frame in asked.iter().flatten() {
        sieve[place_of(frame.key)] = true;
        alike.entry(frame.key).or_default();
        equal.entry(frame.whole()).or_default();
    }
    let mut first = 0;
    for batch in batches {
        for (place, (&key, &tail)) in (first..).zip(batch.keys.iter().zip(&batch.tails)) {
            if sieve[place_of(key)] {
                if let Some(found) = alike.get_mut(&key) {
                    let frame = Frame { place, key, tail };
                    found.push(frame);
                    if let Some(found) = equal.get_mut(&frame.whole()) {
                        found.push(frame);
                    }
                }
            }
        }
        first += batch.keys.len() as u32;
    }
    let kind = |frame: &Frame| {
        let near = |all: &Vec<Frame>| {
            let low = all.partition_point(|one| one.place < frame.place.saturating_sub(limits.look));
            (low, all.partition_point(|one| one.place < frame.place))
        };
        let (low, high) = equal.get(&frame.whole()).map_or((0, 0), near);
        if low == high {
            return Kind::New;
        }
        let others = alike.get(&frame.key).map_or(&[][..], |all| {
            let (low, high) = near(all);
            &all[low..high]
        });
        let once = high - low == 1 && others.len() <= limits.few && in_a_row(others);
        if once {
            Kind::Once
        } else {
            Kind::Seen
        }
    };
    asked
        .iter()
        .map(|frame| frame.as_ref().map_or(Kind::New, kind))
        .collect()
}

/// The frame at a place, if it is there and has a tail byte.
fn frame_at(batches: &[&Identities], place: i64) -> Option<Frame> {
    let mut at = usize::try_from(place).ok()?;
    for batch in batches {
        if let (Some(&key), Some(&tail)) = (batch.keys.get(at), batch.tails.get(at)) {
            let place = place as u32;
            return (tail >= 0).then_some(Frame { place, key, tail });
        }
        at -= batch.keys.len();
    }
    None
}

/// Whether the transfer IDs of frames are different, and follow each other.
fn in_a_row(frames: &[Frame]) -> bool {
    let bit = |frame: &Frame| 1_u32 << (frame.tail as u8 & ID);
    let ids = frames.iter().fold(0, |ids, frame| ids | bit(frame));
    let breaks = ids & !ids.rotate_right(1);
    ids.count_ones() as usize == frames.len() && breaks.count_ones() <= 1
}

#[cfg(test)]
mod tests {
    use super::*;

    const LIMITS: Limits = Limits { look: 10, few: 3 };

    fn batch(keys: &[u64], tails: &[i16]) -> Identities {
        let (keys, tails) = (keys.to_vec(), tails.to_vec());
        Identities { keys, tails }
    }

    /// The same however the frames are cut into batches.
    fn kinds_of(tails: &[i16], places: &[i64]) -> Vec<Kind> {
        let cut = |size: usize| {
            let parts = tails.chunks(size).map(|part| batch(&vec![7; part.len()], part));
            let parts: Vec<Identities> = parts.collect();
            kinds(&parts.iter().collect::<Vec<_>>(), places, LIMITS)
        };
        assert_eq!(cut(1), cut(tails.len()));
        cut(2)
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
        let Identities { mut keys, tails } = columns.identities().unwrap();
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
        let other = batch(&[1, 2], &[1, 1]);
        assert_eq!(kinds(&[&other], &[1], LIMITS), [Kind::New], "another key");
        assert_eq!(
            kinds_of(&[1, 1], &[-1, 1, 2]),
            [Kind::New, Kind::Once, Kind::New],
            "not there"
        );
        assert_eq!(kinds_of(&[-1, -1], &[1]), [Kind::New], "no tail byte");
    }
}
