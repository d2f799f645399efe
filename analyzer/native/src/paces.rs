//! Reports of many senders, each at a steady pace of its own or not, and where they break.
#![forbid(unsafe_code)]
#![allow(clippy::cast_precision_loss)] // times in ns, which are told in parts of periods

mod period;

use period::period;

/// Periods that say what is usual.
const MEMORY: usize = 15;
/// Reports that are kept, between which they are.
const KEPT: usize = MEMORY + 1;
/// At a steady pace a break is longer than so many times what this many of the last periods, and one, do not exceed.
const FAR: f64 = 3.0;
const COMMON: usize = 8;

/// When a report came, and how many of its sender were lost up to it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Report {
    pub t: i64,
    pub lost: i64,
}

/// What is a break: a time that is longer than `least` in ns, and than so many periods.
///
/// So many reports at the `fewest` show a period, and they go on for a `span` in ns. Another pace may be off by `alike`
/// times; a time longer than the `slowest`, in ns, is no pace before it is seen twice.
#[derive(Clone, Copy, Debug)]
pub struct Limits {
    pub least: i64,
    pub periods: f64,
    pub fewest: usize,
    pub span: i64,
    pub alike: f64,
    pub slowest: i64,
}

/// A time without reports of a sender that had a period, between two of them.
///
/// `at` is the place of the report before it among the new ones, -1 for one before them. `kept` says that nothing was
/// lost, `lowered` that the sender only reports less often from then on; None: not known yet.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Break {
    pub start: i64,
    pub stop: i64,
    pub period: f64,
    pub at: i64,
    pub kept: bool,
    pub lowered: Option<bool>,
}

impl Break {
    fn took(&self) -> i64 {
        self.stop.wrapping_sub(self.start)
    }
}

impl Limits {
    /// What a break exceeds, in ns.
    fn longest(&self, period: f64) -> f64 {
        (self.least as f64).max(self.periods * period)
    }
}

/// What is known of a sender.
#[derive(Clone, Debug, Default)]
struct Sender {
    /// The first report since the last break.
    first: Option<i64>,
    /// The period before the pace changed last.
    usual: f64,
    /// The last reports since then, at most `KEPT`.
    kept: Vec<Report>,
    /// The time of the last report.
    last: i64,
    open: Option<Break>,
}

/// The reports of many senders: one is known once reports of it are fed.
#[derive(Clone, Debug)]
pub struct Paces {
    limits: Limits,
    senders: Vec<Sender>,
    /// Room for the reports of one.
    reports: Vec<Report>,
}

impl Paces {
    pub fn new(limits: Limits) -> Self {
        Paces {
            limits,
            senders: vec![],
            reports: vec![],
        }
    }

    /// The time of the last report of each.
    pub fn last(&self) -> impl Iterator<Item = i64> + '_ {
        self.senders.iter().map(|one| one.last)
    }

    /// Takes the new reports of a sender, and appends its breaks to those that were found.
    ///
    /// Whether the pace only changed behind the last break that was found before, if that is known now.
    pub fn feed(&mut self, sender: usize, new: &[Report], found: &mut Vec<Break>) -> Option<bool> {
        let (Some(&begun), Some(&last)) = (new.first(), new.last()) else {
            return None;
        };
        if sender >= self.senders.len() {
            self.senders.resize_with(sender + 1, Sender::default);
        }
        let one = &mut self.senders[sender];
        one.first.get_or_insert(begun.t);
        let settled = one
            .kept
            .last()
            .copied()
            .and_then(|before| one.settle(self.limits.alike, [before, begun]));
        let old = one.kept.len();
        self.reports.clear();
        self.reports.append(&mut one.kept);
        self.reports.extend_from_slice(new);
        let since = one.breaks(&self.limits, &self.reports, old, found);
        let kept = since.max(self.reports.len().saturating_sub(KEPT));
        one.kept.extend_from_slice(&self.reports[kept..]);
        one.last = last.t;
        settled
    }

    /// What lasts until a time of each sender, if that is a break: with the sender, in order.
    pub fn silences(&self, until: &[i64]) -> Vec<(usize, Break)> {
        let each = self.senders.iter().zip(until).enumerate();
        let silent = each.filter_map(|(k, (one, &now))| Some((k, one.silent(&self.limits, now)?)));
        silent.collect()
    }
}

impl Sender {
    /// Whether the pace only changed, by two reports behind a break that is not settled.
    fn settle(&mut self, may_be_off: f64, [first, second]: [Report; 2]) -> Option<bool> {
        let open = self.open.take()?;
        let (took, after) = (open.took(), may_be_off * second.t.wrapping_sub(first.t) as f64);
        let alike = took <= after.floor() as i64 && after <= may_be_off * may_be_off * took as f64;
        let lowered = open.kept && second.lost == first.lost && alike;
        if lowered {
            self.usual = took as f64;
        }
        Some(lowered)
    }

    /// Appends the breaks behind `old` reports; where those begin that are not in front of one.
    fn breaks(&mut self, limits: &Limits, reports: &[Report], old: usize, found: &mut Vec<Break>) -> usize {
        let mut begin = 0;
        for row in old.saturating_sub(1)..reports.len() - 1 {
            let (here, next) = (reports[row], reports[row + 1]);
            if next.t.wrapping_sub(here.t) <= limits.least {
                continue;
            }
            let usual = self.usual(limits, reports, begin, row);
            let latest = here.t.max(reports[row.saturating_sub(1)].t); // one may be stamped too early
            if usual == 0.0 || next.t.wrapping_sub(latest) as f64 <= limits.longest(usual) {
                continue;
            }
            let mut one = Break {
                start: here.t,
                stop: next.t,
                period: usual,
                at: (row as i64 - old as i64).max(-1),
                kept: next.lost == here.lost,
                lowered: None,
            };
            (self.first, self.usual, self.open) = (Some(one.stop), usual, Some(one));
            if let Some(&behind) = reports.get(row + 2) {
                one.lowered = self.settle(limits.alike, [next, behind]);
            }
            found.push(one);
            begin = row + 1;
        }
        begin
    }

    /// The period up to a report, of those from `begin` on, 0.0 without one.
    ///
    /// While they are few it is that from before the break; none if many go before a time behind it that is `short`.
    fn usual(&self, limits: &Limits, reports: &[Report], begin: usize, row: usize) -> f64 {
        if self
            .first
            .is_none_or(|first| reports[row].t.wrapping_sub(first) < limits.span)
        {
            self.usual
        } else if row - begin >= MEMORY && is_short(&reports[row - MEMORY..]) {
            0.0
        } else if row - begin + 1 >= limits.fewest {
            period(&reports[begin..=row], limits.fewest)
        } else {
            self.usual
        }
    }

    /// The break that lasts until now, if there is one.
    fn silent(&self, limits: &Limits, now: i64) -> Option<Break> {
        let last = *self.kept.last()?;
        if now.wrapping_sub(last.t) <= limits.least {
            return None;
        }
        let lasted = self
            .first
            .is_some_and(|first| last.t.wrapping_sub(first) >= limits.span);
        let enough = lasted && self.kept.len() >= limits.fewest;
        let period = if enough {
            period(&self.kept, limits.fewest)
        } else {
            self.usual
        };
        let slower = self.open.filter(|open| open.kept).map_or(0, |open| open.took());
        let longest = if slower <= limits.slowest {
            period.max(slower as f64)
        } else {
            period
        };
        (period != 0.0 && now.wrapping_sub(last.t) as f64 > limits.longest(longest)).then_some(Break {
            start: last.t,
            stop: now,
            period,
            at: -1,
            kept: false,
            lowered: Some(false),
        })
    }
}

/// Whether the time behind the first `MEMORY` periods of some reports is too short to be a break at a steady pace: that
/// what `COMMON` periods and one do not exceed is at least a part of it. Most are, so nothing is put in order.
fn is_short(reports: &[Report]) -> bool {
    let took = reports[MEMORY + 1].t.wrapping_sub(reports[MEMORY].t) as f64;
    let far = |pair: &&[Report]| {
        let lost = pair[1].lost.wrapping_sub(pair[0].lost) as f64;
        took > FAR * (pair[1].t.wrapping_sub(pair[0].t) as f64 / (1.0 + lost)) // from one to the next, lost or not
    };
    reports[..=MEMORY].windows(2).filter(far).count() <= COMMON
}

#[cfg(test)]
mod tests;
