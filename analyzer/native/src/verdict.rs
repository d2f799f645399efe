//! Why a frame is, or is not, part of a transfer.
#![forbid(unsafe_code)]

/// The `verdict` column; the order is that of `VERDICTS` in `analyzer/tables.py`.
///
/// A frame is `Used` exactly when one transfer names it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub enum Verdict {
    Used = 0,
    Foreign = 1,
    NoTail = 2,
    Orphan = 3,
    /// Part of a transfer that began with toggle 1.
    WrongToggle = 4,
    WrongTransferId = 5,
    AnonymousMulti = 6,
    Duplicate = 7,
}

pub const VERDICTS: usize = 8;

/// Bits of the `anomaly` column of a frame. The number in brackets is the rule that reads it.
pub mod frame_anomaly {
    pub const REMOTE: u16 = 1 << 0; // CAN-002
    pub const NO_TAIL: u16 = 1 << 1; // CAN-005
    pub const IMPOSSIBLE_LENGTH: u16 = 1 << 2; // CAN-019
    pub const START_TOGGLE: u16 = 1 << 3; // TRF-002
    pub const TOGGLE: u16 = 1 << 4; // TRF-003: the frame at which the sequence broke
    pub const BACKWARDS: u16 = 1 << 5; // CAP-001
    pub const CYPHAL: u16 = 1 << 6; // toggles start at 1 throughout: Cyphal/CAN, once an identifier
    pub const LIMIT: u16 = 1 << 7; // a bound of the analyzer was reached
}

/// What became of one frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Outcome {
    pub verdict: Verdict,
    /// Bits of [`frame_anomaly`].
    pub anomaly: u16,
}

impl Outcome {
    pub const USED: Outcome = Outcome::of(Verdict::Used);
    pub const FOREIGN: Outcome = Outcome::of(Verdict::Foreign);

    pub const fn of(verdict: Verdict) -> Self {
        Outcome { verdict, anomaly: 0 }
    }

    pub const fn with(verdict: Verdict, anomaly: u16) -> Self {
        Outcome { verdict, anomaly }
    }
}
