//! The commands of a bus as far back as a report is compared with them.
#![forbid(unsafe_code)]

use super::orders::{ordered, Orders};

/// Keeps the commands of a batch, and those of two windows before it; so many of a bus at most.
#[derive(Debug)]
pub struct CommandLog {
    window: i64,
    most: usize,
    ran: Vec<i64>,
    frame_end: Vec<i64>,
    channels: Vec<Vec<f32>>,
}

impl CommandLog {
    /// `window` in ns, `most` commands are kept of what came before.
    pub fn new(window: i64, most: usize) -> Self {
        CommandLog {
            window,
            most,
            ran: Vec::new(),
            frame_end: Vec::new(),
            channels: Vec::new(),
        }
    }

    /// Takes the next commands: when, their last frames, and `percent`, one channel behind the other, of which the first
    /// one has the number `first`. None if columns do not fit together.
    pub fn feed(&mut self, first: usize, ran: &[i64], frame_end: &[i64], percent: &[f32]) -> Option<()> {
        let count = ran.len();
        if count == 0 || frame_end.len() != count || !percent.len().is_multiple_of(count) {
            return None;
        }
        let channels = first + percent.len() / count;
        if self.channels.len() != channels {
            self.ran.clear();
            self.frame_end.clear();
            self.channels = vec![Vec::new(); channels];
        }
        let since = self.ran.last().map_or(0, |last| last - 2 * self.window);
        let old = self
            .ran
            .partition_point(|&t| t < since)
            .max(self.ran.len().saturating_sub(self.most));
        for (kept, new) in [(&mut self.ran, ran), (&mut self.frame_end, frame_end)] {
            kept.drain(..old);
            let mut highest = kept.last().copied().unwrap_or(i64::MIN);
            kept.extend(new.iter().map(|&one| {
                highest = highest.max(one);
                highest
            }));
        }
        for (channel, kept) in self.channels.iter_mut().enumerate() {
            kept.drain(..old);
            match channel.checked_sub(first) {
                Some(place) => kept.extend_from_slice(&percent[place * count..(place + 1) * count]),
                None => kept.resize(kept.len() + count, f32::NAN),
            }
        }
        Some(())
    }

    /// What was commanded before each report of a channel, as `ordered` has it; None if there is no such channel.
    pub fn before(&self, channel: usize, ran: &[i64], frame: &[i64]) -> Option<[Vec<f64>; 4]> {
        let orders = Orders {
            ran: &self.ran,
            frame_end: &self.frame_end,
            percent: self.channels.get(channel)?,
        };
        ordered(&orders, ran, frame, self.window)
    }
}
