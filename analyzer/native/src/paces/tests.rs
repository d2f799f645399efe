//! Tests of breaks.
#![forbid(unsafe_code)]

use super::{Break, Limits, Paces, Report};

const LIMITS: Limits = Limits {
    least: 100,
    periods: 5.0,
    fewest: 4,
    span: 0,
    alike: 2.5,
    slowest: 2_500_000_000,
};

fn reports(t: impl IntoIterator<Item = i64>) -> Vec<Report> {
    t.into_iter().map(|t| Report { t, lost: 0 }).collect()
}

/// Twenty reports at a pace, and some from a time on.
fn paused(from: i64, some: i64) -> Vec<Report> {
    reports((0..20).map(|k| 50 * k).chain((0..some).map(|k| from + 50 * k)))
}

/// What is found if reports come so many at a time, and whether breaks of earlier ones are settled.
fn fed(limits: Limits, reports: &[Report], step: usize) -> (Vec<Break>, Vec<bool>) {
    let (mut paces, mut found, mut settled) = (Paces::new(limits), vec![], vec![]);
    for part in reports.chunks(step) {
        settled.extend(paces.feed(0, part, &mut found));
    }
    (found, settled)
}

fn times(found: &[Break]) -> Vec<(i64, i64)> {
    found.iter().map(|one| (one.start, one.stop)).collect()
}

#[test]
fn a_break_is_told_with_the_period_before_it() {
    let (found, settled) = fed(LIMITS, &paused(1500, 10), 100);
    let expected = Break {
        start: 950,
        stop: 1500,
        period: 50.0,
        at: 19,
        kept: true,
        lowered: Some(false),
    };
    assert_eq!((found, settled), (vec![expected], vec![]));
    assert!(fed(LIMITS, &paused(1100, 10), 100).0.is_empty(), "not long enough");
}

#[test]
fn it_does_not_matter_how_reports_are_cut() {
    for step in 1..30 {
        let (found, settled) = fed(LIMITS, &paused(1500, 10), step);
        assert_eq!(times(&found), [(950, 1500)], "{step} at a time");
        let cut_before = 20 % step == 0;
        assert_eq!(found[0].at, if cut_before { -1 } else { 19 % step as i64 });
        let later = found[0].lowered.is_none();
        assert_eq!(settled, vec![false; usize::from(later)]);
    }
}

#[test]
fn a_sender_that_reports_less_often_from_then_on_has_no_second_break() {
    let mut slower = paused(1250, 1);
    slower.extend(reports((1..6).map(|k| 1250 + 300 * k)));
    let (found, _) = fed(LIMITS, &slower, 100);
    assert_eq!(times(&found), [(950, 1250)]);
    assert_eq!(found[0].lowered, Some(true));
    slower[20..].iter_mut().for_each(|one| one.lost = 2);
    assert_eq!(fed(LIMITS, &slower, 100).0[0].lowered, Some(false), "some were lost");
}

#[test]
fn a_pace_is_one_after_enough_reports_and_time() {
    let late = Limits { span: 951, ..LIMITS };
    assert!(fed(late, &paused(1500, 10), 7).0.is_empty());
    let exact = Limits { span: 950, ..LIMITS };
    assert_eq!(times(&fed(exact, &paused(1500, 10), 7).0), [(950, 1500)]);
    let few = reports([0, 50, 100, 900]);
    assert!(fed(LIMITS, &few, 4).0.is_empty());
    assert_eq!(times(&fed(LIMITS, &reports([0, 50, 100, 150, 900]), 5).0), [(150, 900)]);
}

#[test]
fn a_report_that_is_stamped_too_early_makes_no_break() {
    let mut late = paused(0, 0);
    late.extend(reports([700, 1210])); // 510 behind the early one, 260 behind the one before it
    assert!(fed(Limits { periods: 6.0, ..LIMITS }, &late, 100).0.is_empty());
}

#[test]
fn a_time_that_is_not_far_beyond_many_is_no_break() {
    let mut t: Vec<i64> = (0..16).map(|k| 200 * k).collect();
    t.extend([3000 + 590, 3000 + 800]);
    let limits = Limits { periods: 2.0, ..LIMITS };
    assert!(fed(limits, &reports(t.clone()), 100).0.is_empty());
    t[16] = 3000 + 610;
    assert_eq!(times(&fed(limits, &reports(t), 100).0), [(3000, 3610)]);
}

#[test]
fn what_lasts_until_now_is_a_break_if_it_is_longer_than_one() {
    let mut paces = Paces::new(LIMITS);
    let mut found = vec![];
    paces.feed(1, &paused(1500, 1), &mut found);
    assert_eq!(paces.last().collect::<Vec<_>>(), [0, 1500]);
    assert!(
        paces.silences(&[0, 1500 + 550]).is_empty(),
        "as long as the break before"
    );
    let silent = paces.silences(&[0, 1500 + 5 * 550 + 1]);
    assert_eq!(silent.len(), 1);
    assert_eq!((silent[0].0, silent[0].1.start, silent[0].1.period), (1, 1500, 50.0));
    assert_eq!(paces.feed(1, &[], &mut found), None);
}
