//! Rows on their way into [`Transfers`]: fixed columns, so that a row costs stores and no growth checks.
#![forbid(unsafe_code)]

use super::{Row, Sink, Transfers};

const ROWS: usize = 128;
/// The most payload bytes and frames of a row that is copied in whole words.
pub const SHORT_PAYLOAD: usize = 32;
pub const SHORT_FRAMES: usize = 8;

macro_rules! staged {
    ($($name:ident: $kind:ty),+) => {
        #[derive(Debug)]
        pub struct Staged {
            used: usize,
            $( $name: [$kind; ROWS], )+
            /// Transfers that nobody asks for: they make no rows.
            unasked: u64,
            /// The rows before, and the frames and payloads of all.
            rows: Transfers,
        }

        impl Default for Staged {
            fn default() -> Self {
                Staged { used: 0, $( $name: [0; ROWS], )+ unasked: 0, rows: Transfers::default() }
            }
        }

        impl Staged {
            /// All rows so far as columns.
            pub fn rows(&mut self) -> &mut Transfers {
                let used = std::mem::take(&mut self.used).min(ROWS);
                $( self.rows.$name.extend_from_slice(&self.$name[..used]); )+
                &mut self.rows
            }
        }
    };
}
staged!(
    t: i64, t_end: i64, gap: i64, anomaly: u32, frame_offset: i32, payload_offset: i32, type_id: u16, crc_wire: u16,
    crc_here: u16, known: u16, bus: u8, kind: u8, src: u8, dst: u8, priority: u8, transfer_id: u8, status: u8,
    crc_valid: u8, step: u8, fd: u8
);

impl Staged {
    /// Hands over all rows and starts again, with room for as many.
    pub fn take(&mut self) -> Transfers {
        let next = self.rows().like();
        std::mem::replace(&mut self.rows, next)
    }

    /// How many transfers nobody has asked for so far.
    pub fn unasked(&self) -> u64 {
        self.unasked
    }

    /// A row whose frames and payload stand at the start of `frames` and `payload`.
    #[inline]
    pub fn push_short(&mut self, row: &Row<'_>, frames: &[u64; SHORT_FRAMES], payload: &[u8; SHORT_PAYLOAD]) {
        if !row.asked {
            self.unasked += 1;
            return;
        }
        let (old_frames, old_bytes) = (self.rows.frame.len(), self.rows.payload.len());
        self.rows.frame.extend_from_slice(frames);
        self.rows.frame.truncate(old_frames + row.frames.len());
        self.rows.payload.extend_from_slice(payload);
        self.rows.payload.truncate(old_bytes + row.payload.len());
        self.stage(row);
    }

    #[inline]
    fn stage(&mut self, row: &Row<'_>) {
        let at = self.used % ROWS;
        self.t[at] = row.t;
        self.t_end[at] = row.t_end;
        self.gap[at] = row.gap;
        self.anomaly[at] = row.anomaly;
        self.frame_offset[at] = self.rows.frame.len() as i32;
        self.payload_offset[at] = self.rows.payload.len() as i32;
        self.type_id[at] = row.id.type_id;
        self.crc_wire[at] = row.crc_wire.unwrap_or(0);
        self.crc_here[at] = row.crc_here.unwrap_or(0);
        self.known[at] = row.known;
        self.bus[at] = row.bus;
        self.kind[at] = row.id.kind as u8;
        self.src[at] = row.id.src;
        self.dst[at] = row.id.dst;
        self.priority[at] = row.priority;
        self.transfer_id[at] = row.transfer_id;
        self.status[at] = row.status as u8;
        self.crc_valid[at] = row.crc_valid();
        self.step[at] = row.step;
        self.fd[at] = u8::from(row.fd);
        self.used = at + 1;
        if self.used == ROWS {
            self.rows();
        }
    }
}

impl Sink for Staged {
    fn push(&mut self, row: &Row<'_>) {
        if !row.asked {
            self.unasked += 1;
            return;
        }
        self.rows.frame.extend_from_slice(row.frames);
        self.rows.payload.extend_from_slice(row.payload);
        self.stage(row);
    }
}
