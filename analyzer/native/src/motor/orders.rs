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

/// Goes over commands as the reports go on. Those that came between two reports are a block, seen once as a whole.
struct Window<'a> {
    orders: &'a Orders<'a>,
    length: i64,
    start: usize,
    stop: usize,
    edge: usize,             // where the block ends that it begins in
    blocks: VecDeque<usize>, // where those behind that end
    lows: VecDeque<Extreme>, // of these, below all that follow them
    highs: VecDeque<Extreme>,
    sum: f64,
    unknown: usize,
}

/// The lowest or highest command of a block that ends at `stop`.
struct Extreme {
    stop: usize,
    percent: f32,
}

impl<'a> Window<'a> {
    fn new(orders: &'a Orders<'a>, length: i64) -> Self {
        Window {
            orders,
            length,
            start: 0,
            stop: 0,
            edge: 0,
            blocks: VecDeque::new(),
            lows: VecDeque::new(),
            highs: VecDeque::new(),
            sum: 0.0,
            unknown: 0,
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
        let (mut low, mut high) = extremes(&orders.percent[start..self.edge]);
        low = self.lows.front().map_or(low, |one| low.min(one.percent));
        high = self.highs.front().map_or(high, |one| high.max(one.percent));
        Some(Ordered {
            lowest: f64::from(low),
            highest: f64::from(high),
            mean: self.sum / f64::from((stop - start) as u32),
            last,
        })
    }

    fn go(&mut self, start: usize, stop: usize) {
        if start < self.start || stop < self.stop || start >= self.stop {
            (self.start, self.stop, self.edge, self.sum, self.unknown) = (start, start, start, 0.0, 0);
            self.blocks.clear();
            self.lows.clear();
            self.highs.clear();
        }
        let percent = self.orders.percent;
        if stop > self.stop {
            let block = &percent[self.stop..stop];
            let (sum, unknown) = total(block);
            (self.sum, self.unknown) = (self.sum + sum, self.unknown + unknown);
            let (low, high) = extremes(block);
            self.blocks.push_back(stop);
            push(&mut self.lows, stop, low, |one| one >= low);
            push(&mut self.highs, stop, high, |one| one <= high);
        }
        let (sum, unknown) = total(&percent[self.start..start]);
        (self.sum, self.unknown) = (self.sum - sum, self.unknown - unknown);
        while self.edge <= start {
            match self.blocks.pop_front() {
                Some(edge) => self.edge = edge,
                None => break,
            }
        }
        for extremes in [&mut self.lows, &mut self.highs] {
            while extremes.front().is_some_and(|one| one.stop <= self.edge) {
                extremes.pop_front();
            }
        }
        (self.start, self.stop) = (start, stop);
    }
}

fn push(extremes: &mut VecDeque<Extreme>, stop: usize, percent: f32, hidden: impl Fn(f32) -> bool) {
    while extremes.back().is_some_and(|one| hidden(one.percent)) {
        extremes.pop_back();
    }
    extremes.push_back(Extreme { stop, percent });
}

/// The lowest and the highest command, of those that say something.
fn extremes(percent: &[f32]) -> (f32, f32) {
    percent
        .iter()
        .fold((f32::INFINITY, f32::NEG_INFINITY), |(low, high), &one| {
            (low.min(one), high.max(one))
        })
}

/// The sum of commands, and how many say nothing.
fn total(percent: &[f32]) -> (f64, usize) {
    percent.iter().fold((0.0, 0), |(sum, unknown), &one| {
        if one.is_nan() {
            (sum, unknown + 1)
        } else {
            (sum + f64::from(one), unknown)
        }
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
