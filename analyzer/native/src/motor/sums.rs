//! What one ESC reports as sums by time and bin: whole numbers, so that any cut of a capture gives the same.
#![forbid(unsafe_code)]

use super::binned::{Binned, BINS, SLOTS};
use super::{Reports, NO_SUPPLY};

/// Sums by time alone: temperature, logarithm of the voltage, power.
pub const MEASURED: usize = 3;
/// Reports that came, that are missing, that came late.
pub const COUNTED: usize = 3;
/// Of times of a slot without a report.
pub const NEVER: i64 = i64::MAX;

/// Anything that is measured, as a whole number.
const ONE: f64 = (1 << 20) as f64;
/// % of the full command.
const COMMAND_BIN: f64 = 2.5;
/// Natural logarithm of rpm, from 300 rpm on.
const SPEED_BIN: f64 = 0.12;
const SLOWEST: f64 = 300.0;
/// Periods until one is known; one round of transfer IDs.
const PERIODS: usize = 32;
/// The step of a transfer ID whose sender began again.
const ANEW: i64 = 255;

/// The numbers that decide, as `thresholds.toml` names and explains them; shares, %, A, rpm and ns.
#[derive(Clone, Copy, Debug)]
pub struct SumLimits {
    pub idle_rpm: f64,
    pub idle_percent: f64,
    pub least_a: f64,
    pub steady_percent: f64,
    pub steady_speed: f64,
    pub pause: i64,
    pub late_periods: f64,
}

/// When reports came: `ran` while it was recorded, `t` by the capture's clock, `step` of the transfer ID before each.
#[derive(Debug)]
pub struct Times<'a> {
    pub ran: &'a [i64],
    pub t: &'a [i64],
    pub step: &'a [i64],
}

type Slots = [f64; SLOTS];
/// Follows one ESC. Bound: `SLOTS` by `BINS` sums of each kind.
#[derive(Debug)]
pub struct Sums {
    limits: SumLimits,
    /// Numbers and sums by bin.
    pub binned: Binned,
    /// Numbers and sums by slot.
    pub measured: [[Slots; 2]; MEASURED],
    pub counted: [Slots; COUNTED],
    /// `ran` and `t` of the first report of a slot.
    pub first: [[i64; SLOTS]; 2],
    last: Option<Last>,
    periods: Vec<i64>,
    late: Option<i64>, // ns after which a report is late
}

#[derive(Clone, Copy, Debug)]
struct Last {
    speed: f64,
    reported: f64,
    ran: i64,
}

/// A report, as far as sums are made of it.
struct One {
    speed: f64,
    volts: f64,
    current: f64,
    temperature: f64,
    command: f64, // on the bus, else what the ESC says it was; %
    steady: bool,
    slot: usize,
}

impl Sums {
    pub fn new(limits: SumLimits) -> Self {
        Sums {
            limits,
            binned: Binned::default(),
            measured: [[[0.0; SLOTS]; 2]; MEASURED],
            counted: [[0.0; SLOTS]; COUNTED],
            first: [[NEVER; SLOTS]; 2],
            last: None,
            periods: Vec::with_capacity(PERIODS),
            late: None,
        }
    }

    /// Takes the next reports, with a slot of `width` ns for each time from `start` on; what is behind the last slot is in it.
    ///
    /// None if columns do not fit together.
    pub fn feed(
        &mut self,
        reports: &Reports<'_>,
        temperature: &[f64],
        times: &Times<'_>,
        start: i64,
        width: i64,
    ) -> Option<()> {
        let long = times.ran.len();
        if !reports.fit() || reports.speed.len() != long || temperature.len() != long {
            return None;
        }
        if times.t.len() != long || times.step.len() != long || width < 1 {
            return None;
        }
        for (row, &ran) in times.ran.iter().enumerate() {
            let slot = (ran.saturating_sub(start).max(0) / width) as usize;
            let on = self.turns(reports, row);
            let one = One {
                speed: reports.speed[row],
                volts: reports.volts[row],
                current: reports.current[row],
                temperature: temperature[row],
                command: command(reports, row),
                steady: self.steady(reports, row, ran) && on,
                slot: slot.min(SLOTS - 1),
            };
            let (lost, late) = self.missing(times.step[row], ran);
            self.last = Some(Last {
                speed: one.speed,
                reported: reports.reported[row],
                ran,
            });
            if one.steady {
                self.bin(&one);
            }
            if on {
                self.measure(&one);
                for (slots, more) in self.counted.iter_mut().zip([1.0, lost, f64::from(u8::from(late))]) {
                    slots[one.slot] += more;
                }
                if self.first[0][one.slot] == NEVER {
                    self.first[0][one.slot] = ran;
                    self.first[1][one.slot] = times.t[row];
                }
            }
        }
        Some(())
    }

    /// Makes one slot of two.
    pub fn halve(&mut self) {
        self.binned.halve();
        for slots in self.measured.iter_mut().flatten().chain(&mut self.counted) {
            *slots = std::array::from_fn(|slot| match 2 * slot {
                even if even < SLOTS => slots[even] + slots[even + 1],
                _ => 0.0,
            });
        }
        for slots in &mut self.first {
            *slots = std::array::from_fn(|slot| match 2 * slot {
                even if even < SLOTS => slots[even].min(slots[even + 1]),
                _ => NEVER,
            });
        }
    }

    /// Whether the motor turns: by its speed, else by its current, else by what is commanded.
    fn turns(&self, reports: &Reports<'_>, row: usize) -> bool {
        let (speed, current) = (reports.speed[row], reports.current[row]);
        if speed.is_finite() {
            speed > self.limits.idle_rpm
        } else if current.is_finite() {
            current > self.limits.least_a
        } else {
            command(reports, row) > self.limits.idle_percent
        }
    }

    /// Whether neither speed nor command moved much since the report before: not behind a pause, nor slower than idle.
    fn steady(&self, reports: &Reports<'_>, row: usize, ran: i64) -> bool {
        let Some(last) = self.last else { return false };
        let (speed, limits) = (reports.speed[row], &self.limits);
        let [lowest, highest, _, newest] = reports.commanded.map(|column| column[row]);
        let held = if newest.is_finite() {
            highest - lowest <= limits.steady_percent
        } else {
            let moved = (reports.reported[row] - last.reported).abs();
            moved.is_nan() || moved <= limits.steady_percent
        };
        let even = (speed - last.speed).abs() <= limits.steady_speed * last.speed;
        even && held && ran.saturating_sub(last.ran) <= limits.pause && speed > limits.idle_rpm
    }

    /// How many reports are missing before one, and whether it is late although none is.
    fn missing(&mut self, step: i64, ran: i64) -> (f64, bool) {
        let lost = if step > 1 && step != ANEW { step as u32 - 1 } else { 0 };
        let Some(before) = self.last else {
            return (f64::from(lost), false);
        };
        let gap = ran.saturating_sub(before.ran);
        if let Some(late) = self.late {
            return (f64::from(lost), gap > late && step == 1);
        }
        self.periods.push(gap);
        if self.periods.len() == PERIODS {
            self.periods.sort_unstable();
            #[allow(clippy::cast_precision_loss)] // a period in ns
            let [one, other] = [PERIODS / 2 - 1, PERIODS / 2].map(|place| self.periods[place] as f64);
            self.late = Some(((self.limits.late_periods * f64::midpoint(one, other)) as i64).max(1));
        }
        (f64::from(lost), false)
    }

    /// Adds an even report to the sums by bins.
    ///
    /// Those are speed for a percent of command and a volt, speed for a percent alone, power by the cube of the speed,
    /// current by it: at equal speed the product of current and voltage stays the same whatever the pack gives. Means of
    /// them are those of an even speed, as much as a motor gains speed and loses it again.
    fn bin(&mut self, one: &One) {
        let supplied = one.volts > NO_SUPPLY;
        if one.command > self.limits.steady_percent {
            let (bin, gained) = (place(one.command / COMMAND_BIN), one.speed / one.command);
            if supplied {
                self.binned.add(0, one.slot, bin, whole(gained / one.volts));
            }
            self.binned.add(1, one.slot, bin, whole(gained));
        }
        if one.current > self.limits.least_a {
            let turns = if one.speed > 0.0 { one.speed } else { 1.0 };
            let bin = place((turns / SLOWEST).ln() / SPEED_BIN);
            let taken = one.current / (turns / 1000.0).powi(super::LAW);
            if supplied {
                self.binned.add(2, one.slot, bin, whole(taken * one.volts));
            }
            self.binned.add(3, one.slot, bin, whole(taken));
        }
    }

    fn measure(&mut self, one: &One) {
        let calm = (one.steady || one.speed.is_nan()) && one.volts > NO_SUPPLY;
        let volts = if calm { one.volts.ln() } else { f64::NAN };
        let values = [one.temperature, volts, one.volts * one.current];
        for ([count, total], value) in self.measured.iter_mut().zip(values) {
            if value.is_finite() {
                count[one.slot] += 1.0;
                total[one.slot] += whole(value);
            }
        }
    }
}

/// The throttle in %: what was commanded on the bus, else what the ESC says it was.
fn command(reports: &Reports<'_>, row: usize) -> f64 {
    let mean = reports.commanded[2][row];
    if mean.is_finite() {
        mean
    } else {
        reports.reported[row]
    }
}

/// In parts of `ONE`. Adding so much that no digit is left behind the point rounds as the function does that has no
/// instruction of its own on every processor.
fn whole(value: f64) -> f64 {
    const MOST: f64 = 2_251_799_813_685_248.0; // 2^51
    const DIGITS: f64 = 3.0 * MOST;
    let parts = value * ONE;
    if parts.abs() < MOST {
        (parts + DIGITS) - DIGITS
    } else {
        parts.round_ties_even()
    }
}

fn place(number: f64) -> usize {
    (number.max(0.0) as usize).min(BINS - 1)
}

#[cfg(test)]
mod tests {
    use super::{whole, ONE};

    #[test]
    fn numbers_are_rounded_to_parts_halves_to_even_ones() {
        let halves = [
            0.5,
            1.5,
            2.5,
            -0.5,
            -1.5,
            0.49,
            0.51,
            7.0,
            1e9 + 0.5,
            1e15 + 0.5,
            3e15,
            -3e15,
            9e18,
            0.0,
        ];
        for parts in halves {
            let expected = (parts / ONE * ONE).round_ties_even() + 0.0; // of the two zeros the sum of both
            assert_eq!(whole(parts / ONE).to_bits(), expected.to_bits(), "{parts}");
        }
        for odd in [f64::INFINITY, f64::NEG_INFINITY] {
            assert_eq!(whole(odd).to_bits(), odd.to_bits());
        }
        assert!(whole(f64::NAN).is_nan());
    }
}
