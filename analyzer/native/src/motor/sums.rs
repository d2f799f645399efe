//! The reports of one ESC as sums by time and bin: whole numbers, so that any cut of a capture gives the same.
#![forbid(unsafe_code)]

use super::Reports;

/// Slots of time; when they are full, two become one.
pub const SLOTS: usize = 128;
/// Bins of commands, or of speeds.
pub const BINS: usize = 40;
/// Kinds of sums by bins: speed for a percent of command and a volt, speed for a percent, power by the cube of the
/// speed, current by it.
pub const BINNED: usize = 4;
/// Temperature, the logarithm of the voltage, power.
pub const MEASURED: usize = 3;
/// Reports that came, that were lost before them, that were late.
pub const COUNTED: usize = 3;
/// The time of a slot in which nothing came.
pub const NEVER: i64 = i64::MAX;

const COMMAND_BIN: f64 = 2.5;
/// Natural logarithm of rpm: 300 to 36,000.
const SLOWEST: f64 = 5.703_782_474_656_201;
const SPEED_BIN: f64 = 0.12;
/// Anything that is measured, as a whole number.
const ONE: f64 = 1_048_576.0;
const CELLS: usize = SLOTS * BINS;
/// Periods until one is known; one round of transfer IDs.
const PERIODS: usize = 32;
/// The step of a transfer ID where its sender began again.
const ANEW: i64 = 255;

/// The numbers that decide, as `thresholds.toml` names and explains them; `silent` in ns.
#[derive(Clone, Copy, Debug)]
pub struct SumLimits {
    pub idle_rpm: f64,
    pub least_a: f64,
    pub command_idle_percent: f64,
    pub steady_percent: f64,
    pub steady_speed: f64,
    pub silent: i64,
    pub late_periods: f64,
}

/// When reports were: `ran` while it was recorded, `t` by the capture's clock, and steps of the transfer ID.
#[derive(Clone, Copy, Debug)]
pub struct When<'a> {
    pub ran: &'a [i64],
    pub t: &'a [i64],
    pub step: &'a [i64],
}

/// Sums of one ESC. `count` and `total` are by kind, slot and bin, `measured` count and total by slot.
#[derive(Debug)]
pub struct Sums {
    limits: SumLimits,
    pub count: Vec<f64>,
    pub total: Vec<f64>,
    pub measured: Vec<f64>,
    pub counted: Vec<f64>,
    /// Recorded time, and time, of the first report of each slot.
    pub first: Vec<i64>,
    speed: f64,
    reported: f64,
    ran: Option<i64>,
    learned: Vec<i64>,
    late: i64,
}

impl Sums {
    pub fn new(limits: SumLimits) -> Self {
        Sums {
            limits,
            count: vec![0.0; BINNED * CELLS],
            total: vec![0.0; BINNED * CELLS],
            measured: vec![0.0; MEASURED * 2 * SLOTS],
            counted: vec![0.0; COUNTED * SLOTS],
            first: vec![NEVER; 2 * SLOTS],
            speed: f64::NAN,
            reported: f64::NAN,
            ran: None,
            learned: Vec::new(),
            late: 0,
        }
    }

    /// Takes the next reports; slots of `width` ns count from `start`. None if columns do not fit together.
    pub fn feed(
        &mut self,
        reports: &Reports<'_>,
        temperature: &[f64],
        when: &When<'_>,
        start: i64,
        width: i64,
    ) -> Option<()> {
        let count = reports.speed.len();
        let fits = [when.ran, when.t, when.step].iter().all(|column| column.len() == count);
        if !reports.fit() || !fits || temperature.len() != count || width <= 0 {
            return None;
        }
        for row in 0..count {
            let slot = (when.ran[row].saturating_sub(start).max(0) / width) as usize;
            self.add(reports, row, temperature[row], when, slot.min(SLOTS - 1));
        }
        Some(())
    }

    fn add(&mut self, reports: &Reports<'_>, row: usize, temperature: f64, when: &When<'_>, slot: usize) {
        let (speed, volts, current) = (reports.speed[row], reports.volts[row], reports.current[row]);
        let (mean, reported) = (reports.commanded[2][row], reports.reported[row]);
        let command = if mean.is_finite() { mean } else { reported };
        let limits = self.limits;
        let on = if speed.is_finite() {
            speed > limits.idle_rpm
        } else if current.is_finite() {
            current > limits.least_a
        } else {
            command > limits.command_idle_percent
        };
        let steady = self.steady(reports, row, when.ran[row]) && on;
        let (lost, late) = self.missing(when.ran[row], when.step[row]);
        if !on {
            return;
        }
        if steady {
            self.bin(slot, command, speed, volts, current);
        }
        let calm = (steady || speed.is_nan()) && volts > 1.0;
        let log_volts = if calm { volts.ln() } else { f64::NAN };
        for (place, value) in [temperature, log_volts, volts * current].into_iter().enumerate() {
            if value.is_finite() {
                self.measured[place * 2 * SLOTS + slot] += 1.0;
                self.measured[(place * 2 + 1) * SLOTS + slot] += (value * ONE).round_ties_even();
            }
        }
        for (place, value) in [1.0, lost as f64, f64::from(u8::from(late))].into_iter().enumerate() {
            self.counted[place * SLOTS + slot] += value;
        }
        if self.first[slot] == NEVER {
            self.first[slot] = when.ran[row];
            self.first[SLOTS + slot] = when.t[row];
        }
    }

    /// Adds what a report at a steady speed says: at equal speed the product of current and voltage stays the same
    /// whatever the pack gives, and its means are those of an even speed, as much as a motor gains speed and loses it.
    fn bin(&mut self, slot: usize, command: f64, speed: f64, volts: f64, current: f64) {
        let supplied = volts > 1.0;
        if command > self.limits.steady_percent {
            let bin = (command / COMMAND_BIN).clamp(0.0, (BINS - 1) as f64) as usize;
            let gained = speed / command;
            if supplied {
                self.put(0, slot, bin, gained / volts);
            }
            self.put(1, slot, bin, gained);
        }
        if current > self.limits.least_a {
            let bin = ((speed.ln() - SLOWEST) / SPEED_BIN).clamp(0.0, (BINS - 1) as f64) as usize;
            let taken = current / (speed / 1000.0).powi(super::LAW);
            if supplied {
                self.put(2, slot, bin, taken * volts);
            }
            self.put(3, slot, bin, taken);
        }
    }

    fn put(&mut self, kind: usize, slot: usize, bin: usize, value: f64) {
        let cell = kind * CELLS + slot * BINS + bin;
        self.count[cell] += 1.0;
        self.total[cell] += (value * ONE).round_ties_even();
    }

    /// Whether neither its speed nor its command moved much since the report before; not behind a pause.
    fn steady(&mut self, reports: &Reports<'_>, row: usize, ran: i64) -> bool {
        let limits = &self.limits;
        let (speed, reported) = (reports.speed[row], reports.reported[row]);
        let [lowest, highest, _, last] = reports.commanded.map(|column| column[row]);
        let even = (speed - self.speed).abs() <= limits.steady_speed * self.speed;
        let moved = (reported - self.reported).abs() > limits.steady_percent;
        let held = if last.is_finite() {
            highest - lowest <= limits.steady_percent
        } else {
            !moved
        };
        let pause = self.ran.is_none_or(|before| ran - before > limits.silent);
        (self.speed, self.reported) = (speed, reported);
        even && held && !pause
    }

    /// How many reports are missing before one, and whether it comes late although none is.
    fn missing(&mut self, ran: i64, step: i64) -> (i64, bool) {
        let lost = if step > 1 && step != ANEW { step - 1 } else { 0 };
        let Some(before) = self.ran.replace(ran) else {
            return (lost, false);
        };
        let gap = ran - before;
        if self.late > 0 {
            return (lost, gap > self.late && step == 1);
        }
        self.learned.push(gap);
        if self.learned.len() >= PERIODS {
            self.learned.sort_unstable();
            let middle = (self.learned[PERIODS / 2 - 1] + self.learned[PERIODS / 2]) as f64 / 2.0;
            self.late = ((self.limits.late_periods * middle) as i64).max(1);
        }
        (lost, false)
    }

    /// Makes one slot of two.
    pub fn halve(&mut self) {
        for sums in [&mut self.count, &mut self.total] {
            for kind in sums.chunks_exact_mut(CELLS) {
                for slot in 0..SLOTS {
                    for bin in 0..BINS {
                        let both = if 2 * slot < SLOTS {
                            kind[2 * slot * BINS + bin] + kind[(2 * slot + 1) * BINS + bin]
                        } else {
                            0.0
                        };
                        kind[slot * BINS + bin] = both;
                    }
                }
            }
        }
        for sums in [&mut self.measured, &mut self.counted] {
            for row in sums.chunks_exact_mut(SLOTS) {
                for slot in 0..SLOTS {
                    row[slot] = if 2 * slot < SLOTS {
                        row[2 * slot] + row[2 * slot + 1]
                    } else {
                        0.0
                    };
                }
            }
        }
        for row in self.first.chunks_exact_mut(SLOTS) {
            for slot in 0..SLOTS {
                row[slot] = if 2 * slot < SLOTS {
                    row[2 * slot].min(row[2 * slot + 1])
                } else {
                    NEVER
                };
            }
        }
    }
}
