//! Frames of one bus that two captures hold: the second sight of a frame is told from a frame that was sent again.
#![forbid(unsafe_code)]

use std::collections::{HashMap, VecDeque};
use std::hash::{DefaultHasher, Hash, Hasher};

use crate::frames::{RX, TX};

/// Two clocks may differ by this much from one frame to the next; equal DroneCAN frames are further apart.
const TOLERANCE: i64 = 20_000_000;
/// How far two clocks may drift apart during a capture.
const FAR: i64 = 500_000_000;
/// A bound, should times stand still.
const MOST: usize = 1 << 20;

#[derive(Default)]
pub(super) struct Overlaps {
    /// The capture that recorded a bus first, and whether another one did, too.
    owners: HashMap<u8, (usize, bool)>,
    recent: HashMap<u64, Twins>,
    order: VecDeque<(i64, u64)>,
    /// Times of the second capture minus those of the first one, as last seen.
    skew: HashMap<(usize, usize), i64>,
}

/// Frames of one content: times, and the captures that showed them first.
#[derive(Default)]
struct Twins {
    seen: VecDeque<(i64, usize)>,
    /// Frames forgotten in front of `seen`.
    gone: usize,
    /// By capture, the number of the first frame that it may still show again: what lies before is matched, its own, or
    /// too long ago.
    open: Vec<(usize, usize)>,
}

impl Overlaps {
    /// Capture `input` has an interface on this bus.
    pub(super) fn recorded(&mut self, bus: u8, input: usize) {
        let owner = self.owners.entry(bus).or_insert((input, false));
        owner.1 |= owner.0 != input;
    }

    /// Whether another capture of the bus has shown this frame (identifier, flags, data) already.
    pub(super) fn repeats(&mut self, bus: u8, input: usize, t: i64, frame: (u32, u16, &[u8])) -> bool {
        if !self.owners.get(&bus).is_some_and(|owner| owner.1) {
            return false;
        }
        self.forget(t);
        let key = content(bus, frame);
        let twins = self.recent.entry(key).or_default();
        if twins.shown_again(input, t, &mut self.skew) {
            return true;
        }
        twins.seen.push_back((t, input));
        self.order.push_back((t, key));
        false
    }

    fn forget(&mut self, now: i64) {
        while let Some(&(t, key)) = self.order.front() {
            if now.saturating_sub(t) <= FAR + TOLERANCE && self.order.len() < MOST {
                return;
            }
            self.order.pop_front();
            if let Some(twins) = self.recent.get_mut(&key) {
                twins.seen.pop_front();
                twins.gone += 1;
                if twins.seen.is_empty() {
                    self.recent.remove(&key);
                }
            }
        }
    }
}

impl Twins {
    /// Whether a frame of `input` is one of these; each of them is looked at once for each capture.
    fn shown_again(&mut self, input: usize, t: i64, skew: &mut HashMap<(usize, usize), i64>) -> bool {
        let at = self.open.iter().position(|(of, _)| *of == input).unwrap_or_else(|| {
            self.open.push((input, 0));
            self.open.len() - 1
        });
        let open = &mut self.open[at].1;
        *open = (*open).max(self.gone);
        while let Some(&(earlier, owner)) = self.seen.get(*open - self.gone) {
            let skew = skew.entry((owner, input)).or_insert(0);
            let off = t.saturating_sub(earlier).saturating_sub(*skew);
            if owner != input && off < -TOLERANCE {
                return false;
            }
            *open += 1;
            if owner != input && off <= TOLERANCE {
                *skew = (*skew + off / 16).clamp(-FAR, FAR);
                return true;
            }
        }
        false
    }
}

/// What makes two records the same frame; the direction is that of the recorder.
pub(super) fn content(bus: u8, (id, flags, data): (u32, u16, &[u8])) -> u64 {
    let mut hasher = DefaultHasher::new();
    (bus, id, flags & !(RX | TX), data).hash(&mut hasher);
    hasher.finish()
}
