//! The second table: one row a DroneCAN transfer, with everything measured about it.
#![forbid(unsafe_code)]

mod kept;
mod staged;

pub use kept::KeptRows;
pub use staged::{Staged, SHORT_FRAMES, SHORT_PAYLOAD};

use crate::frames::room_like;
use crate::wire::Id;

/// How a transfer ended; the order is that of `STATUSES` in `analyzer/tables.py`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub enum Status {
    Ok = 0,
    /// Complete, but no signature is known to check it with.
    Unchecked = 1,
    BadCrc = 2,
    Interrupted = 3,
    TimedOut = 4,
    /// Complete, but too short to hold its CRC.
    TooShort = 5,
    Open = 6,
}

/// Bits of the `anomaly` column of a transfer. The number in brackets is the rule that reads it.
pub mod anomaly {
    pub const SINGLE_TOGGLE: u32 = 1 << 0; // TRF-001
    pub const TOGGLE: u32 = 1 << 1; // TRF-003
    pub const DUPLICATE_FRAME: u32 = 1 << 2; // TRF-004
    pub const ABANDONED: u32 = 1 << 3; // TRF-006
    pub const TIMEOUT: u32 = 1 << 4; // TRF-007
    pub const SLOW: u32 = 1 << 5; // TRF-007, note: longer than the 1 s abort limit
    pub const CRC: u32 = 1 << 6; // TRF-010
    pub const FRAME_NOT_FULL: u32 = 1 << 7; // TRF-012
    pub const LAST_EMPTY: u32 = 1 << 8; // TRF-013
    pub const FIRST_TOO_SHORT: u32 = 1 << 9; // TRF-014
    pub const NEEDLESS_MULTI: u32 = 1 << 10; // TRF-015
    pub const ID_GAP: u32 = 1 << 11; // TRF-016
    pub const DUPLICATE: u32 = 1 << 12; // TRF-017
    pub const ID_REPEATED: u32 = 1 << 13; // TRF-018
    pub const ID_RESTARTED: u32 = 1 << 14; // TRF-019
    pub const INTERLEAVED: u32 = 1 << 15; // TRF-026
    pub const PAUSE: u32 = 1 << 16; // TRF-027
    pub const LONG: u32 = 1 << 17; // TRF-029
    pub const PRIORITY_CHANGED: u32 = 1 << 18; // CAN-014
    pub const DESTINATION_ZERO: u32 = 1 << 19; // CAN-006
    pub const SOURCE_ZERO: u32 = 1 << 20; // CAN-007
    pub const ADDRESSED_TO_ITSELF: u32 = 1 << 21; // CAN-012
    pub const CAN_FD: u32 = 1 << 22; // CAN-003
    pub const CUT_BY_END: u32 = 1 << 23; // TRF-008
    pub const LIMIT: u32 = 1 << 24; // a bound of the analyzer was reached
    pub const OTHER_TYPE: u32 = 1 << 25; // CAN-020: the CRC is that of another type with this ID
}

/// `bit` when the condition holds, without a branch.
#[inline]
pub fn when(condition: bool, bit: u32) -> u32 {
    u32::from(condition) * bit
}

/// The cell of `gap` without a value.
pub const NO_GAP: i64 = i64::MIN;
/// The cell of `step` without a value.
pub const NO_STEP: u8 = u8::MAX;
/// The cell of `known` for a type without a definition.
pub const UNKNOWN: u16 = u16::MAX;

/// One transfer as it is handed to [`Transfers::push`].
#[derive(Clone, Copy, Debug)]
pub struct Row<'a> {
    pub id: Id,
    pub bus: u8,
    pub t: i64,
    pub t_end: i64,
    pub priority: u8,
    pub transfer_id: u8,
    pub status: Status,
    /// The CRC on the wire, and the one computed here.
    pub crc_wire: Option<u16>,
    pub crc_here: Option<u16>,
    pub step: u8,
    pub gap: i64,
    pub anomaly: u32,
    pub fd: bool,
    pub known: u16,
    /// Somebody asks for it: otherwise it only has to be counted.
    pub asked: bool,
    pub frames: &'a [u64],
    pub payload: &'a [u8],
}

impl<'a> Row<'a> {
    /// A transfer without a CRC of which no more is known.
    pub fn bare(id: Id, payload: &'a [u8]) -> Self {
        Row {
            id,
            bus: 0,
            t: 0,
            t_end: 0,
            priority: 0,
            transfer_id: 0,
            status: Status::Unchecked,
            crc_wire: None,
            crc_here: None,
            step: NO_STEP,
            gap: NO_GAP,
            anomaly: 0,
            fd: false,
            known: 0,
            asked: true,
            frames: &[],
            payload,
        }
    }

    fn crc_valid(&self) -> u8 {
        u8::from(self.crc_wire.is_some()) | (u8::from(self.crc_here.is_some()) << 1)
    }
}

/// Where closed transfers go.
pub trait Sink {
    fn push(&mut self, row: &Row<'_>);
}

/// Columns of the `transfers` table.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Transfers {
    pub t: Vec<i64>,
    pub t_end: Vec<i64>,
    pub bus: Vec<u8>,
    pub kind: Vec<u8>,
    pub type_id: Vec<u16>,
    pub src: Vec<u8>,
    pub dst: Vec<u8>,
    pub priority: Vec<u8>,
    pub transfer_id: Vec<u8>,
    pub status: Vec<u8>,
    pub crc_wire: Vec<u16>,
    pub crc_here: Vec<u16>,
    /// Bit 0: `crc_wire` holds a value, bit 1: `crc_here` does.
    pub crc_valid: Vec<u8>,
    /// Distance from the previous transfer ID of the session, modulo 32, or [`NO_STEP`].
    pub step: Vec<u8>,
    /// Nanoseconds since the previous transfer of the session, start to start, or [`NO_GAP`].
    pub gap: Vec<i64>,
    pub anomaly: Vec<u32>,
    pub fd: Vec<u8>,
    /// Index of the known type, or [`UNKNOWN`]; stays inside the core.
    pub known: Vec<u16>,
    pub frame_offset: Vec<i32>,
    pub frame: Vec<u64>,
    pub payload_offset: Vec<i32>,
    pub payload: Vec<u8>,
}

impl Default for Transfers {
    fn default() -> Self {
        Transfers {
            t: vec![],
            t_end: vec![],
            bus: vec![],
            kind: vec![],
            type_id: vec![],
            src: vec![],
            dst: vec![],
            priority: vec![],
            transfer_id: vec![],
            status: vec![],
            crc_wire: vec![],
            crc_here: vec![],
            crc_valid: vec![],
            step: vec![],
            gap: vec![],
            anomaly: vec![],
            fd: vec![],
            known: vec![],
            frame_offset: vec![0],
            frame: vec![],
            payload_offset: vec![0],
            payload: vec![],
        }
    }
}

/// Does something with every column but the two of offsets.
macro_rules! each_column {
    ($what:ident) => {
        $what!(
            t,
            t_end,
            bus,
            kind,
            type_id,
            src,
            dst,
            priority,
            transfer_id,
            status,
            crc_wire,
            crc_here,
            crc_valid,
            step,
            gap,
            anomaly,
            fd,
            known,
            frame,
            payload
        )
    };
}

impl Transfers {
    pub fn len(&self) -> usize {
        self.t.len()
    }

    pub fn is_empty(&self) -> bool {
        self.t.is_empty()
    }

    /// An empty table with room for some more rows than this one has.
    #[must_use]
    pub fn like(&self) -> Self {
        let mut out = Transfers::default();
        macro_rules! reserve {
            ($($name:ident),+) => { $( out.$name.reserve_exact(room_like(self.$name.len())); )+ };
        }
        each_column!(reserve);
        out.frame_offset.reserve_exact(room_like(self.frame_offset.len()));
        out.payload_offset.reserve_exact(room_like(self.payload_offset.len()));
        out
    }

    pub fn frames_of(&self, row: usize) -> &[u64] {
        &self.frame[self.frame_offset[row] as usize..self.frame_offset[row + 1] as usize]
    }

    pub fn payload_of(&self, row: usize) -> &[u8] {
        &self.payload[self.payload_offset[row] as usize..self.payload_offset[row + 1] as usize]
    }

    /// Moves the rows of `other`, all of them, behind these.
    pub fn append(&mut self, mut other: Transfers) {
        let (frames, bytes) = (self.frame.len() as i32, self.payload.len() as i32);
        self.frame_offset
            .extend(other.frame_offset[1..].iter().map(|end| end + frames));
        self.payload_offset
            .extend(other.payload_offset[1..].iter().map(|end| end + bytes));
        macro_rules! append {
            ($($name:ident),+) => { $( self.$name.append(&mut other.$name); )+ };
        }
        each_column!(append);
    }

    /// The rows of every known type whose payload is worth unpacking, by index of the type.
    pub fn rows_by_type(&self, types: usize) -> Vec<Vec<u32>> {
        let mut rows = vec![vec![]; types];
        for (row, (&known, &status)) in (0..).zip(self.known.iter().zip(&self.status)) {
            let complete = status == Status::Ok as u8 || status == Status::BadCrc as u8;
            if let (true, Some(list)) = (complete, rows.get_mut(usize::from(known))) {
                list.push(row);
            }
        }
        rows
    }
}

impl Sink for Transfers {
    fn push(&mut self, row: &Row<'_>) {
        self.t.push(row.t);
        self.t_end.push(row.t_end);
        self.bus.push(row.bus);
        self.kind.push(row.id.kind as u8);
        self.type_id.push(row.id.type_id);
        self.src.push(row.id.src);
        self.dst.push(row.id.dst);
        self.priority.push(row.priority);
        self.transfer_id.push(row.transfer_id);
        self.status.push(row.status as u8);
        self.crc_wire.push(row.crc_wire.unwrap_or(0));
        self.crc_here.push(row.crc_here.unwrap_or(0));
        self.crc_valid.push(row.crc_valid());
        self.step.push(row.step);
        self.gap.push(row.gap);
        self.anomaly.push(row.anomaly);
        self.fd.push(u8::from(row.fd));
        self.known.push(row.known);
        self.frame.extend_from_slice(row.frames);
        self.frame_offset.push(self.frame.len() as i32);
        self.payload.extend_from_slice(row.payload);
        self.payload_offset.push(self.payload.len() as i32);
    }
}
