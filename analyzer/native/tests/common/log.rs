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
    /// The line of `candump -l`; of plain `candump` for a frame without time.
    pub fn line(&self) -> String {
        if self.t == NO_TIME {
            return self.console("");
        }
        let data = match self.flags & (REMOTE | FD) {
            0 => format!("#{}", self.hex("")),
            FD => format!("##1{}", self.hex("")),
            _ => "#R".to_owned(),
        };
        format!("({}) can{} {}{data}\n", seconds(self.t), self.bus, self.identifier())
    }

    /// The line that candump writes to a terminal, behind a time stamp or nothing.
    pub fn console(&self, stamp: &str) -> String {
        let (bus, id, length) = (self.bus, self.identifier(), self.data.len());
        let data = match self.flags & (REMOTE | FD) {
            0 => format!("[{length}] {}", self.hex(" ")),
            FD => format!("[{length:02}] {}", self.hex(" ")),
            _ => "[0]  remote request".to_owned(),
        };
        format!("{stamp}  can{bus}  {id}  {data}\n")
    }

    fn identifier(&self) -> String {
        if self.flags & EXTENDED == 0 {
            format!("{:03X}", self.id & 0x7FF)
        } else {
            format!("{:08X}", self.id & 0x1FFF_FFFF)
        }
    }

    fn hex(&self, gap: &str) -> String {
        let append = |text: String, byte: &u8| text + gap + &format!("{byte:02X}");
        self.data.iter().fold(String::new(), append)
    }
}

pub fn seconds(t: i64) -> String {
    format!("{}.{:09}", t.div_euclid(1_000_000_000), t.rem_euclid(1_000_000_000))
}

pub fn text(frames: &[CanFrame]) -> Vec<u8> {
    frames.iter().flat_map(|frame| frame.line().into_bytes()).collect()
}
