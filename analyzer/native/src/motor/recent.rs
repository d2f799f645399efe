//! The last values of something that is told report by report.
#![forbid(unsafe_code)]

/// So many of them; what came before the first is `nothing`.
#[derive(Debug)]
pub struct Recent {
    values: Vec<f64>,
    next: usize,
    most: f64,
    enough: f64,
    less: usize, // values that are not at least `enough`
}

/// More than all the rounding of a sum of a few values.
const ROUNDING: f64 = 1e-9;

impl Recent {
    /// `few` is the mean that is asked for, see `less`.
    pub fn new(many: usize, nothing: f64, few: f64) -> Self {
        let enough = few + few.abs() * ROUNDING;
        let values = vec![nothing; many.max(1)];
        Recent {
            less: values.iter().filter(|&&value| below(value, enough)).count(),
            values,
            next: 0,
            most: nothing,
            enough,
        }
    }

    pub fn push(&mut self, value: f64) {
        let old = std::mem::replace(&mut self.values[self.next], value);
        self.next += 1;
        if self.next == self.values.len() {
            self.next = 0;
        }
        self.less += usize::from(below(value, self.enough));
        self.less -= usize::from(below(old, self.enough));
        if value >= self.most {
            self.most = value;
        } else if old >= self.most {
            self.most = self.values.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        }
    }

    /// Whether all are numbers, and their sum is less than one; that is no less than that of as many means.
    pub fn less(&self, sum: f64) -> bool {
        if self.less == 0 {
            return false; // none of them is below the mean: mostly nothing has to be added up
        }
        let all: f64 = self.values.iter().sum(); // in the order of the ring, so that no error of rounding is kept
        all.is_finite() && all < sum
    }

    /// The highest.
    pub fn most(&self) -> f64 {
        self.most
    }
}

fn below(value: f64, enough: f64) -> bool {
    value.is_nan() || value < enough
}

#[cfg(test)]
mod tests {
    use super::Recent;

    #[test]
    fn a_sum_is_less_once_all_values_are_numbers_and_their_mean_is_too_low() {
        let mut recent = Recent::new(3, f64::NAN, 0.5);
        let (nan, inf) = (f64::NAN, f64::INFINITY);
        let values = [0.1, 0.5, 0.4, 1.0, 0.6, 0.5, 0.5, 0.4, nan, 0.1, 0.1, 0.1, inf];
        let less = (0..values.len()).filter(|&at| {
            recent.push(values[at]);
            recent.less(1.5)
        });
        assert_eq!(less.collect::<Vec<_>>(), [2, 7, 11]);
    }

    #[test]
    fn the_highest_is_that_of_the_last_values() {
        let mut recent = Recent::new(2, f64::NEG_INFINITY, 0.0);
        let most: Vec<f64> = [1.0, 5.0, 2.0, 3.0]
            .map(|value| {
                recent.push(value);
                recent.most()
            })
            .to_vec();
        assert_eq!(most, [1.0, 5.0, 5.0, 3.0]);
    }
}
