//! A motor against its own past: the reports of one ESC, in order, beside what it was commanded before each of them.
//!
//! What a report is compared with depends on the reports before it alone, however they come in pieces.
#![forbid(unsafe_code)]

mod orders;
mod past;
mod recent;
mod sums;

pub use orders::{ordered, Ordered, Orders};
use past::{Expected, Past, LAW};
use recent::Recent;
pub use sums::{SumLimits, Sums, Times, BINS, COUNTED, KINDS, MEASURED, NEVER, SLOTS};

/// A current as a share of what it was at that speed, between which a report is as it should be.
const GOOD: (f64, f64) = (0.85, 1.2);

/// The numbers that decide, as `thresholds.toml` names and explains them; commands in %, shares of what was before.
#[derive(Clone, Copy, Debug)]
pub struct Limits {
    pub learned: f64,
    pub steady_percent: f64,
    pub even_percent: f64,
    pub slow: f64,
    pub fast: f64,
    pub unloaded: f64,
    pub dragged: f64,
    pub worn: f64,
    pub many: u32,
    pub far: f64,
    pub least_a: f64,
    pub sag_begun: f64,
}

/// Reports of one ESC: speed without its sign in rpm, V, A, and what it says it is commanded, in %; NaN for none.
///
/// `commanded` is what it was commanded before each of them.
#[derive(Debug)]
pub struct Reports<'a> {
    pub speed: &'a [f64],
    pub volts: &'a [f64],
    pub current: &'a [f64],
    pub reported: &'a [f64],
    pub commanded: [&'a [f64]; 4],
}

impl Reports<'_> {
    fn fit(&self) -> bool {
        let long = self.speed.len();
        let columns = [self.volts, self.current, self.reported];
        columns.iter().chain(&self.commanded).all(|column| column.len() == long)
    }

    fn ordered(&self, row: usize) -> Ordered {
        let [lowest, highest, mean, last] = self.commanded.map(|column| column[row]);
        Ordered {
            lowest,
            highest,
            mean,
            last,
        }
    }
}

/// Reports beside their past, a row each: `off` are those that differ.
///
/// `before` is the row of the last good report before each, -1 for none of these, and `good` that of the last one;
/// shares of speed and current are of what they were at such a command, `reported` of what is commanded.
#[derive(Debug, Default, PartialEq)]
pub struct Compared {
    pub off: Vec<u8>,
    pub before: Vec<i64>,
    pub speed: Vec<f64>,
    pub current: Vec<f64>,
    pub reported: Vec<f64>,
    pub good: i64,
}

/// Follows one ESC.
#[derive(Debug)]
pub struct Watch {
    limits: Limits,
    past: Past,
    ratios: Recent,
    volts: Recent,
}

impl Watch {
    pub fn new(limits: Limits) -> Self {
        Watch {
            limits,
            past: Past::new(limits.learned),
            ratios: Recent::new(limits.many as usize, f64::NAN),
            volts: Recent::new(limits.many as usize, f64::NEG_INFINITY),
        }
    }

    /// Takes the next reports; None if columns do not fit together.
    pub fn feed(&mut self, reports: &Reports<'_>) -> Option<Compared> {
        if !reports.fit() {
            return None;
        }
        let mut found = Compared {
            good: -1,
            ..Compared::default()
        };
        for row in 0..reports.speed.len() {
            self.compare(reports, row, &reports.ordered(row), &mut found);
        }
        Some(found)
    }

    fn compare(&mut self, reports: &Reports<'_>, row: usize, ordered: &Ordered, found: &mut Compared) {
        let (speed, volts, current) = (reports.speed[row], reports.volts[row], reports.current[row]);
        let expected = self.past.expected(ordered.mean, volts);
        let (mut off, shares, ratio) = self.differing(speed, current, ordered, expected.as_ref());
        self.volts.push(volts);
        let steady_supply = volts >= self.volts.most() * (1.0 - self.limits.sag_begun);
        self.ratios.push(if steady_supply { ratio } else { f64::NAN });
        let good = ratio > GOOD.0 && ratio < GOOD.1;
        off |= self
            .ratios
            .sum()
            .is_some_and(|sum| sum < self.limits.worn * f64::from(self.limits.many));
        let steady = ordered.highest - ordered.lowest <= self.limits.steady_percent;
        let driven = ordered.lowest > self.limits.steady_percent && speed > 0.0;
        let calm = steady && driven && !off && current.is_finite() && (good || ratio.is_nan());
        self.past
            .add(calm.then_some([ordered.mean, speed / volts, current, volts]));
        found.before.push(found.good);
        if good && !off {
            found.good = row as i64;
        }
        found.off.push(u8::from(off));
        found.speed.push(shares.0);
        found.current.push(shares.1);
        found.reported.push(reports.reported[row] / ordered.last);
    }

    /// Whether a report differs, speed and current as shares of the past, and the current as one at this speed.
    ///
    /// The last is NaN where it says nothing: while the commands change much, or the motor slows down.
    fn differing(
        &self,
        speed: f64,
        current: f64,
        ordered: &Ordered,
        expected: Option<&Expected>,
    ) -> (bool, (f64, f64), f64) {
        let limits = &self.limits;
        let Some(usual) = expected else {
            return (false, (f64::NAN, f64::NAN), f64::NAN);
        };
        let shares = (speed / usual.speed, current / usual.current);
        if ordered.lowest.is_nan() || ordered.lowest <= limits.steady_percent {
            return (false, shares, f64::NAN);
        }
        let (slowest, fastest) = (
            usual.speed * ordered.lowest / ordered.mean,
            usual.speed * ordered.highest / ordered.mean,
        );
        let wide = if usual.far { limits.far } else { 1.0 };
        let slow = speed / slowest < 1.0 - (1.0 - limits.slow) * wide;
        let fast = speed / fastest > 1.0 + (limits.fast - 1.0) * wide;
        let wanted = usual.current * shares.0.powi(LAW);
        let ratio = if wanted > limits.least_a {
            current / wanted
        } else {
            f64::NAN
        };
        let even = ordered.highest - ordered.lowest <= limits.even_percent;
        let about = limits.steady_percent / 3.0;
        let few = ordered.last >= ordered.mean - about;
        let much = ordered.last <= ordered.mean + about;
        let unloaded = even && few && ratio < limits.unloaded / wide;
        let dragged = even && much && ratio > limits.dragged * wide;
        let no_more = !matches!(ratio.partial_cmp(&1.0), Some(std::cmp::Ordering::Greater));
        let off = slow || (fast && few && no_more) || unloaded || dragged;
        (off, shares, if even && few { ratio } else { f64::NAN })
    }
}
