//! The last values of something that is told report by report.
#![forbid(unsafe_code)]

/// So many of them; what came before the first is `nothing`.
#[derive(Debug)]
pub struct Recent {
    values: Vec<f64>,
    next: usize,
}

impl Recent {
    pub fn new(many: usize, nothing: f64) -> Self {
        Recent {
            values: vec![nothing; many.max(1)],
            next: 0,
        }
    }

    pub fn push(&mut self, value: f64) {
        self.values[self.next] = value;
        self.next = (self.next + 1) % self.values.len();
    }

    /// Their sum, in the order of the ring; None if one of them is no number.
    pub fn sum(&self) -> Option<f64> {
        let sum = self.values.iter().sum::<f64>();
        sum.is_finite().then_some(sum)
    }

    /// The highest.
    pub fn most(&self) -> f64 {
        self.values.iter().copied().fold(f64::NEG_INFINITY, f64::max)
    }
}
