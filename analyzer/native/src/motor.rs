//! A motor against its own past: the reports of one ESC, in order, beside what it was commanded before each of them.
//!
//! What a report is compared with depends on the reports before it alone, however they come in pieces.
#![forbid(unsafe_code)]

mod binned;
mod log;
mod orders;
mod past;
mod recent;
mod sums;
mod supply;

pub use binned::{BINS, KINDS, SLOTS};
pub use log::CommandLog;
pub use orders::{ordered, Ordered, Orders};
use past::{Expected, Past, LAW};
use recent::Recent;
pub use sums::{SumLimits, Sums, Times, COUNTED, MEASURED, NEVER};
pub use supply::SupplyLine;

/// A current as a share of what it was at that speed, between which a report is as it should be.
const GOOD: (f64, f64) = (0.85, 1.2);

/// A supply that says nothing, in V.
const NO_SUPPLY: f64 = 1.0;

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
    pub given: f64,
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

/// Some reports: speed, volts, current, reported; and what was commanded before each.
#[derive(Debug)]
pub struct Picked {
    pub reports: [Vec<f64>; 4],
    pub commanded: [Vec<f64>; 4],
}

impl Reports<'_> {
    /// Whether a report has a speed, a voltage and commands before it.
    pub fn is_whole(&self, row: usize) -> bool {
        let [.., last] = self.commanded;
        self.speed[row].is_finite() && self.volts[row] > NO_SUPPLY && last[row].is_finite()
    }

    /// Some of them.
    #[must_use]
    pub fn pick(&self, rows: &[usize]) -> Picked {
        let some = |column: &[f64]| rows.iter().map(|&row| column[row]).collect();
        Picked {
            reports: [self.speed, self.volts, self.current, self.reported].map(some),
            commanded: self.commanded.map(some),
        }
    }

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

/// What a report says that speaks against a trouble, even while the commands change: it is as it should be, its motor
/// turns fast enough for the lowest of the commands, it gives what is commanded, it takes what its load takes, though it
/// gains no speed, or as it may gain some.
pub const WELL: usize = 5;

/// Reports beside their past, a row each: `off` are those that differ.
///
/// `before` are the rows of the last reports before each that were well, -1 for none of these, and `well` those of the
/// last ones of all, `learned` that of the first one that is well by its past, -1 for none; shares of speed and current are
/// of what they were at such a command, `reported` of what is commanded.
#[derive(Debug, PartialEq)]
pub struct Compared {
    pub off: Vec<u8>,
    pub before: Vec<[i64; WELL]>,
    pub speed: Vec<f64>,
    pub current: Vec<f64>,
    pub reported: Vec<f64>,
    pub well: [i64; WELL],
    pub learned: i64,
}

/// A report beside what it should be.
#[allow(clippy::struct_excessive_bools)] // each says one thing of a report
struct Beside {
    /// Slower than it should be, or with more current.
    behind: bool,
    /// Faster than it should be, or with less current.
    ahead: bool,
    speed: f64,
    current: f64,
    /// The current as a share of that at this speed; NaN where it says nothing: while the commands change much, or the
    /// motor slows down.
    ratio: f64,
    /// The past is a guess here.
    far: bool,
    turning: bool,
    loaded: bool,
    drawing: bool,
}

impl Beside {
    const UNKNOWN: Self = Beside {
        behind: false,
        ahead: false,
        speed: f64::NAN,
        current: f64::NAN,
        ratio: f64::NAN,
        far: false,
        turning: false,
        loaded: false,
        drawing: false,
    };
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
            ratios: Recent::new(limits.many as usize, f64::NAN, limits.worn),
            volts: Recent::new(limits.many as usize, f64::NEG_INFINITY, 0.0),
        }
    }

    /// Takes the next reports; None if columns do not fit together.
    pub fn feed(&mut self, reports: &Reports<'_>) -> Option<Compared> {
        if !reports.fit() {
            return None;
        }
        let count = reports.speed.len();
        let mut found = Compared {
            off: Vec::with_capacity(count),
            before: Vec::with_capacity(count),
            speed: Vec::with_capacity(count),
            current: Vec::with_capacity(count),
            reported: Vec::with_capacity(count),
            well: [-1; WELL],
            learned: -1,
        };
        for row in 0..count {
            self.compare(reports, row, &reports.ordered(row), &mut found);
        }
        Some(found)
    }

    fn compare(&mut self, reports: &Reports<'_>, row: usize, ordered: &Ordered, found: &mut Compared) {
        let (speed, volts, current) = (reports.speed[row], reports.volts[row], reports.current[row]);
        let expected = self.past.expected(ordered.mean, volts);
        let mut beside = self.beside(speed, current, ordered, expected.as_ref());
        self.volts.push(volts);
        let ratio = beside.ratio;
        if volts < self.volts.most() * (1.0 - self.limits.sag_begun) {
            beside.ahead = false; // a rotor runs ahead of a supply that falls, and takes less
            self.ratios.push(f64::NAN);
        } else if ratio.is_finite() && !beside.far && ordered.last >= ordered.mean {
            self.ratios.push(ratio); // a motor that slows down takes less
        }
        let worn = self.limits.worn * f64::from(self.limits.many);
        let off = beside.behind || beside.ahead || self.ratios.less(worn);
        let good = ratio > GOOD.0 && ratio < GOOD.1;
        let steady = ordered.highest - ordered.lowest <= self.limits.steady_percent;
        let driven = ordered.lowest > self.limits.steady_percent && speed > 0.0;
        let calm = steady && driven && !off && current.is_finite() && (good || ratio.is_nan());
        self.past
            .add(calm.then_some([ordered.mean, speed / volts, current, volts]));
        found.before.push(found.well);
        let reported = reports.reported[row] / ordered.last;
        let given = self.rising(ordered) && ordered.last > self.limits.steady_percent && reported >= self.limits.given;
        let by_past = [good && !off, beside.turning, beside.loaded, beside.drawing];
        if found.learned < 0 && by_past.contains(&true) {
            found.learned = row as i64;
        }
        let [good, turning, loaded, drawing] = by_past;
        for (well, so) in found.well.iter_mut().zip([good, turning, given, loaded, drawing]) {
            if so {
                *well = row as i64;
            }
        }
        found.off.push(u8::from(off));
        found.speed.push(beside.speed);
        found.current.push(beside.current);
        found.reported.push(reported);
    }

    /// Whether the last command is not below their mean, so that nothing is slowed down.
    fn rising(&self, ordered: &Ordered) -> bool {
        ordered.last >= ordered.mean - self.limits.steady_percent / 3.0
    }

    fn beside(&self, speed: f64, current: f64, ordered: &Ordered, expected: Option<&Expected>) -> Beside {
        let limits = &self.limits;
        let Some(usual) = expected else {
            return Beside::UNKNOWN;
        };
        let shares = (speed / usual.speed, current / usual.current);
        if ordered.lowest.is_nan() || ordered.lowest <= limits.steady_percent {
            return Beside {
                speed: shares.0,
                current: shares.1,
                ..Beside::UNKNOWN
            };
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
        let few = self.rising(ordered);
        let much = ordered.last <= ordered.mean + limits.steady_percent / 3.0;
        let unloaded = even && few && ratio < limits.unloaded / wide;
        let dragged = even && much && ratio > limits.dragged * wide;
        let no_more = !matches!(ratio.partial_cmp(&1.0), Some(std::cmp::Ordering::Greater));
        Beside {
            behind: slow || dragged,
            ahead: (fast && few && no_more) || unloaded,
            speed: shares.0,
            current: shares.1,
            ratio: if even && few { ratio } else { f64::NAN },
            far: usual.far,
            turning: !usual.far && speed >= slowest * limits.slow,
            loaded: !usual.far && much && ratio >= 1.0,
            drawing: !usual.far && ratio >= 1.0,
        }
    }
}
