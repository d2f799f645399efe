//! When nodes were not heard: the latest gaps of each.
#![forbid(unsafe_code)]

use std::collections::VecDeque;

/// The node in an identifier, and in the number of a node, which has the bus above it.
const NODE: u32 = 0x7F;
const NODES: usize = 128;

/// A time without a frame of a node, in ns, and the number of the frame before it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Gap {
    pub start: i64,
    pub stop: i64,
    pub number: i64,
}

impl Gap {
    fn took(&self) -> i64 {
        self.stop.saturating_sub(self.start)
    }
}

/// Frames of a batch by column; of identifiers that are a node's, flags have the bits `wanted` out of `asked`.
#[derive(Debug)]
pub struct Frames<'a> {
    pub t: &'a [i64],
    pub bus: &'a [u8],
    pub id: &'a [u32],
    pub flags: &'a [u16],
    pub first: i64,
    pub asked: u16,
    pub wanted: u16,
    pub no_time: i64,
}

/// The last frame of a node, and whether it was told that it is silent.
#[derive(Clone, Copy, Debug)]
struct Last {
    t: i64,
    number: i64,
    told: bool,
}

#[derive(Clone, Debug, Default)]
struct Node {
    last: Option<Last>,
    gaps: VecDeque<Gap>,
    told_gap: bool, // the last silence that was told has become a gap
}

/// Follows the frames of nodes by bus and node: times without one that are no longer than `least` are no gaps.
///
/// Of a node it knows the last `most` gaps.
#[derive(Clone, Debug)]
pub struct Nodes {
    least: i64,
    most: usize,
    known: Vec<Node>,
}

impl Nodes {
    pub fn new(least: i64, most: usize) -> Self {
        Nodes {
            least,
            most,
            known: vec![],
        }
    }

    /// Takes the frames of a batch; false if the columns do not fit together.
    pub fn feed(&mut self, frames: &Frames<'_>) -> bool {
        let rows = frames.t.len();
        if [frames.bus.len(), frames.id.len(), frames.flags.len()] != [rows; 3] {
            return false;
        }
        let buses = frames.bus.iter().max().map_or(0, |&bus| usize::from(bus) + 1);
        if buses * NODES > self.known.len() {
            self.known.resize_with(buses * NODES, Node::default);
        }
        for row in 0..rows {
            let (t, node) = (frames.t[row], frames.id[row] & NODE);
            if node == 0 || frames.flags[row] & frames.asked != frames.wanted || t == frames.no_time {
                continue;
            }
            let one = &mut self.known[usize::from(frames.bus[row]) * NODES + node as usize];
            one.pause(t, self.least, self.most);
            one.last = Some(Last {
                t,
                number: frames.first + row as i64,
                told: false,
            });
        }
        true
    }

    /// Notes what is silent up to the end of its bus.
    pub fn finish(&mut self, bus: usize, end: i64) {
        for one in self.known.iter_mut().skip(bus * NODES).take(NODES) {
            one.pause(end, self.least, self.most);
        }
    }

    /// Nodes whose last frame is before a number, each once for a silence: with that frame, and whether the silence that
    /// was told of the node before this one has become a gap.
    pub fn fell_silent(&mut self, number: i64) -> Vec<(i64, i64, bool)> {
        let mut found = vec![];
        for (node, one) in self.known.iter_mut().enumerate() {
            if let Some(last) = one.last.as_mut().filter(|last| !last.told && last.number < number) {
                last.told = true;
                found.push((node as i64, last.number, std::mem::take(&mut one.told_gap)));
            }
        }
        found
    }

    /// The number of the oldest frame that is still needed to tell of a node.
    pub fn oldest(&self, node: i64) -> Option<i64> {
        let one = self.node(node)?;
        let last = one.last.map(|last| last.number);
        one.gaps.front().map_or(last, |gap| Some(gap.number))
    }

    /// The gaps of a node between two times.
    pub fn between(&self, node: i64, start: i64, stop: i64) -> impl Iterator<Item = Gap> + '_ {
        let gaps = self.node(node).into_iter().flat_map(|one| &one.gaps).copied();
        gaps.filter(move |gap| gap.start >= start && gap.stop <= stop)
    }

    /// The longest gap of a node between two times, the first one of several.
    pub fn longest(&self, node: i64, start: i64, stop: i64) -> Option<Gap> {
        self.between(node, start, stop)
            .reduce(|longest, gap| if gap.took() > longest.took() { gap } else { longest })
    }

    /// Whether a node that was heard lies in a gap at a time; `end` is the last time so far.
    pub fn is_silent(&self, node: i64, t: i64, end: i64) -> bool {
        self.node(node).is_some_and(|one| {
            let ended = |last: Last| last.t <= t && end.saturating_sub(last.t) > self.least;
            one.last.is_some_and(ended) || one.gaps.iter().any(|gap| gap.start <= t && t < gap.stop)
        })
    }

    fn node(&self, node: i64) -> Option<&Node> {
        self.known.get(usize::try_from(node).ok()?)
    }
}

impl Node {
    /// Notes a gap in front of a time, if there is one.
    fn pause(&mut self, stop: i64, least: i64, most: usize) {
        let Some(before) = self.last.filter(|before| stop.saturating_sub(before.t) > least) else {
            return;
        };
        if self.gaps.len() >= most {
            self.gaps.pop_front();
        }
        self.told_gap |= before.told;
        self.gaps.push_back(Gap {
            start: before.t,
            stop,
            number: before.number,
        });
    }
}

#[cfg(test)]
mod tests {
    use super::{Frames, Gap, Nodes};

    fn feed(nodes: &mut Nodes, first: i64, rows: &[(i64, u8, u32, u16)]) -> bool {
        let t: Vec<i64> = rows.iter().map(|one| one.0).collect();
        let bus: Vec<u8> = rows.iter().map(|one| one.1).collect();
        let id: Vec<u32> = rows.iter().map(|one| one.2).collect();
        let flags: Vec<u16> = rows.iter().map(|one| one.3).collect();
        let (t, bus, id, flags) = (&t[..], &bus[..], &id[..], &flags[..]);
        let (asked, wanted, no_time) = (3, 1, i64::MIN);
        nodes.feed(&Frames {
            t,
            bus,
            id,
            flags,
            first,
            asked,
            wanted,
            no_time,
        })
    }

    fn gaps(nodes: &Nodes, node: i64) -> Vec<(i64, i64, i64)> {
        let all = nodes.between(node, 0, 1000);
        all.map(|Gap { start, stop, number }| (start, stop, number)).collect()
    }

    #[test]
    fn gaps_are_longer_than_the_least_and_between_frames_of_a_node() {
        let mut nodes = Nodes::new(5, 8);
        assert!(feed(
            &mut nodes,
            10,
            &[(0, 0, 0xF01, 1), (3, 0, 0x02, 1), (5, 0, 0x01, 1), (11, 1, 0x01, 1)]
        ));
        assert!(feed(&mut nodes, 14, &[(20, 0, 0x01, 1), (26, 0, 0x01, 1)]));
        assert_eq!(gaps(&nodes, 1), [(5, 20, 12), (20, 26, 14)]);
        assert!(gaps(&nodes, 2).is_empty() && gaps(&nodes, 129).is_empty() && gaps(&nodes, 9999).is_empty());
        nodes.finish(0, 30);
        assert_eq!(gaps(&nodes, 2), [(3, 30, 11)]);
        assert_eq!(gaps(&nodes, 1).len(), 2, "heard 4 before the end");
    }

    #[test]
    fn what_is_no_node_s_does_not_count() {
        let mut nodes = Nodes::new(5, 8);
        let rows = [
            (0, 0, 1, 1),
            (10, 0, 1, 3),
            (10, 0, 1, 0),
            (i64::MIN, 0, 1, 1),
            (10, 0, 0x80, 1),
            (20, 0, 1, 1),
        ];
        assert!(feed(&mut nodes, 0, &rows));
        assert_eq!(gaps(&nodes, 1), [(0, 20, 0)]);
        let none = Frames {
            t: &[0],
            bus: &[],
            id: &[],
            flags: &[],
            first: 0,
            asked: 0,
            wanted: 0,
            no_time: 0,
        };
        assert!(!nodes.feed(&none));
    }

    #[test]
    fn the_longest_gap_and_the_silent_times() {
        let mut nodes = Nodes::new(5, 2);
        assert!(feed(
            &mut nodes,
            0,
            &[(0, 0, 1, 1), (50, 0, 1, 1), (60, 0, 1, 1), (70, 0, 1, 1)]
        ));
        assert_eq!(gaps(&nodes, 1), [(50, 60, 1), (60, 70, 2)], "the oldest is gone");
        assert_eq!(nodes.longest(1, 0, 100).map(|gap| gap.start), Some(50));
        assert_eq!(nodes.longest(1, 51, 100).map(|gap| gap.start), Some(60));
        assert_eq!(nodes.longest(1, 51, 69), None);
        let silent = |t, end| nodes.is_silent(1, t, end);
        assert_eq!(
            [silent(49, 75), silent(50, 75), silent(70, 75), silent(70, 76)],
            [false, true, false, true]
        );
        assert!(!nodes.is_silent(2, 0, 100));
    }

    #[test]
    fn a_silence_is_told_once() {
        let mut nodes = Nodes::new(5, 2);
        assert!(feed(&mut nodes, 0, &[(0, 0, 1, 1), (0, 0, 2, 1)]));
        assert!(feed(&mut nodes, 2, &[(20, 0, 1, 1)]));
        assert_eq!(nodes.fell_silent(2), [(2, 1, false)]);
        assert!(nodes.fell_silent(2).is_empty());
        assert_eq!(
            (nodes.oldest(1), nodes.oldest(2), nodes.oldest(3)),
            (Some(0), Some(1), None)
        );
        assert!(feed(&mut nodes, 3, &[(30, 0, 2, 1)]));
        assert_eq!(
            nodes.fell_silent(4),
            [(1, 2, false), (2, 3, true)],
            "the first of 2 is a gap"
        );
        assert!(feed(&mut nodes, 4, &[(24, 0, 1, 1), (34, 0, 2, 1)]));
        assert_eq!(nodes.fell_silent(6), [(1, 4, false), (2, 5, false)], "both went on");
    }

    #[test]
    fn times_as_far_apart_as_can_be_are_a_gap() {
        let mut nodes = Nodes::new(5, 2);
        assert!(feed(&mut nodes, 0, &[(i64::MIN + 1, 0, 1, 1)]));
        assert!(nodes.is_silent(1, 0, i64::MAX));
        nodes.finish(0, i64::MAX);
        assert_eq!(
            nodes.longest(1, i64::MIN, i64::MAX).map(|gap| gap.took()),
            Some(i64::MAX)
        );
    }
}
