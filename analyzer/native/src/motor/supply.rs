//! The supply voltage that a current explains: V0 - R*I, fitted to what a device reported before.
#![forbid(unsafe_code)]

/// A line is drawn after so many reports, then a quarter more, then every so many.
const FIRST: u64 = 32;
const SHARE: u64 = 4;
const MOST: u64 = 1024;
/// Reports that a line is drawn through at least.
const FEWEST: f64 = 32.0;
/// A of standard deviation, below which nothing is known of a resistance.
const LEAST_SPREAD: f64 = 2.0;
/// Reports after which what came before counts half.
const HALF: f64 = 4096.0;

/// Sums over reports. What is expected depends on how many came before, not on how they came.
#[derive(Debug)]
pub struct SupplyLine {
    count: u64,
    next: u64,
    /// One, I, V, I*I, I*V.
    sums: [f64; 5],
    drawn: Option<(f64, f64)>,
    older: Option<(f64, f64)>,
}

impl Default for SupplyLine {
    fn default() -> Self {
        SupplyLine {
            count: 0,
            next: FIRST,
            sums: [0.0; 5],
            drawn: None,
            older: None,
        }
    }
}

impl SupplyLine {
    /// Takes reports of one device, in order: what was to be expected of each, NaN where nothing is known. None if
    /// columns do not fit together.
    pub fn feed(&mut self, volts: &[f64], amperes: &[f64]) -> Option<Vec<f64>> {
        if volts.len() != amperes.len() {
            return None;
        }
        let mut expected = Vec::with_capacity(volts.len());
        for (&volts, &amperes) in volts.iter().zip(amperes) {
            expected.push(self.older.map_or(f64::NAN, |(open, slope)| open + slope * amperes));
            if volts.is_finite() && amperes.is_finite() {
                let values = [1.0, amperes, volts, amperes * amperes, amperes * volts];
                for (sum, value) in self.sums.iter_mut().zip(values) {
                    *sum += value;
                }
            }
            self.count += 1;
            if self.count == self.next {
                self.draw();
            }
        }
        Some(expected)
    }

    fn draw(&mut self) {
        self.next += (self.count / SHARE).clamp(FIRST, MOST);
        self.older = self.drawn;
        let [one, i, v, ii, iv] = self.sums;
        if one >= FEWEST {
            let spread = ii / one - (i / one).powi(2);
            let slope = (iv / one - i * v / one / one) / spread;
            let known = spread > LEAST_SPREAD.powi(2) && slope <= 0.0;
            self.drawn = known.then(|| (v / one - slope * i / one, slope));
        }
        if one > HALF {
            for sum in &mut self.sums {
                *sum /= 2.0;
            }
        }
    }
}
