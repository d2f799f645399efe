//! What a motor was commanded before a report: the commands of a window of time that ends with it.
#![forbid(unsafe_code)]

use std::collections::VecDeque;

/// Commands of one channel in order: when, the last frame of each, and how much, in %; NaN for none.
#[derive(Debug)]
pub struct Orders<'a> {
    pub ran: &'a [i64],
    pub frame_end: &'a [i64],
    pub percent: &'a [f32],
}

impl Orders<'_> {
    fn fit(&self) -> bool {
        self.ran.len() == self.frame_end.len() && self.ran.len() == self.percent.len()
    }
}

/// The command before a report, within the window: the lowest, the highest, the mean and the last, in %.
///
/// The first three are NaN if one command in it says nothing.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ordered {
    pub lowest: f64,
    pub highest: f64,
    pub mean: f64,
    pub last: f64,
}

impl Ordered {
    const NONE: Self = Ordered {
        lowest: f64::NAN,
        highest: f64::NAN,
        mean: f64::NAN,
        last: f64::NAN,
    };
}

/// What was commanded before each report: the commands of a `window` in ns that were whole before it began; NaN for none.
///
/// `ran` are times of reports while it was recorded, `frame` the first frame of each. None if columns do not fit together.
pub fn ordered(orders: &Orders<'_>, ran: &[i64], frame: &[i64], window: i64) -> Option<[Vec<f64>; 4]> {
    if !orders.fit() || ran.len() != frame.len() {
        return None;
    }
    let mut window = Window::new(orders, window);
    let mut found: [Vec<f64>; 4] = std::array::from_fn(|_| Vec::with_capacity(ran.len()));
    for (&ran, &frame) in ran.iter().zip(frame) {
        let one = window.before(ran, frame).unwrap_or(Ordered::NONE);
        for (column, value) in found.iter_mut().zip([one.lowest, one.highest, one.mean, one.last]) {
            column.push(value);
        }
    }
    Some(found)
}

/// Commands that came between two reports: up to which place, and the lowest and the highest of them; NaN says nothing.
#[derive(Clone, Copy)]
struct Chunk {
    stop: usize,
    lowest: f32,
    highest: f32,
}

/// Goes over commands as the reports go on.
struct Window<'a> {
    orders: &'a Orders<'a>,
    length: i64,
    start: usize,
    stop: usize,
    sum: f64,
    unknown: usize,
    chunks: VecDeque<Chunk>, // that end within the window
    lows: VecDeque<Chunk>,   // below all that follow them
    highs: VecDeque<Chunk>,  // above all that follow them
}

impl<'a> Window<'a> {
    fn new(orders: &'a Orders<'a>, length: i64) -> Self {
        Window {
            orders,
            length,
            start: 0,
            stop: 0,
            sum: 0.0,
            unknown: 0,
            chunks: VecDeque::new(),
            lows: VecDeque::new(),
            highs: VecDeque::new(),
        }
    }

    /// The commands that were whole before a report began; None if the first of them is none for this channel.
    fn before(&mut self, ran: i64, frame: i64) -> Option<Ordered> {
        let orders = self.orders;
        let stop = from(orders.frame_end, self.stop, |end| end < frame).min(from(orders.ran, self.stop, |t| t <= ran));
        let since = ran.saturating_sub(self.length);
        let start = from(orders.ran, self.start, |t| t < since);
        if start >= stop || orders.percent[start].is_nan() {
            return None;
        }
        self.go(start, stop);
        let last = f64::from(orders.percent[stop - 1]);
        if self.unknown > 0 {
            return Some(Ordered { last, ..Ordered::NONE });
        }
        // The first chunk may have begun before the window.
        let border = self.chunks.front().map_or(stop, |chunk| chunk.stop);
        let (mut lowest, mut highest) = extremes(&orders.percent[start..border]);
        if let Some(low) = self.lows.iter().find(|chunk| chunk.stop > border) {
            lowest = lowest.min(low.lowest);
        }
        if let Some(high) = self.highs.iter().find(|chunk| chunk.stop > border) {
            highest = highest.max(high.highest);
        }
        Some(Ordered {
            lowest: f64::from(lowest),
            highest: f64::from(highest),
            mean: self.sum / f64::from((stop - start) as u32),
            last,
        })
    }

    fn go(&mut self, start: usize, stop: usize) {
        if start < self.start || stop < self.stop || start >= self.stop {
            (self.start, self.stop, self.sum, self.unknown) = (start, start, 0.0, 0);
            for chunks in [&mut self.chunks, &mut self.lows, &mut self.highs] {
                chunks.clear();
            }
        }
        let percent = self.orders.percent;
        if stop > self.stop {
            let fresh = &percent[self.stop..stop];
            for &value in fresh {
                if value.is_nan() {
                    self.unknown += 1;
                } else {
                    self.sum += f64::from(value);
                }
            }
            let (lowest, highest) = extremes(fresh);
            let chunk = Chunk { stop, lowest, highest };
            while self.lows.back().is_some_and(|low| low.lowest >= lowest) {
                self.lows.pop_back();
            }
            while self.highs.back().is_some_and(|high| high.highest <= highest) {
                self.highs.pop_back();
            }
            for chunks in [&mut self.chunks, &mut self.lows, &mut self.highs] {
                chunks.push_back(chunk);
            }
        }
        for &value in &percent[self.start..start] {
            if value.is_nan() {
                self.unknown -= 1;
            } else {
                self.sum -= f64::from(value);
            }
        }
        for chunks in [&mut self.chunks, &mut self.lows, &mut self.highs] {
            while chunks.front().is_some_and(|chunk| chunk.stop <= start) {
                chunks.pop_front();
            }
        }
        (self.start, self.stop) = (start, stop);
    }
}

/// The lowest and the highest; infinite where there is none.
fn extremes(values: &[f32]) -> (f32, f32) {
    values
        .iter()
        .fold((f32::INFINITY, f32::NEG_INFINITY), |(low, high), &value| {
            (low.min(value), high.max(value))
        })
}

/// How many in order something holds for, which is likely a little more than it was.
fn from(numbers: &[i64], likely: usize, holds: impl Fn(i64) -> bool) -> usize {
    const STEPS: usize = 16;
    let likely = likely.min(numbers.len());
    if likely > 0 && !holds(numbers[likely - 1]) {
        return numbers[..likely].partition_point(|&one| holds(one));
    }
    let near = &numbers[likely..numbers.len().min(likely + STEPS)];
    match near.iter().position(|&one| !holds(one)) {
        Some(more) => likely + more,
        None => likely + numbers[likely..].partition_point(|&one| holds(one)),
    }
}
