//! Frames as `candump -l` writes them, one at a time: for those who show a few of very many.
#![forbid(unsafe_code)]

use std::fmt::Write as _;

use crate::frames::{DLC_SHIFT, EXTENDED, FD, NO_TIME, REMOTE};

const SECOND: i64 = 1_000_000_000;
/// The bits BRS and ESI, as the form of CAN FD has them behind `##`.
const MARKS: u16 = 4;
const DIGITS: &[u8; 16] = b"0123456789ABCDEF";

/// The cells of a frame.
#[derive(Clone, Copy, Debug)]
pub struct Frame<'a> {
    pub t: i64,
    pub bus: &'a str,
    pub id: u32,
    pub flags: u16,
    pub data: &'a [u8],
}

impl Frame<'_> {
    /// Without a time that part is left out.
    pub fn line(&self) -> String {
        let mut out = String::with_capacity(64);
        // Writing to a string never fails.
        let _ = self.write(&mut out);
        out
    }

    fn write(&self, out: &mut String) -> std::fmt::Result {
        let (t, flags) = (self.t, self.flags);
        if t != NO_TIME {
            write!(out, "({}.{:09}) ", t.div_euclid(SECOND), t.rem_euclid(SECOND))?;
        }
        let width = if flags & EXTENDED == 0 { 3 } else { 8 };
        write!(out, "{} {:0width$X}#", self.bus, self.id)?;
        if flags & REMOTE != 0 {
            let code = flags >> DLC_SHIFT & 15;
            out.push('R');
            return if code == 0 { Ok(()) } else { write!(out, "{code:X}") };
        }
        if flags & FD != 0 {
            write!(out, "#{:X}", flags >> MARKS & 3)?;
        }
        for byte in self.data {
            out.push(char::from(DIGITS[usize::from(byte >> 4)]));
            out.push(char::from(DIGITS[usize::from(byte & 15)]));
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const PLAIN: Frame<'_> = Frame {
        t: 1_000_000_007,
        bus: "can0",
        id: 0x1F_0155,
        flags: EXTENDED,
        data: &[0xA, 0xC0],
    };

    #[test]
    fn a_frame_is_a_line() {
        assert_eq!(PLAIN.line(), "(1.000000007) can0 001F0155#0AC0");
        let short = Frame {
            t: NO_TIME,
            id: 0x12,
            flags: 0,
            data: &[],
            ..PLAIN
        };
        assert_eq!(short.line(), "can0 012#");
    }

    #[test]
    fn what_is_remote_has_a_length_and_what_is_fd_its_marks() {
        let flags = EXTENDED | REMOTE | 3 << DLC_SHIFT;
        assert_eq!(Frame { flags, ..PLAIN }.line(), "(1.000000007) can0 001F0155#R3");
        let flags = EXTENDED | REMOTE;
        assert_eq!(Frame { flags, ..PLAIN }.line(), "(1.000000007) can0 001F0155#R");
        let flags = EXTENDED | FD | 1 << MARKS;
        assert_eq!(Frame { flags, ..PLAIN }.line(), "(1.000000007) can0 001F0155##10AC0");
    }
}
