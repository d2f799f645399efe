//! How many senders lack frames at the same time: where stretches in which frames are missing meet, or follow each
//! other closely.
#![forbid(unsafe_code)]

pub mod known;
pub mod lacks;

/// Senders that are told apart.
const NODES: usize = 256;

/// Stretches, each between two frames of a session: times, places on the bus, how far apart joint ones are at most.
#[derive(Debug)]
pub struct Stretches<'a> {
    pub since: &'a [i64],
    pub until: &'a [i64],
    pub first: &'a [i64],
    pub last: &'a [i64],
    pub window: &'a [i64],
    pub node: &'a [u8],
}

/// What joint ones are: at most so many frames apart, or so far in time.
#[derive(Clone, Copy, Debug)]
pub struct Near {
    pub apart: i64,
    pub nearby: i64,
}

/// Of a stretch: how many senders lack frames there, since when and until when.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Joint {
    pub senders: u32,
    pub since: i64,
    pub until: i64,
}

/// How many stretches of each sender are looked at.
struct Senders {
    counts: [u32; NODES],
    several: u32,
}

impl Senders {
    fn new() -> Self {
        Senders {
            counts: [0; NODES],
            several: 0,
        }
    }

    fn add(&mut self, node: u8) {
        let count = &mut self.counts[usize::from(node)];
        *count += 1;
        self.several += u32::from(*count == 1);
    }

    fn remove(&mut self, node: u8) {
        let count = &mut self.counts[usize::from(node)];
        *count -= 1;
        self.several -= u32::from(*count == 0);
    }
}

impl Stretches<'_> {
    fn len(&self) -> usize {
        self.since.len()
    }

    fn fit(&self) -> bool {
        [self.until, self.first, self.last, self.window]
            .iter()
            .all(|column| column.len() == self.len())
            && self.node.len() == self.len()
    }

    /// Each with what it is joint with; those that are narrow come first, as they lie on the bus, then as they end.
    ///
    /// None if the columns do not fit together.
    pub fn joint(&self, near: Near) -> Option<Vec<(usize, Joint)>> {
        if !self.fit() {
            return None;
        }
        let mut found = vec![None; self.len()];
        let mut order = Vec::with_capacity(self.len());
        for (k, senders) in self.close(near.apart) {
            let (since, until) = (self.since[k], self.until[k]);
            found[k] = Some(Joint { senders, since, until });
            order.push(k);
        }
        for (k, met) in self.met(near.nearby) {
            match &mut found[k] {
                Some(close) if met.senders < close.senders => {}
                Some(close) => *close = met,
                none => {
                    *none = Some(met);
                    order.push(k);
                }
            }
        }
        order.into_iter().map(|k| Some((k, found[k]?))).collect()
    }

    /// How many senders lack frames close to each narrow one: without a longer pause between, within a time.
    fn close(&self, apart: i64) -> Vec<(usize, u32)> {
        let narrow = |&k: &usize| self.until[k].wrapping_sub(self.since[k]) <= self.window[k];
        let mut order: Vec<usize> = (0..self.len()).filter(narrow).collect();
        order.sort_by_key(|&k| (self.first[k], self.last[k]));
        let mut found = Vec::with_capacity(order.len());
        let (mut begin, mut behind) = (0, 0);
        for at in 0..order.len() {
            let k = order[at];
            if at > begin && self.first[k].wrapping_sub(behind) > apart {
                self.within(&mut order[begin..at], &mut found);
                begin = at;
            }
            behind = if at > begin {
                behind.max(self.last[k])
            } else {
                self.last[k]
            };
        }
        self.within(&mut order[begin..], &mut found);
        found
    }

    fn within(&self, row: &mut [usize], found: &mut Vec<(usize, u32)>) {
        row.sort_by_key(|&k| self.until[k]);
        let mut senders = Senders::new();
        let (mut first, mut last) = (0, 0);
        for &k in row.iter() {
            let (early, late) = (
                self.until[k].saturating_sub(self.window[k]),
                self.until[k].saturating_add(self.window[k]),
            );
            while last < row.len() && self.until[row[last]] <= late {
                senders.add(self.node[row[last]]);
                last += 1;
            }
            while first < last && self.until[row[first]] < early {
                senders.remove(self.node[row[first]]);
                first += 1;
            }
            found.push((k, senders.several));
        }
    }

    /// At how many senders' stretches each meets most, and the time that these have in common with it.
    fn met(&self, nearby: i64) -> Vec<(usize, Joint)> {
        let begins = (0..self.len()).map(|k| (self.since[k].saturating_sub(nearby), false, k));
        let ends = (0..self.len()).map(|k| (self.until[k].saturating_add(nearby), true, k));
        let mut marks: Vec<(i64, bool, usize)> = begins.chain(ends).collect();
        marks.sort_unstable();
        let mut begun: Vec<usize> = vec![]; // in order; those that ended are taken off where they are last
        let mut ended = vec![false; self.len()];
        let mut peaks: Vec<(usize, Joint)> = vec![]; // by place; those that no later one is as high as
        let mut before = vec![0; self.len()]; // peaks before each began
        let mut senders = Senders::new();
        let mut found = Vec::with_capacity(self.len());
        let (mut count, mut fresh) = (0, false);
        for (_, ends, k) in marks {
            if !ends {
                begun.push(k);
                before[k] = count;
                senders.add(self.node[k]);
                fresh = true;
                continue;
            }
            if fresh {
                // No more meet here than just before the first of them ends.
                fresh = false;
                while begun.last().is_some_and(|&last| ended[last]) {
                    begun.pop();
                }
                while peaks.last().is_some_and(|(_, peak)| peak.senders < senders.several) {
                    peaks.pop();
                }
                let since = begun.last().map_or(self.since[k], |&last| self.since[last]);
                let peak = Joint {
                    senders: senders.several,
                    since: since.min(self.until[k]),
                    until: since.max(self.until[k]),
                };
                peaks.push((count, peak));
                count += 1;
            }
            let at = peaks.partition_point(|&(place, _)| place < before[k]);
            if let Some(&(_, peak)) = peaks.get(at) {
                let since = peak.since.max(self.since[k]).min(self.until[k]);
                let until = peak.until.min(self.until[k]).max(self.since[k]);
                let senders = peak.senders;
                found.push((k, Joint { senders, since, until }));
            }
            senders.remove(self.node[k]);
            ended[k] = true;
        }
        found
    }
}
