//! The first table: one row a CAN frame, held as columns, numbered in capture order.
#![forbid(unsafe_code)]

/// Bits of the `flags` column.
pub const EXTENDED: u16 = 1 << 0;
pub const REMOTE: u16 = 1 << 1;
pub const ERROR: u16 = 1 << 2;
pub const FD: u16 = 1 << 3;
pub const BRS: u16 = 1 << 4;
pub const ESI: u16 = 1 << 5;
pub const TX: u16 = 1 << 6;
pub const RX: u16 = 1 << 7;
/// Bits 8..=11: the length code of a remote frame, or a raw code above 8 of a classic data frame.
pub const DLC_SHIFT: u32 = 8;

/// Flag bits of the kernel's identifier word, and what they leave for the identifier.
pub const WORD_EXTENDED: u32 = 1 << 31;
pub const WORD_REMOTE: u32 = 1 << 30;
pub const WORD_ERROR: u32 = 1 << 29;
pub const ID_MASK: u32 = WORD_ERROR - 1;
/// The highest identifier of 11 bits.
pub const MAX_STANDARD: u32 = 0x7FF;

/// The time of a frame whose capture recorded none.
pub const NO_TIME: i64 = i64::MIN;
/// The longest data field of a classic frame, and of any (CAN FD).
pub const MAX_CLASSIC: usize = 8;
pub const MAX_DATA: usize = 64;

/// Columns of the `frames` table. Row `i` owns `data[offset[i]..offset[i + 1]]`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Frames {
    /// Nanoseconds, or [`NO_TIME`].
    pub t: Vec<i64>,
    /// Index of the interface name.
    pub bus: Vec<u8>,
    /// The identifier alone, 11 or 29 bits.
    pub id: Vec<u32>,
    pub flags: Vec<u16>,
    /// Line or record of the capture, from 1; stays at `u32::MAX` beyond that.
    pub line: Vec<u32>,
    pub offset: Vec<i32>,
    pub data: Vec<u8>,
}

impl Default for Frames {
    fn default() -> Self {
        Frames {
            t: vec![],
            bus: vec![],
            id: vec![],
            flags: vec![],
            line: vec![],
            offset: vec![0],
            data: vec![],
        }
    }
}

impl Frames {
    pub fn len(&self) -> usize {
        self.t.len()
    }

    pub fn is_empty(&self) -> bool {
        self.t.is_empty()
    }

    /// An empty table with room for some more rows than this one has.
    #[must_use]
    pub fn like(&self) -> Self {
        let mut out = Frames::default();
        out.reserve(room_like(self.len()), room_like(self.data.len()));
        out
    }

    fn reserve(&mut self, rows: usize, bytes: usize) {
        self.t.reserve(rows);
        self.bus.reserve(rows);
        self.id.reserve(rows);
        self.flags.reserve(rows);
        self.line.reserve(rows);
        self.offset.reserve(rows);
        self.data.reserve(bytes);
    }

    pub fn push(&mut self, t: i64, bus: u8, id: u32, flags: u16, line: u64, data: &[u8]) {
        self.t.push(t);
        self.bus.push(bus);
        self.id.push(id);
        self.flags.push(flags);
        self.line.push(u32::try_from(line).unwrap_or(u32::MAX));
        self.data.extend_from_slice(data);
        self.offset.push(self.data.len() as i32);
    }

    /// Appends all rows of `other`.
    pub fn extend(&mut self, other: &Frames) {
        let start = self.data.len() as i32;
        self.t.extend_from_slice(&other.t);
        self.bus.extend_from_slice(&other.bus);
        self.id.extend_from_slice(&other.id);
        self.flags.extend_from_slice(&other.flags);
        self.line.extend_from_slice(&other.line);
        self.offset.extend(other.offset[1..].iter().map(|end| start + end));
        self.data.extend_from_slice(&other.data);
    }

    /// Whether all columns have as many rows, and offsets that lie in the data.
    pub fn fits(&self) -> bool {
        let rows = self.len();
        [self.bus.len(), self.id.len(), self.flags.len(), self.line.len()] == [rows; 4]
            && self.offset.len() == rows + 1
            && rises(&self.offset, self.data.len())
    }

    pub fn data_of(&self, row: usize) -> &[u8] {
        &self.data[self.offset[row] as usize..self.offset[row + 1] as usize]
    }
}

/// Room for a batch like one of this size: one that outgrows it is copied.
pub(crate) fn room_like(size: usize) -> usize {
    size + size / 8
}

/// Whether places in `size` bytes begin at 0 or later, and none goes backwards or too far.
pub(crate) fn rises(places: &[i32], size: usize) -> bool {
    places.first().is_none_or(|&first| first >= 0)
        && places.windows(2).all(|pair| pair[0] <= pair[1])
        && places.last().is_none_or(|&last| last as usize <= size)
}
