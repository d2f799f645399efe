//! Transfers whose transfer ID counts up with every frame, where it must stay the same from start to end.
//!
//! How many of them are a proof is said where they are judged, in [`crate::cadence`]. Nothing else is wrong with them: start, toggles and end come and go as in legal transfers. In counters of other
//! protocols these bits, if they change at all, do not follow such a pattern while the five below count on.
#![forbid(unsafe_code)]

use crate::wire::Tail;

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
enum Place {
    /// Not known: the frames before were no such transfer.
    #[default]
    Lost,
    /// A transfer came to its end, the next one must start.
    Between,
    /// Within a transfer, whose next frame has this toggle.
    Inside { toggle: bool },
}

/// How many of these transfers have come without anything else between them.
#[derive(Clone, Copy, Debug, Default)]
pub struct Chain {
    place: Place,
    frames: usize,
    whole: usize,
    broken: bool,
}

impl Chain {
    /// `rose`: the transfer ID is the next one after that of the frame before.
    pub fn note(&mut self, tail: Tail, rose: bool) {
        let fits = match self.place {
            Place::Lost => false,
            Place::Between => tail.start() && !tail.toggle(),
            Place::Inside { toggle } => !tail.start() && tail.toggle() == toggle,
        };
        if rose && fits {
            self.whole += usize::from(tail.end() && !tail.start());
        } else {
            self.broken |= self.place != Place::Lost;
            (self.frames, self.whole) = (0, 0);
            if !tail.start() || tail.toggle() {
                self.place = Place::Lost;
                return;
            }
        }
        self.frames += 1;
        self.place = if tail.end() {
            Place::Between
        } else {
            Place::Inside { toggle: !tail.toggle() }
        };
    }

    /// Whole transfers in a row; those of one frame do not count, they show nothing.
    pub fn whole(&self) -> usize {
        self.whole
    }

    /// How many frames they have, if since the first start nothing else has come.
    pub fn unbroken(&self) -> usize {
        if self.broken {
            0
        } else {
            self.frames
        }
    }
}
