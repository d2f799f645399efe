//! What the starts of a session show: whether several senders count in it.
#![forbid(unsafe_code)]

use super::interleaved::{Chain, Interleaved};
use super::resumed::{GoesOn, Resumed};
use super::starts::{OddStart, Starts};
use crate::frames::NO_TIME;
use crate::slot::TIMEOUT_NS;

/// Since when frames have come without a gap: the first time of the capture, and the ends of all gaps.
#[derive(Clone, Copy, Debug)]
pub struct Gaps<'a> {
    pub start: i64,
    pub ends: &'a [i64],
}

impl Gaps<'_> {
    /// The end of the last gap before a time. A clock that is set back leaves ends that are not quite in order.
    fn resumed(&self, t: i64) -> i64 {
        let (mut low, mut high) = (0, self.ends.len());
        while low < high {
            let middle = usize::midpoint(low, high);
            if t < self.ends[middle] {
                high = middle;
            } else {
                low = middle + 1;
            }
        }
        low.checked_sub(1).map_or(self.start, |at| self.ends[at])
    }

    /// Whether a silence, or a gap of the capture, explains a start.
    pub fn explain(&self, one: &OddStart) -> bool {
        let timed = one.t != NO_TIME && one.since != NO_TIME;
        timed && (one.t.saturating_sub(one.since) > TIMEOUT_NS || one.since < self.resumed(one.t))
    }
}

/// Follows the counters of a session; several senders show once two of them sent `least` transfers.
#[derive(Clone, Debug)]
pub struct Counters {
    pub starts: Starts,
    interleaved: Interleaved,
    resumed: Resumed,
    least: u32,
}

impl Counters {
    /// Begins behind an ID.
    pub fn new(starts: Starts, before: u8, least: u32) -> Self {
        Counters {
            starts,
            interleaved: Interleaved::default(),
            resumed: Resumed::new(before),
            least,
        }
    }

    /// Adds a start that no gap explains; returns whether one of several senders took over with it.
    pub fn add(&mut self, one: &OddStart) -> bool {
        let took_over = self.interleaved.add(one);
        self.resumed.add(one) || took_over
    }

    /// The next start up to a frame with which several senders show, and whether one of them took over with it.
    pub fn shows(&mut self, number: u64, gaps: Gaps<'_>) -> Option<(OddStart, bool)> {
        while let Some(one) = self.starts.pop(number) {
            let counts = !gaps.explain(&one);
            let took_over = counts && self.add(&one);
            if counts && self.several() {
                return Some((one, took_over));
            }
        }
        None
    }

    fn several(&self) -> bool {
        !self.chains().is_empty() || self.goes_on().is_some()
    }

    /// The counters that take turns.
    pub fn chains(&self) -> Vec<Chain> {
        self.interleaved.counters(self.least.into())
    }

    /// The counter that goes on behind what others send.
    pub fn goes_on(&self) -> Option<GoesOn> {
        self.resumed.goes_on(self.least as usize)
    }
}

#[cfg(test)]
mod tests {
    use super::super::starts::Latest;
    use super::*;

    const SECOND: i64 = 1_000_000_000;

    fn counters(least: u32) -> Counters {
        let latest = Latest {
            tail: 0xC0,
            ended: true,
            ..Latest::default()
        };
        Counters::new(Starts::new(0, 0, latest), 0, least)
    }

    /// The odd starts among transfers with these IDs, a tenth of a second apart.
    fn odd(ids: &[u8]) -> Vec<OddStart> {
        let steps = (0_i64..).zip(ids.windows(2));
        let starts = steps.map(|(at, pair)| OddStart {
            number: at as u64,
            t: (at + 1) * SECOND / 10,
            before: pair[0],
            id: pair[1],
            since: at * SECOND / 10,
            again: false,
        });
        starts.filter(|one| one.id != (one.before + 1) & 31).collect()
    }

    #[test]
    fn two_senders_by_turns_have_two_counters() {
        let mut both = counters(5);
        let ids: Vec<u8> = (0..12).flat_map(|n| [n, 20 + n]).map(|id| id & 31).collect();
        for one in odd(&ids) {
            both.add(&one);
        }
        let found: Vec<u8> = both.chains().iter().map(|chain| chain.last).collect();
        assert_eq!(found, [11, 31]);
        assert!(both.chains().iter().all(|chain| chain.turns > 5));
    }

    #[test]
    fn losses_leave_one_counter() {
        let mut one = counters(5);
        let ids: Vec<u8> = (0..60_u8).map(|n| (n + n / 4) & 31).collect();
        for start in odd(&ids) {
            one.add(&start);
        }
        assert!(one.chains().is_empty() && one.goes_on().is_none());
    }

    #[test]
    fn a_counter_goes_on_behind_one_that_stands_still() {
        let mut both = counters(5);
        let ids: Vec<u8> = (1..20_u8).flat_map(|n| [n, 25]).collect();
        for one in odd(&ids) {
            both.add(&one);
        }
        let found = both.goes_on().unwrap();
        assert_eq!((found.last, found.other), (19, Some(25)));
    }

    #[test]
    fn a_counter_may_go_on_since_the_first_of_all_times() {
        let mut both = counters(5);
        let ids: Vec<u8> = (1..20_u8).flat_map(|n| [n, 25]).collect();
        for mut one in odd(&ids) {
            one.since = NO_TIME + 1;
            both.add(&one);
        }
        assert_eq!(both.goes_on().map(|found| found.since), Some(NO_TIME));
    }

    #[test]
    fn nothing_counts_across_a_silence_or_a_gap() {
        let gaps = Gaps {
            start: 0,
            ends: &[5 * SECOND],
        };
        let start = |since, t| OddStart {
            number: 1,
            t,
            before: 1,
            id: 7,
            since,
            again: false,
        };
        assert!(gaps.explain(&start(4 * SECOND, 5 * SECOND)));
        assert!(gaps.explain(&start(6 * SECOND, 9 * SECOND)));
        assert!(!gaps.explain(&start(5 * SECOND, 6 * SECOND)));
        assert!(!gaps.explain(&start(NO_TIME, 6 * SECOND)));
        let always = Gaps {
            start: NO_TIME,
            ends: &[],
        };
        assert!(always.explain(&start(-1, i64::MAX)), "as far apart as times can be");
        assert_eq!((gaps.resumed(4), gaps.resumed(5 * SECOND)), (0, 5 * SECOND));
    }
}
