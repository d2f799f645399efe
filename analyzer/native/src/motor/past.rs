//! The past of one ESC: speed and current that it had at commands that were held for a while.
#![forbid(unsafe_code)]

/// % of command in a bin.
const BIN: f64 = 5.0;
/// Up to 200 %.
const BINS: usize = 41;
/// Reports of a bin that counts: their mean is good to half of the noise of one.
const FEWEST: f64 = 4.0;
/// Bins that are near: farther ones are a guess.
const NEAR: usize = 2;
/// A current grows so with the speed: torque with its square, duty cycle with itself.
pub const LAW: i32 = 3;
/// A past is drawn after so many reports, then a quarter more, then every so many.
const FIRST: u64 = 16;
const SHARE: u64 = 4;
const MOST: u64 = 1024;
/// Reports of a bin that weigh as much as all before.
const KEPT: f64 = 4096.0;

/// Reports, command, speed for a volt, current, volts: of a bin.
type Sums = [f64; 5];

/// What a report should say at a command: speed, current (NaN if unknown); `far` where it never had such a one.
#[derive(Debug)]
pub struct Expected {
    pub speed: f64,
    pub current: f64,
    pub far: bool,
}

#[derive(Clone, Copy, Debug)]
struct Known {
    command: f64,
    speed: f64,
    current: f64,
    volts: f64,
    far: bool,
}

/// Sums by bins of commands. What is expected of a report depends on how many came before, not on how they came.
#[derive(Debug)]
pub struct Past {
    learned: f64,
    count: u64,
    next: u64,
    sums: [Sums; BINS],
    pending: [Sums; BINS],
    fresh: bool,
    known: Option<Box<[Known; BINS]>>,
}

impl Past {
    /// `learned` are the calm reports before which nothing is known.
    pub fn new(learned: f64) -> Self {
        Past {
            learned,
            count: 0,
            next: FIRST,
            sums: [[0.0; 5]; BINS],
            pending: [[0.0; 5]; BINS],
            fresh: false,
            known: None,
        }
    }

    /// What a report should say; None while there is no past.
    pub fn expected(&self, command: f64, volts: f64) -> Option<Expected> {
        let known = self.known.as_ref()?[bin(command)];
        let share = command / known.command;
        // At the same command a lower voltage turns the motor slower: its torque falls with the square of the speed.
        Some(Expected {
            speed: known.speed * volts * share,
            current: known.current * share.powi(LAW) * (volts / known.volts).powi(2),
            far: known.far,
        })
    }

    /// Takes a report: command, speed for a volt, current and volts of one that is as it should be.
    pub fn add(&mut self, calm: Option<[f64; 4]>) {
        self.count += 1;
        if let Some(values) = calm {
            let pending = &mut self.pending[bin(values[0])];
            pending[0] += 1.0;
            for (sum, value) in pending[1..].iter_mut().zip(values) {
                *sum += value;
            }
            self.fresh = true;
        }
        if self.count >= self.next {
            self.next = self.count + (self.count / SHARE).clamp(FIRST, MOST);
            if self.fresh {
                self.draw();
            }
        }
    }

    fn draw(&mut self) {
        for (sums, pending) in self.sums.iter_mut().zip(&mut self.pending) {
            for (sum, value) in sums.iter_mut().zip(&*pending) {
                *sum += value;
            }
            if sums[0] > KEPT {
                for sum in sums.iter_mut() {
                    *sum /= 2.0;
                }
            }
            *pending = [0.0; 5];
        }
        self.fresh = false;
        let total: f64 = self.sums.iter().map(|sums| sums[0]).sum();
        let good: Vec<usize> = (0..BINS).filter(|&bin| self.sums[bin][0] >= FEWEST).collect();
        if total < self.learned || good.is_empty() {
            return;
        }
        let nearest = |bin: usize| {
            good.iter()
                .copied()
                .min_by_key(|&one| (one.abs_diff(bin), one))
                .unwrap_or(bin)
        };
        self.known = Some(Box::new(std::array::from_fn(|bin| {
            let near = nearest(bin);
            let [count, command, speed, current, volts] = self.sums[near];
            Known {
                command: command / count,
                speed: speed / count,
                current: current / count,
                volts: volts / count,
                far: near.abs_diff(bin) > NEAR,
            }
        })));
    }
}

fn bin(command: f64) -> usize {
    ((command / BIN).max(0.0) as usize).min(BINS - 1)
}
