//! Candump text behind the door that all formats share: its own line numbers and names become those of the rows.
#![forbid(unsafe_code)]

use super::Candump;
use crate::reader::{Piece, Reader, Rows};

impl Reader for Candump {
    fn feed(&mut self, bytes: &[u8], rows: &mut Rows) {
        self.add(rows, |candump, piece| {
            Candump::feed(candump, bytes, &mut piece.frames, &mut piece.events);
        });
    }

    fn finish(&mut self, rows: &mut Rows) {
        self.add(rows, |candump, piece| {
            Candump::finish(candump, &mut piece.frames, &mut piece.events);
        });
    }
}

impl Candump {
    fn add(&mut self, rows: &mut Rows, step: impl FnOnce(&mut Candump, &mut Piece)) {
        let (before, piece) = (self.counts, rows.piece_mut());
        step(self, piece);
        piece.counts.add(&self.counts.since(&before));
        piece.stamps.insert(self.stamps);
        piece.buses.clone_from(&self.buses);
    }
}
