//! CAN frames as candump writes them.

use _native::frames::{EXTENDED, FD, NO_TIME, REMOTE};

/// One CAN frame; flags and [`NO_TIME`] as in the table of frames.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct CanFrame {
    pub t: i64,
    pub bus: u8,
    pub id: u32,
    pub flags: u16,
    pub data: Vec<u8>,
}

impl CanFrame {
    /// The line of `candump -l`; of `candump` for a frame without time.
    pub fn line(&self) -> String {
        let (t, bus, id) = (self.t, self.bus, self.id);
        let id = if self.flags & EXTENDED == 0 {
            format!("{:03X}", id & 0x7FF)
        } else {
            format!("{:08X}", id & 0x1FFF_FFFF)
        };
        let hex = |gap: &str| {
            let append = |text: String, byte: &u8| text + gap + &format!("{byte:02X}");
            self.data.iter().fold(String::new(), append)
        };
        if t == NO_TIME {
            return format!("  can{bus}  {id}   [{}] {}\n", self.data.len(), hex(" "));
        }
        let data = match self.flags & (REMOTE | FD) {
            0 => format!("#{}", hex("")),
            FD => format!("##1{}", hex("")),
            _ => "#R".to_owned(),
        };
        let (seconds, fraction) = (t.div_euclid(1_000_000_000), t.rem_euclid(1_000_000_000));
        format!("({seconds}.{fraction:09}) can{bus} {id}{data}\n")
    }
}

pub fn text(frames: &[CanFrame]) -> Vec<u8> {
    frames.iter().flat_map(|frame| frame.line().into_bytes()).collect()
}
