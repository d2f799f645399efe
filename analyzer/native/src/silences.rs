//! Which frame was the last one before a time without any: one that came late hides others.
#![forbid(unsafe_code)]
#![allow(clippy::cast_precision_loss)] // as the times of a capture are compared with a setting

/// Of frames, by their places in the order in which they came, that came more than `silence` ns behind the one before
/// them: which of the `mixed` before each is the latest that is not later than the one before it by a silence.
///
/// None if there is no frame before one of them.
pub fn last_before(t: &[i64], late: &[i64], silence: f64, mixed: usize) -> Option<Vec<i64>> {
    let latest = |&row: &i64| {
        let row = usize::try_from(row).ok()?;
        let most = *t.get(..row)?.last()? as f64 + silence;
        let begin = row.saturating_sub(mixed);
        let times = t[begin..row].iter().enumerate().filter(|(_, &t)| t as f64 <= most);
        let (at, _) = times.reduce(|last, one| if one.1 > last.1 { one } else { last })?;
        Some((begin + at) as i64)
    };
    late.iter().map(latest).collect()
}

#[cfg(test)]
mod tests {
    use super::last_before;

    #[test]
    fn the_last_one_is_the_latest_of_those_that_may_be_mixed_up() {
        let t = [0, 40, 30, 20, 90, 5, 60];
        assert_eq!(last_before(&t, &[4, 6], 10.0, 64).unwrap(), [2, 5]);
        assert_eq!(last_before(&t, &[4, 6], 20.0, 64).unwrap(), [1, 3]);
        assert_eq!(last_before(&t, &[4, 6], 20.0, 2).unwrap(), [2, 5]);
        assert_eq!(
            last_before(&[7, 7, 20], &[2], 10.0, 64).unwrap(),
            [0],
            "the first of several"
        );
    }

    #[test]
    fn there_is_one_before() {
        assert_eq!(last_before(&[1, 2], &[0], 1.0, 64), None);
        assert_eq!(last_before(&[1, 2], &[3], 1.0, 64), None);
        assert_eq!(last_before(&[1, 2], &[-1], 1.0, 64), None);
        assert_eq!(last_before(&[], &[], 1.0, 64), Some(vec![]));
    }
}
