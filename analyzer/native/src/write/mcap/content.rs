//! What all messages of a channel have in common, though their own fields cannot say it.
#![forbid(unsafe_code)]

use crate::frames::{BRS, DLC_SHIFT, ESI, FD, MAX_CLASSIC, RX, TX};

/// Whether a frame was received or sent.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub enum Direction {
    Unknown = 0,
    Received = 1,
    Sent = 2,
}

impl Direction {
    pub(super) fn of(flags: u16) -> Direction {
        match flags & (TX | RX) {
            0 => Direction::Unknown,
            RX => Direction::Received,
            _ => Direction::Sent,
        }
    }
}

/// What the messages are.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Content {
    /// Frames or error frames with these bits of [`crate::frames`]: CAN FD with its two flags, or a raw length code.
    Frames(u16),
    Drops,
    Comments,
}

impl Content {
    /// Classic, 4 of CAN FD, raw length codes 9 to 15, drops, comments.
    pub(super) const COUNT: usize = 14;

    pub(super) fn of(flags: u16) -> Content {
        Content::Frames(match flags & FD {
            0 if usize::from(flags >> DLC_SHIFT & 15) > MAX_CLASSIC => flags & 15 << DLC_SHIFT,
            0 => 0,
            _ => flags & (FD | BRS | ESI),
        })
    }

    pub(super) fn is_fd(self) -> bool {
        matches!(self, Content::Frames(bits) if bits & FD != 0)
    }

    pub(super) fn index(self) -> usize {
        match self {
            Content::Frames(bits) if bits & FD != 0 => {
                1 + usize::from(bits & BRS != 0) + 2 * usize::from(bits & ESI != 0)
            }
            Content::Frames(0) => 0,
            Content::Frames(bits) => usize::from(bits >> DLC_SHIFT & 15) - 4,
            Content::Drops => 12,
            Content::Comments => 13,
        }
    }
}
