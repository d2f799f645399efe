//! Sums of reports by time and bin: what they add up to, and the same however reports come in pieces.

#![allow(clippy::float_cmp)] // sums of whole numbers

use _native::motor::{Reports, SumLimits, Sums, Times, KINDS, NEVER, SLOTS};

use crate::Noise;

const LIMITS: SumLimits = SumLimits {
    idle_rpm: 300.0,
    idle_percent: 3.0,
    least_a: 1.0,
    steady_percent: 6.0,
    steady_speed: 0.05,
    pause: 300,
    late_periods: 1.5,
};

struct Log {
    columns: [Vec<f64>; 4], // speed, volts, current, reported
    commanded: [Vec<f64>; 4],
    temperature: Vec<f64>,
    ran: Vec<i64>,
    step: Vec<i64>,
}

impl Log {
    /// A report every 100 ns at 3000 rpm, 48 V, 10 A and 51 %, each a little off.
    fn even(count: usize) -> Self {
        let mut noise = Noise(7);
        let mut near = |middle: f64| {
            (0..count)
                .map(|_| middle * (0.99 + 0.02 * noise.next()))
                .collect::<Vec<_>>()
        };
        Log {
            columns: [near(3000.0), near(48.0), near(10.0), near(50.0)],
            commanded: [near(51.0), near(51.0), near(51.0), near(51.0)],
            temperature: near(60.0),
            ran: (0..count as i64).map(|row| 1000 + 100 * row).collect(),
            step: vec![1; count],
        }
    }

    fn feed(&self, sums: &mut Sums, rows: std::ops::Range<usize>, width: i64) {
        let part = |column: &'_ Vec<f64>| column[rows.clone()].to_vec();
        let (columns, commanded) = (self.columns.each_ref().map(part), self.commanded.each_ref().map(part));
        let reports = Reports {
            speed: &columns[0],
            volts: &columns[1],
            current: &columns[2],
            reported: &columns[3],
            commanded: commanded.each_ref().map(Vec::as_slice),
        };
        let ran = &self.ran[rows.clone()];
        let times = Times {
            ran,
            t: ran,
            step: &self.step[rows.clone()],
        };
        let fed = sums.feed(&reports, &self.temperature[rows.clone()], &times, 1000, width);
        assert_eq!(fed, Some(()));
    }

    fn sums(&self, cuts: &[usize], width: i64) -> Sums {
        let mut sums = Sums::new(LIMITS);
        let mut from = 0;
        for &cut in cuts.iter().chain([&self.ran.len()]) {
            self.feed(&mut sums, from..cut, width);
            from = cut;
        }
        sums
    }
}

fn same(one: &Sums, other: &Sums) {
    assert_eq!(one.binned.count(), other.binned.count());
    assert_eq!(one.binned.total(), other.binned.total());
    assert_eq!(one.measured, other.measured);
    assert_eq!(one.counted, other.counted);
    assert_eq!(one.first, other.first);
}

fn kinds(sums: &Sums) -> [f64; KINDS] {
    std::array::from_fn(|kind| sums.binned.count()[kind * SLOTS..][..SLOTS].iter().flatten().sum())
}

#[test]
fn every_report_that_turns_is_counted_and_the_even_ones_are_binned() {
    let sums = Log::even(200).sums(&[], 1000);
    assert_eq!(sums.counted.map(|slots| slots.iter().sum::<f64>()), [200.0, 0.0, 0.0]);
    assert_eq!(kinds(&sums), [199.0; KINDS]); // nothing is known before the first one
    assert_eq!(sums.binned.count()[3][20], 10.0); // 51 % of command, ten reports in each slot
    let mean = sums.binned.total()[2 * SLOTS..][..SLOTS].iter().flatten().sum::<f64>() / 199.0 / f64::from(1 << 20);
    assert!((mean - 48.0 * 10.0 / 27.0).abs() < 0.5, "{mean}");
    assert_eq!(
        (sums.first[0][1], sums.first[1][1], sums.first[0][20]),
        (2000, 2000, NEVER)
    );
}

#[test]
fn any_cut_gives_the_same() {
    let mut log = Log::even(300);
    log.columns[0][120] = f64::NAN;
    log.columns[1][130] = 0.5;
    log.columns[2][140] = f64::INFINITY;
    log.step[150] = 4;
    log.step[160] = 255;
    for row in 170..300 {
        log.ran[row] += 1000;
    }
    let whole = log.sums(&[], 777);
    for cuts in [vec![1], vec![31, 32, 33], (1..300).collect(), vec![150, 170]] {
        same(&whole, &log.sums(&cuts, 777));
    }
}

#[test]
fn what_is_missing_and_what_is_late_is_told_apart() {
    let mut log = Log::even(100);
    log.step[50] = 4; // three are missing
    log.step[60] = 255; // the sender began again
    for row in 70..100 {
        log.ran[row] += 100; // one is late although none is missing
    }
    let [came, lost, late] = log.sums(&[], 1000).counted.map(|slots| slots.iter().sum::<f64>());
    assert_eq!((came, lost, late), (100.0, 3.0, 1.0));
    log.step[70] = 2;
    assert_eq!(log.sums(&[], 1000).counted[2].iter().sum::<f64>(), 0.0);
}

#[test]
fn a_motor_that_stands_is_left_out_and_one_behind_a_pause_is_not_even() {
    let mut log = Log::even(100);
    for row in 40..50 {
        log.columns[0][row] = 0.0;
    }
    for row in 70..100 {
        log.ran[row] += 500;
    }
    let sums = log.sums(&[], 1000);
    assert_eq!(sums.counted[0].iter().sum::<f64>(), 90.0);
    assert_eq!(kinds(&sums)[1], 90.0 - 3.0); // the first, the one after it stood, the one behind the pause
}

#[test]
fn two_slots_become_one_as_if_they_had_been() {
    let log = Log::even(SLOTS * 10);
    let mut halved = log.sums(&[], 1000);
    halved.halve();
    same(&halved, &log.sums(&[], 2000));
    assert!(halved.first[0][SLOTS / 2..].iter().all(|&first| first == NEVER));
    assert!(halved.binned.count()[SLOTS / 2..SLOTS]
        .as_flattened()
        .iter()
        .all(|&one| one == 0.0));
}
