//! Transfers that come again after later ones: their IDs seem to count back, and on from where they were.
#![forbid(unsafe_code)]

use super::places::MOST_MOVED;
use super::step::{Rule, Step, ID};
use crate::diagnosis::index::Frames;
use crate::frames::NO_TIME;

/// Frames before a copy among which those are that it repeats.
const LOOK: u64 = 4096;

/// When what a step back repeats was there, if the next odd step of its session counts on.
///
/// Of 5, 6, 5, 7 the steps are (6, 5) and (5, 7). Each frame of the copy has to be there already, byte for byte.
pub fn time_before(back: &Step, on: &Step, frames: Frames<'_>) -> Option<i64> {
    let behind = back.before.wrapping_sub(back.id) & ID;
    let again = on.before.wrapping_sub(back.id) & ID;
    let fits = matches!(back.rule, Rule::Gap | Rule::Restarted) && on.rule == Rule::Gap;
    let in_order = (1..=MOST_MOVED).contains(&behind) && again < behind && on.id == (back.before + 1) & ID;
    if !fits || !in_order || back.t == NO_TIME {
        return None;
    }
    repeated(&back.frames, frames)
}

/// When the first of some frames was there before, None if not all were.
fn repeated(numbers: &[u64], frames: Frames<'_>) -> Option<i64> {
    let (&first, last) = (numbers.first()?, *numbers.last()?);
    let mut wanted = numbers.iter().rev().map(|&number| frames.whole(number));
    let mut like = wanted.next()??;
    let before = first.saturating_sub(LOOK)..first;
    for kept in frames.latest(frames.session(last)?, &before) {
        if (kept.bus, kept.id, kept.data) == (like.bus, like.id, like.data) {
            match wanted.next() {
                Some(next) => like = next?,
                None => return Some(kept.t).filter(|&t| t != NO_TIME),
            }
        }
    }
    None
}
