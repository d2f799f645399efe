//! A motor against its own past: what a slow reading of the same words gives, and any cut the same.

mod sums;

use _native::motor::{ordered, CommandLog, Compared, Limits, Orders, Reports, SupplyLine, Watch, WELL};

const WINDOW: i64 = 500;
const LIMITS: Limits = Limits {
    learned: 16.0,
    steady_percent: 6.0,
    even_percent: 20.0,
    slow: 0.85,
    fast: 1.12,
    unloaded: 0.5,
    dragged: 1.8,
    worn: 0.75,
    many: 16,
    far: 2.0,
    least_a: 1.0,
    given: 0.8,
    sag_begun: 0.02,
};

struct Noise(u64);

impl Noise {
    fn next(&mut self) -> f64 {
        self.0 = self
            .0
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        f64::from((self.0 >> 40) as u32) / f64::from(1_u32 << 24)
    }
}

/// Commands every 10 ns around a level, each two frames long; a report every 100.
struct Flight {
    ran: Vec<i64>,
    frame_end: Vec<i64>,
    percent: Vec<f32>,
    columns: [Vec<f64>; 4],
    when: Vec<i64>,
    frame: Vec<i64>,
}

impl Flight {
    fn new(start: u64, lost_from: usize, worn: bool) -> Self {
        let mut noise = Noise(start);
        let count = 400;
        let level = |k: usize| 40.0 + 20.0 * f64::from(((k / 1000) % 2) as u32);
        let percent: Vec<f32> = (0..count * 10)
            .map(|k| (level(k) + 2.0 * noise.next()) as f32)
            .collect();
        let mut flight = Flight {
            ran: (0..count as i64 * 10).map(|k| k * 10).collect(),
            frame_end: (0..count as i64 * 10).map(|k| 2 * k + 1).collect(),
            percent,
            columns: [vec![], vec![], vec![], vec![]],
            when: (1..=count as i64).map(|k| k * 100).collect(),
            frame: (1..=count as i64).map(|k| k * 20).collect(),
        };
        for k in 0..count {
            let command = f64::from(flight.percent[(k * 10 + 9).min(flight.percent.len() - 1)]);
            let lost = k >= lost_from;
            let turns = command * 60.0 * if lost && !worn { 1.2 } else { 1.0 } * (1.0 + 0.01 * noise.next());
            let current = command.powi(3) / 6400.0
                * if lost {
                    if worn {
                        0.6
                    } else {
                        0.2
                    }
                } else {
                    1.0
                };
            for (column, value) in flight.columns.iter_mut().zip([turns, 48.0, current, command]) {
                column.push(value);
            }
        }
        flight
    }

    fn orders(&self) -> Orders<'_> {
        Orders {
            ran: &self.ran,
            frame_end: &self.frame_end,
            percent: &self.percent,
        }
    }

    fn commanded(&self) -> [Vec<f64>; 4] {
        ordered(&self.orders(), &self.when, &self.frame, WINDOW).expect("columns fit")
    }

    /// In pieces that end at these reports; rows count from the first of all.
    fn compared(&self, cuts: &[usize]) -> Compared {
        let commanded = self.commanded();
        let mut watch = Watch::new(LIMITS);
        let mut all = Compared {
            off: vec![],
            before: vec![],
            speed: vec![],
            current: vec![],
            reported: vec![],
            well: [-1; WELL],
            learned: -1,
        };
        let mut start = 0;
        for &stop in cuts {
            let column = |number: usize| &self.columns[number][start..stop];
            let reports = Reports {
                speed: column(0),
                volts: column(1),
                current: column(2),
                reported: column(3),
                commanded: commanded.each_ref().map(|one| &one[start..stop]),
            };
            let found = watch.feed(&reports).expect("columns fit");
            let known = all.well;
            let behind = |rows: [i64; WELL]| {
                std::array::from_fn(|way| {
                    if rows[way] < 0 {
                        known[way]
                    } else {
                        rows[way] + start as i64
                    }
                })
            };
            all.before.extend(found.before.iter().map(|&rows| behind(rows)));
            all.well = behind(found.well);
            if all.learned < 0 && found.learned >= 0 {
                all.learned = found.learned + start as i64;
            }
            all.off.extend(found.off);
            all.speed.extend(found.speed);
            all.current.extend(found.current);
            all.reported.extend(found.reported);
            start = stop;
        }
        all
    }
}

fn same(one: &[f64], other: &[f64]) -> bool {
    one.iter()
        .map(|value| value.to_bits())
        .eq(other.iter().map(|value| value.to_bits()))
}

#[test]
fn any_cut_gives_the_same() {
    for seed in 1..20 {
        let flight = Flight::new(seed, 250, seed % 2 == 0);
        let whole = flight.compared(&[400]);
        let cuts = [1, 2, 17, 100, 99 + seed as usize * 7, 251, 252, 400];
        let mut cuts = cuts.to_vec();
        cuts.sort_unstable();
        let cut = flight.compared(&cuts);
        assert_eq!(
            (&whole.off, &whole.before, whole.well, whole.learned),
            (&cut.off, &cut.before, cut.well, cut.learned)
        );
        assert!(same(&whole.speed, &cut.speed) && same(&whole.current, &cut.current));
    }
}

#[test]
fn a_lost_load_is_off_from_its_first_report_on() {
    let flight = Flight::new(7, 250, false);
    let found = flight.compared(&[400]);
    let first = found.off.iter().position(|&off| off == 1).expect("it is seen");
    assert_eq!(first, 250);
    assert!(found.before[first].iter().all(|&row| row < 250));
    assert!(found.off[..first].iter().all(|&off| off == 0));
}

#[test]
fn a_current_a_little_low_is_off_once_many_say_so() {
    let flight = Flight::new(8, 250, true);
    let (lost, healthy) = (flight.compared(&[400]), Flight::new(8, 400, true).compared(&[400]));
    let first = lost.off.iter().position(|&off| off == 1).expect("it is seen");
    assert!(first > 250 && first <= 250 + 3 * LIMITS.many as usize);
    assert!(healthy.off.iter().all(|&off| off == 0));
}

#[test]
fn a_worn_blade_is_seen_though_few_commands_are_even() {
    let mut flight = Flight::new(8, 250, true);
    for (k, value) in flight.percent.iter_mut().enumerate().filter(|(k, _)| k % 100 < 50) {
        *value *= if k % 2 == 0 { 0.7 } else { 1.0 };
    }
    let found = flight.compared(&[400]);
    assert!(found.off[..250].iter().all(|&off| off == 0));
    assert!(found.off[250..].contains(&1));
}

#[test]
fn while_commands_change_a_report_still_tells_that_its_motor_turns() {
    let mut flight = Flight::new(4, 300, false);
    for (k, value) in flight.percent.iter_mut().enumerate().skip(2500) {
        *value = if k % 40 < 20 { 30.0 } else { 90.0 };
    }
    for row in 300..400 {
        flight.columns[0][row] = 10.0;
    }
    let found = flight.compared(&[400]);
    let first = found.off.iter().position(|&off| off == 1).expect("it stands");
    let [good, turning, ..] = found.before[first];
    assert_eq!((first, turning), (300, 299));
    assert!(good < 260);
}

#[test]
fn a_rotor_that_runs_ahead_of_its_supply_has_lost_nothing() {
    let mut flight = Flight::new(4, 300, false);
    let sagged = flight.compared(&[400]).off[300];
    flight.columns[1].iter_mut().skip(300).for_each(|volts| *volts = 44.0);
    assert_eq!((sagged, flight.compared(&[400]).off[300]), (1, 0));
}

#[test]
fn commands_are_those_of_the_window_that_were_whole_before() {
    let mut flight = Flight::new(3, 400, false);
    for (k, value) in flight.percent.iter_mut().enumerate().filter(|(k, _)| k % 97 == 3) {
        *value = if k % 2 == 0 { f32::NAN } else { 90.0 };
    }
    let [lowest, highest, mean, last] = flight.commanded();
    let mut known = 0;
    for row in 0..flight.when.len() {
        let (ran, frame) = (flight.when[row], flight.frame[row]);
        let mine: Vec<f64> = (0..flight.ran.len())
            .filter(|&k| flight.frame_end[k] < frame && flight.ran[k] <= ran && flight.ran[k] >= ran - WINDOW)
            .map(|k| f64::from(flight.percent[k]))
            .collect();
        if mine.first().is_none_or(|first| first.is_nan()) {
            assert!(last[row].is_nan());
            continue;
        }
        assert_eq!(last[row].to_bits(), mine[mine.len() - 1].to_bits());
        if mine.iter().any(|value| value.is_nan()) {
            assert!(lowest[row].is_nan() && highest[row].is_nan() && mean[row].is_nan());
            continue;
        }
        let sum: f64 = mine.iter().sum();
        let slow = (
            mine.iter().copied().fold(f64::INFINITY, f64::min),
            mine.iter().copied().fold(0.0, f64::max),
        );
        assert_eq!((lowest[row], highest[row]), slow);
        assert!((mean[row] - sum / f64::from(mine.len() as u32)).abs() < 1e-9);
        known += 1;
    }
    assert!(known > 100);
}

#[test]
fn reports_that_go_back_in_time_have_their_own_commands() {
    let flight = Flight::new(6, 400, false);
    let there = ordered(&flight.orders(), &[9_000, 2_000, 9_100], &[1_800, 400, 1_820], WINDOW).expect("fit");
    let alone = ordered(&flight.orders(), &[2_000], &[400], WINDOW).expect("fit");
    assert_eq!(there[0][1].to_bits(), alone[0][0].to_bits());
    assert_eq!(there[2][1].to_bits(), alone[2][0].to_bits());
}

#[test]
fn columns_that_do_not_fit_are_refused() {
    let flight = Flight::new(5, 400, false);
    assert!(ordered(&flight.orders(), &[1, 2], &[1], WINDOW).is_none());
    let mut orders = flight.orders();
    orders.percent = &[];
    assert!(ordered(&orders, &[1], &[1], WINDOW).is_none());
    let one = [1.0];
    let reports = Reports {
        speed: &one,
        volts: &one,
        current: &[],
        reported: &one,
        commanded: [&one; 4],
    };
    assert!(Watch::new(LIMITS).feed(&reports).is_none());
}

#[test]
fn commands_in_pieces_are_those_of_one_piece() {
    let flight = Flight::new(9, 250, false);
    let whole = flight.commanded();
    let mut log = CommandLog::new(WINDOW, 4096);
    let mut found: [Vec<f64>; 4] = Default::default();
    for (piece, start) in (0..4000).step_by(500).enumerate() {
        let rows = start..start + 500;
        let percent = &flight.percent[rows.clone()];
        log.feed(1, &flight.ran[rows.clone()], &flight.frame_end[rows], percent)
            .expect("columns fit");
        let reports = piece * 50..(piece + 1) * 50;
        assert!(log.before(2, &[], &[]).is_none());
        let some = log
            .before(1, &flight.when[reports.clone()], &flight.frame[reports])
            .expect("a channel");
        found.iter_mut().zip(some).for_each(|(all, more)| all.extend(more));
    }
    assert!((0..2).all(|column| same(&whole[column], &found[column])));
    assert!(same(&whole[3], &found[3]));
    assert!(log.feed(0, &[1], &[1, 2], &[1.0]).is_none());
}

#[test]
fn a_line_of_a_supply_tells_what_its_current_explains() {
    let mut noise = Noise(11);
    let amperes: Vec<f64> = (0..400).map(|_| 20.0 + 20.0 * noise.next()).collect();
    let volts: Vec<f64> = amperes.iter().map(|one| 50.0 - 0.1 * one).collect();
    let whole = SupplyLine::default().feed(&volts, &amperes).expect("columns fit");
    let mut pieces = SupplyLine::default();
    let mut cut = pieces.feed(&volts[..7], &amperes[..7]).expect("columns fit");
    cut.extend(pieces.feed(&volts[7..], &amperes[7..]).expect("columns fit"));
    assert!(same(&whole, &cut));
    assert!(
        whole[0].is_nan()
            && whole[300..]
                .iter()
                .zip(&volts[300..])
                .all(|(one, other)| (one - other).abs() < 0.01)
    );
    assert!(pieces.feed(&volts, &[]).is_none());
}

#[test]
fn reports_that_are_whole_have_speed_voltage_and_commands() {
    let (nan, some) = (f64::NAN, [9.0, 9.0, 9.0, 9.0, 9.0]);
    let last = [9.0, 9.0, 9.0, nan, 9.0];
    let reports = Reports {
        speed: &[9.0, nan, 9.0, 9.0, 7.0],
        volts: &[9.0, 9.0, 1.0, 9.0, 8.0],
        current: &[nan; 5],
        reported: &[1.0, 2.0, 3.0, 4.0, 5.0],
        commanded: [&some, &some, &some, &last],
    };
    let whole: Vec<usize> = (0..5).filter(|&row| reports.is_whole(row)).collect();
    assert_eq!(whole, [0, 4]);
    let picked = reports.pick(&whole);
    assert_eq!(picked.reports[0], [9.0, 7.0]);
    assert_eq!(picked.reports[1], [9.0, 8.0]);
    assert_eq!(picked.reports[3], [1.0, 5.0]);
    assert_eq!(picked.commanded, [[9.0; 2]; 4]);
}
