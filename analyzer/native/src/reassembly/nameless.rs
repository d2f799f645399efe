//! Frames without a source: anonymous messages, and those of senders that should have a node ID and have none.
//!
//! An anonymous message has 2 bits for its type, above them 14 that were drawn at random. Who only forgets the source puts
//! a type of 16 bits there. So a frame whose 16 bits are a known type goes to a session of that type first, and only a
//! proof makes that a sender: a good CRC, or transfer IDs that rise by one. Without a proof all of its frames go where
//! those with other bits are. Bits that were drawn from the payload, as most senders do, are no type.
#![forbid(unsafe_code)]

use super::{key, Reassembler, Standing};
use crate::slot::Frame;
use crate::trust::Kept;
use crate::verdict::{Outcome, Verdict};
use crate::wire::{crc, nameless_bits, session_bits, Id};

/// The discriminator of an anonymous message may be any 14 of 16 bits.
const WINDOWS: u16 = 3;

impl Reassembler {
    /// The bits of the session in which a frame without a source is heard.
    #[cold]
    pub(super) fn bits_without_source(&mut self, bus: u8, frame: &Frame<'_>) -> u32 {
        let nameless = nameless_bits(frame.id).filter(|&bits| {
            let known = !self.known(Id::of_session(bits)).is_empty();
            known && (self.trusts(bus, bits) || !is_drawn(frame))
        });
        nameless.unwrap_or(session_bits(frame.id))
    }

    fn trusts(&self, bus: u8, bits: u32) -> bool {
        let found = self.index.find(key(bus, bits));
        found.is_some_and(|at| matches!(self.sessions[at].standing, Standing::Trusted(_)))
    }

    /// Hears frames that a session has held as foreign where they belong then.
    pub(super) fn give_back(&mut self, at: usize, kept: &[Kept]) {
        for one in kept {
            let (number, outcome) = (one.frame().number, self.hear_again(at, one));
            if outcome.verdict == Verdict::Foreign && outcome.anomaly != 0 {
                self.report(number, outcome);
            }
            self.correct(number, Verdict::Foreign, outcome);
        }
    }

    /// Hears a frame of a session that is no sender as one of the anonymous.
    pub(super) fn hear_again(&mut self, at: usize, kept: &Kept) -> Outcome {
        let (bus, frame) = (self.sessions[at].bus, kept.frame());
        self.follow(bus, session_bits(frame.id), &frame, kept.remote)
    }
}

/// Whether the bits above the type come from the payload, as those of an anonymous message.
fn is_drawn(frame: &Frame<'_>) -> bool {
    frame.split().is_some_and(|(tail, body)| {
        let (drawn, value) = (crc(0xFFFF, body), (frame.id >> 10) as u16 & 0x3FFF);
        tail.start() && tail.end() && (0..WINDOWS).any(|low| drawn >> low & 0x3FFF == value)
    })
}
