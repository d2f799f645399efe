//! What steps are judged by, beside what their node sent.
#![forbid(unsafe_code)]

use crate::diagnosis::counters::Gaps;
use crate::diagnosis::index::Frames;

/// Frames of the recent past, gaps of the capture, how many transfers show a sender; the numbers of a transfer's frames
/// by its row in the batch.
#[derive(Clone, Copy)]
pub struct Around<'a> {
    pub frames: Frames<'a>,
    pub gaps: Gaps<'a>,
    pub least: u32,
    pub frames_of: &'a dyn Fn(u32) -> Vec<u64>,
}
