//! The last values of something that is told report by report.
#![forbid(unsafe_code)]

/// So many of them; what came before the first is `nothing`.
#[derive(Debug)]
pub struct Recent {
    values: Vec<f64>,
    next: usize,
    sum: f64,
    most: f64,
}

impl Recent {
    pub fn new(many: usize, nothing: f64) -> Self {
        let values = vec![nothing; many.max(1)];
        Recent {
            sum: values.iter().sum(),
            values,
            next: 0,
            most: nothing,
        }
    }

    pub fn push(&mut self, value: f64) {
        let old = std::mem::replace(&mut self.values[self.next], value);
        self.next += 1;
        if self.next == self.values.len() {
            self.next = 0;
        }
        self.sum = self.values.iter().sum(); // in the order of the ring, so that no error of rounding is kept
        if value >= self.most {
            self.most = value;
        } else if old >= self.most {
            self.most = self.values.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        }
    }

    /// Their sum; None if one of them is no number.
    pub fn sum(&self) -> Option<f64> {
        self.sum.is_finite().then_some(self.sum)
    }

    /// The highest.
    pub fn most(&self) -> f64 {
        self.most
    }
}
