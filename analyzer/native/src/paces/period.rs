//! The usual time between the last reports of a sender.
#![forbid(unsafe_code)]
#![allow(clippy::cast_precision_loss)] // times in ns, which are told in parts of periods

use super::{Report, MEMORY};

/// Reports this many times closer than the longest period are one round.
const ROUND: f64 = 16.0;
/// Rounds that may be as irregular as a bad bus makes them:
const MANY: usize = 8;
/// so many of their periods lie within shares of the usual one.
const MOSTLY: f64 = 0.8;
const SHORT: f64 = 0.65;
const LONG: f64 = 1.5;
/// What fewer rounds may be off.
const STRICT: f64 = 0.25;

/// How long rounds took, or how many reports were lost in each: at most one behind each report but the first.
type Each = [f64; MEMORY];

/// The period of the last reports in ns, 0.0 if they are too few or not at a steady pace.
///
/// Reports that were lost may be why it is not steady. Several that come close together, such as those of a sender with
/// several indexes, are one round.
pub fn period(reports: &[Report], fewest: usize) -> f64 {
    let reports = &reports[reports.len().saturating_sub(MEMORY + 1)..];
    let (mut took, mut lost) = ([0.0; MEMORY], [0.0; MEMORY]);
    let count = rounds(reports, &mut took, &mut lost);
    if count + 1 < fewest.max(2) {
        return 0.0;
    }
    let found = steady(took, count);
    let up_to = |one: Option<&Report>| one.map(|one| one.lost);
    if found == 0.0 && up_to(reports.last()) > up_to(reports.first()) {
        for (took, lost) in took.iter_mut().zip(lost) {
            *took /= 1.0 + lost;
        }
        return steady(took, count);
    }
    found
}

/// How many rounds there are.
fn rounds(reports: &[Report], took: &mut Each, lost: &mut Each) -> usize {
    let apart = |pair: &[Report]| pair[1].t.wrapping_sub(pair[0].t) as f64;
    let longest = reports.windows(2).map(apart).fold(f64::NEG_INFINITY, f64::max);
    let mut count = 0;
    let mut begin = 0;
    for (k, pair) in reports.windows(2).enumerate() {
        if apart(pair) > longest / ROUND {
            took[count] = pair[1].t.wrapping_sub(reports[begin].t) as f64;
            lost[count] = pair[1].lost.wrapping_sub(reports[begin].lost) as f64;
            (begin, count) = (k + 1, count + 1);
        }
    }
    count
}

/// The usual one of so many, 0.0 if they are not alike.
fn steady(took: Each, count: usize) -> f64 {
    let mut ranked = took;
    let ranked = &mut ranked[..count];
    ranked.sort_unstable_by(f64::total_cmp);
    let (Some(&least), Some(&most)) = (ranked.first(), ranked.last()) else {
        return 0.0;
    };
    let half = count / 2;
    let usual = f64::midpoint(ranked[half], ranked[count - half - 1]);
    let alike = if count < MANY {
        usual - least <= STRICT * usual && most - usual <= STRICT * usual
    } else {
        let near = |one: &&f64| **one >= SHORT * usual && **one <= LONG * usual;
        ranked.iter().filter(near).count() as f64 >= MOSTLY * count as f64
    };
    if alike {
        usual
    } else {
        0.0
    }
}

#[cfg(test)]
#[allow(clippy::float_cmp)] // the period that is told, and no other
mod tests {
    use super::{period, Report};

    fn reports(t: &[i64]) -> Vec<Report> {
        t.iter().map(|&t| Report { t, lost: 0 }).collect()
    }

    #[test]
    fn a_steady_pace_has_a_period() {
        assert_eq!(period(&reports(&[0, 10, 21, 30]), 4), 10.0);
        assert_eq!(period(&reports(&[0, 10, 21, 30]), 5), 0.0, "too few");
        assert_eq!(period(&reports(&[0, 10, 30, 40]), 4), 0.0, "not alike");
        assert_eq!(period(&reports(&[0]), 0), 0.0);
        assert_eq!(period(&[], 0), 0.0);
    }

    #[test]
    fn several_close_together_are_one_round() {
        assert_eq!(period(&reports(&[0, 1, 100, 102, 200, 201, 300]), 4), 100.0);
    }

    #[test]
    fn many_rounds_may_be_less_regular_than_few() {
        let mut t: Vec<i64> = (0..9).map(|k| 100 * k).collect();
        t.push(1500);
        assert_eq!(period(&reports(&t), 4), 100.0, "eight of nine are alike");
        assert_eq!(period(&reports(&t[5..]), 4), 0.0);
        t.push(3000);
        t.push(5000);
        assert_eq!(period(&reports(&t), 4), 0.0, "eight of eleven are too few");
    }

    #[test]
    fn what_was_lost_may_be_why_it_is_not_steady() {
        let lost = |some: [(i64, i64); 5]| some.map(|(t, lost)| Report { t, lost });
        assert_eq!(period(&lost([(0, 0), (10, 0), (40, 2), (50, 2), (60, 2)]), 4), 10.0);
        assert_eq!(period(&lost([(0, 0), (10, 0), (40, 0), (50, 0), (60, 0)]), 4), 0.0);
    }

    #[test]
    fn a_clock_that_is_set_back_is_no_pace() {
        assert_eq!(period(&reports(&[50, 40, 30, 20, 10]), 4), 0.0);
        assert_eq!(period(&reports(&[i64::MAX, i64::MIN, 0, 5]), 2), 0.0);
    }
}
