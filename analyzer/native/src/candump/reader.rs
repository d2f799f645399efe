//! Candump text behind the door that all formats share: its own line numbers and names become those of the rows.
#![forbid(unsafe_code)]

use super::Candump;
use crate::frame_batch::FrameBatch;
use crate::reader::{Reader, Rows};

impl Reader for Candump {
    fn feed(&mut self, bytes: &[u8], rows: &mut Rows) {
        self.read(bytes, rows.batch_mut());
    }

    fn finish(&mut self, rows: &mut Rows) {
        self.close(rows.batch_mut());
    }
}

impl Candump {
    /// Appends the rows of further text, and what became of its lines.
    pub fn read(&mut self, text: &[u8], batch: &mut FrameBatch) {
        self.add(batch, |candump, batch| {
            Candump::feed(candump, text, &mut batch.frames, &mut batch.events);
        });
    }

    /// Appends what the end of the input still gives.
    pub fn close(&mut self, batch: &mut FrameBatch) {
        self.add(batch, |candump, batch| {
            Candump::finish(candump, &mut batch.frames, &mut batch.events);
        });
    }

    fn add(&mut self, batch: &mut FrameBatch, step: impl FnOnce(&mut Candump, &mut FrameBatch)) {
        let before = self.counts;
        step(self, batch);
        batch.counts.add(&self.counts.since(&before));
        batch.stamps.insert(self.stamps);
        if batch.buses.names().len() < self.buses.names().len() {
            batch.buses.clone_from(&self.buses);
        }
    }
}
