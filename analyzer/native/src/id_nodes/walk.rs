//! The messages of a node in a batch, and the uptimes that it states, walked through as its steps come.
#![forbid(unsafe_code)]

use super::begun_anew::Stated;
use super::shared_counter::{Message, SharedCounter};

/// How far they were taken.
#[derive(Debug)]
pub struct Walk<'b> {
    messages: &'b [Message],
    at: usize,
    stated: &'b [Stated],
}

impl<'b> Walk<'b> {
    pub fn new(messages: &'b [Message], stated: &'b [Stated]) -> Self {
        Walk {
            messages,
            at: 0,
            stated,
        }
    }

    /// The next uptime that was stated before a row.
    pub fn stated(&mut self, row: u32) -> Option<Stated> {
        let (first, others) = self.stated.split_first()?;
        if first.row >= row {
            return None;
        }
        self.stated = others;
        Some(*first)
    }

    /// Starts with the message of a row.
    pub fn begin(&mut self, row: u32) {
        self.at = self.messages.partition_point(|one| one.row < row);
    }

    /// Adds all messages up to and with that of a row to a counter, until one does not fit; then it is none.
    pub fn run(&mut self, shared: &mut Option<SharedCounter>, row: u32, frames_of: &dyn Fn(u32) -> Vec<u64>) {
        while let Some(counter) = shared {
            let Some(one) = self.messages.get(self.at).filter(|one| one.row <= row) else {
                return;
            };
            if counter.fits(one, frames_of) {
                self.at += 1;
            } else {
                *shared = None;
            }
        }
    }
}
