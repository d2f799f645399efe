//! Frames that are equal but for their tail bytes: told by one number each, and whether they came before.
#![forbid(unsafe_code)]

use std::collections::HashMap;

use crate::seeded::{Seeded, MIX};

const WORD: usize = 8;
const ID: u8 = 31;
/// Bits of a key that leave few frames but those that are equal, to as many as are asked about: most of them, and how
/// many places of the sieve each of these gets. More take memory, with fewer too many other frames come through.
const SIEVE: u32 = 20;
const SPARSE: usize = 64;

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
            let mut at = ends[0] as usize;
            for part in body.chunks(WORD) {
                key = mixed(key, self.word(at, part));
                at += WORD;
            }
            keys.push(key);
            tails.push(tail);
        }
        Some(Identities { keys, tails })
    }

    /// The number of up to eight bytes that are `at` a place: behind it there are mostly as many more.
    fn word(&self, at: usize, part: &[u8]) -> u64 {
        if let Some(whole) = self.data.get(at..at + WORD) {
            let wide = u64::from_le_bytes(whole.try_into().unwrap_or_default());
            return wide & u64::MAX >> (8 * (WORD - part.len()));
        }
        let mut word = [0; WORD];
        word[..part.len()].copy_from_slice(part);
        u64::from_le_bytes(word)
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
    let mut past = Past::of(asked.iter().flatten());
    let mut order: Vec<(u32, usize)> = vec![];
    for (k, frame) in asked.iter().enumerate() {
        if let Some(frame) = frame {
            sieve[place_of(frame.key)] = true;
            order.push((frame.place, k));
        }
    }
    order.sort_unstable();
    let mut next = order.into_iter().peekable();
    let mut found = vec![Kind::New; places.len()];
    let mut first = 0;
    for batch in batches {
        for (place, (&key, &tail)) in (first..).zip(batch.keys.iter().zip(&batch.tails)) {
            if sieve[place_of(key)] {
                let frame = Frame { place, key, tail };
                while let Some((_, k)) = next.next_if(|&(asked, _)| asked == place) {
                    found[k] = past.kind(&frame, limits);
                }
                past.add(&frame);
            }
        }
        first += batch.keys.len() as u32;
    }
    found
}

/// In place of a link of the past.
const NONE: u32 = u32::MAX;

/// A frame, and the link of the one before it that has the same key.
struct Link {
    place: u32,
    tail: i16,
    before: u32,
}

/// The frames so far that are like those that are asked about: the latest link of each key, and the last two places of
/// each key with a tail byte, [`NONE`] at first.
struct Past {
    links: Vec<Link>,
    alike: HashMap<u64, u32, Seeded>,
    equal: HashMap<u64, [u32; 2], Seeded>,
}

impl Past {
    fn of<'a>(asked: impl Iterator<Item = &'a Frame>) -> Self {
        let seeded = Seeded::new();
        let (mut alike, mut equal) = (HashMap::with_hasher(seeded), HashMap::with_hasher(seeded));
        for frame in asked {
            alike.insert(frame.key, NONE);
            equal.insert(frame.whole(), [NONE; 2]);
        }
        Past {
            links: vec![],
            alike,
            equal,
        }
    }

    fn add(&mut self, frame: &Frame) {
        let Some(latest) = self.alike.get_mut(&frame.key) else {
            return;
        };
        self.links.push(Link {
            place: frame.place,
            tail: frame.tail,
            before: *latest,
        });
        *latest = self.links.len() as u32 - 1;
        if let Some(last) = self.equal.get_mut(&frame.whole()) {
            *last = [frame.place, last[0]];
        }
    }

    /// What the next frame is.
    fn kind(&self, frame: &Frame, limits: Limits) -> Kind {
        let low = frame.place.saturating_sub(limits.look);
        let near = |place: u32| place != NONE && place >= low;
        let [last, before] = self.equal.get(&frame.whole()).copied().unwrap_or([NONE; 2]);
        if !near(last) {
            return Kind::New;
        }
        let latest = self.alike.get(&frame.key).copied().unwrap_or(NONE);
        let links = std::iter::successors(self.links.get(latest as usize), |one| {
            self.links.get(one.before as usize)
        });
        let others = links.take_while(|one| one.place >= low).take(limits.few + 1);
        let others: Vec<i16> = others.map(|one| one.tail).collect();
        if near(before) || others.len() > limits.few || !in_a_row(&others) {
            Kind::Seen
        } else {
            Kind::Once
        }
    }
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

/// Whether the transfer IDs of frames with these tail bytes are different, and follow each other.
fn in_a_row(tails: &[i16]) -> bool {
    let ids = tails.iter().fold(0, |ids, &tail| ids | 1_u32 << (tail as u8 & ID));
    let breaks = ids & !ids.rotate_right(1);
    ids.count_ones() as usize == tails.len() && breaks.count_ones() <= 1
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
        let frames: [(u8, u32, &[u8]); 10] = [
            (0, 5, b"abcdefg\xc0"),
            (0, 5, b"abcdefg\xc1"),
            (1, 5, b"abcdefg\xc0"),
            (0, 6, b"abcdefg\xc0"),
            (0, 5, b"abcdefh\xc0"),
            (0, 5, b"abcdefg\0\xc0"),
            (0, 5, b"\xc0"),
            (0, 5, b""),
            (0, 5, b"abcdefghi\xc0"),
            (0, 5, b"abcdefghi\xc3"), // the last word has nothing behind it
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
        assert_eq!(tails, [0xC0, 0xC1, 0xC0, 0xC0, 0xC0, 0xC0, 0xC0, -1, 0xC0, 0xC3]);
        assert_eq!((keys[0], keys[8]), (keys[1], keys[9]));
        keys.sort_unstable();
        keys.dedup();
        assert_eq!(keys.len(), 8);
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
        let apart = batch(
            &[&[7][..], &[9; 9], &[7, 7]].concat(),
            &[&[1][..], &[5; 9], &[1, 1]].concat(),
        );
        assert_eq!(
            kinds(&[&apart], &[11, 10], LIMITS),
            [Kind::Once; 2],
            "one of two too long ago, in any order"
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
