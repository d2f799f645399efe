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
    pub fn fit(&self) -> bool {
        self.ran.len() == self.frame_end.len() && self.ran.len() == self.percent.len()
    }
}

/// The command before a report, within the window: the least, the most, the mean and the last, in %.
///
/// The first three are NaN if one command in it says nothing.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ordered {
    pub least: f64,
    pub most: f64,
    pub mean: f64,
    pub last: f64,
}

/// Goes over commands as the reports go on.
pub struct Window<'a> {
    orders: &'a Orders<'a>,
    length: i64,
    start: usize,
    stop: usize,
    sum: f64,
    unknown: usize,
    lows: VecDeque<usize>,  // places of commands below all that follow them
    highs: VecDeque<usize>, // above all that follow them
}

impl<'a> Window<'a> {
    pub fn new(orders: &'a Orders<'a>, length: i64) -> Self {
        Window {
            orders,
            length,
            start: 0,
            stop: 0,
            sum: 0.0,
            unknown: 0,
            lows: VecDeque::new(),
            highs: VecDeque::new(),
        }
    }

    /// The commands that were whole before a report began; None if the first of them is none for this channel.
    pub fn before(&mut self, ran: i64, frame: i64) -> Option<Ordered> {
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
            let none = f64::NAN;
            return Some(Ordered {
                least: none,
                most: none,
                mean: none,
                last,
            });
        }
        let at = |places: &VecDeque<usize>| places.front().map_or(last, |&place| f64::from(orders.percent[place]));
        Some(Ordered {
            least: at(&self.lows),
            most: at(&self.highs),
            mean: self.sum / f64::from((stop - start) as u32),
            last,
        })
    }

    fn go(&mut self, start: usize, stop: usize) {
        if start < self.start || stop < self.stop || start >= self.stop {
            (self.start, self.stop, self.sum, self.unknown) = (start, start, 0.0, 0);
            self.lows.clear();
            self.highs.clear();
        }
        let percent = self.orders.percent;
        for (place, &value) in percent.iter().enumerate().take(stop).skip(self.stop) {
            if value.is_nan() {
                self.unknown += 1;
                continue;
            }
            self.sum += f64::from(value);
            while self.lows.back().is_some_and(|&low| percent[low] >= value) {
                self.lows.pop_back();
            }
            while self.highs.back().is_some_and(|&high| percent[high] <= value) {
                self.highs.pop_back();
            }
            self.lows.push_back(place);
            self.highs.push_back(place);
        }
        for &value in &percent[self.start..start] {
            if value.is_nan() {
                self.unknown -= 1;
            } else {
                self.sum -= f64::from(value);
            }
        }
        for places in [&mut self.lows, &mut self.highs] {
            while places.front().is_some_and(|&place| place < start) {
                places.pop_front();
            }
        }
        (self.start, self.stop) = (start, stop);
    }
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
