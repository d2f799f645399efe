//! A datagram of a SocketCAN socket: its size alone says which structure it is, unlike in a capture.
#![forbid(unsafe_code)]

use libc::{c_int, CANFD_BRS, CANFD_ESI, CANFD_MTU, CANXL_XLF, CAN_MTU};

use crate::frames::{BRS, ESI};
use crate::line::Reason;
use crate::socketcan::Frame;

const MAX_CLASSIC: u8 = crate::frames::MAX_CLASSIC as u8;
const MAX_CODE: u8 = 15;

/// The frame; `cut` if the datagram was longer than `bytes`.
///
/// # Errors
/// What is wrong with it.
pub fn read(bytes: &[u8], cut: bool) -> Result<Frame<'_>, Reason> {
    let Some(([a, b, c, d, length, flags, _, code], data)) = bytes.split_first_chunk() else {
        return Err(format!(
            "datagram of {} bytes, shorter than the header of a CAN frame",
            bytes.len()
        )
        .into());
    };
    if cut {
        let kind = if c_int::from(*length) & CANXL_XLF == 0 {
            "datagram longer than a CAN frame"
        } else {
            "CAN XL frame"
        };
        return Err(kind.into());
    }
    let word = u32::from_ne_bytes([*a, *b, *c, *d]);
    match bytes.len() {
        CAN_MTU if *length > MAX_CLASSIC => Err(format!("classic frame of {length} bytes").into()),
        CAN_MTU => {
            // The raw code counts beside a full length only; old kernels leave anything there.
            let raw = *length == MAX_CLASSIC && (MAX_CLASSIC..=MAX_CODE).contains(code);
            Frame::classic(word, if raw { *code } else { *length }, data)
        }
        CANFD_MTU => {
            let data = data.get(..usize::from(*length));
            let data = data.ok_or_else(|| format!("CAN FD frame of {length} bytes"))?;
            let flag = |bit, set| if c_int::from(*flags) & bit != 0 { set } else { 0 };
            Frame::fd(word, flag(CANFD_BRS, BRS) | flag(CANFD_ESI, ESI), data)
        }
        size => Err(format!("datagram of {size} bytes, which no CAN frame has").into()),
    }
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;
    use crate::frames::{DLC_SHIFT, ERROR, EXTENDED, FD, REMOTE, WORD_ERROR, WORD_EXTENDED, WORD_REMOTE};

    pub fn packet(word: u32, head: [u8; 4], data: &[u8], size: usize) -> Vec<u8> {
        let mut out = word.to_ne_bytes().to_vec();
        out.extend(head);
        out.extend(data);
        out.resize(size, 0);
        out
    }

    #[track_caller]
    fn check(bytes: &[u8], id: u32, flags: u16, data: &[u8]) {
        assert_eq!(read(bytes, false), Ok(Frame { id, flags, data }));
    }

    #[test]
    fn classic_frames() {
        check(&packet(0x123, [3, 0, 0, 0], b"abc", 16), 0x123, 0, b"abc");
        check(&packet(WORD_EXTENDED | 0x123, [0; 4], b"", 16), 0x123, EXTENDED, b"");
        let remote = WORD_REMOTE | 0x7FF;
        check(
            &packet(remote, [5, 0, 0, 0], b"", 16),
            0x7FF,
            REMOTE | 5 << DLC_SHIFT,
            b"",
        );
        check(
            &packet(WORD_ERROR | 0x40, [8, 0, 0, 0], b"12345678", 16),
            0x40,
            ERROR,
            b"12345678",
        );
    }

    #[test]
    fn the_raw_length_code_counts_beside_eight_bytes() {
        let data = b"12345678";
        check(&packet(1, [8, 0, 0, 13], data, 16), 1, 13 << DLC_SHIFT, data);
        check(&packet(1, [8, 0, 0, 16], data, 16), 1, 0, data);
        check(&packet(1, [4, 0, 0, 13], data, 16), 1, 0, b"1234");
        let remote = packet(WORD_REMOTE | 1, [8, 0, 0, 9], data, 16);
        check(&remote, 1, REMOTE | 9 << DLC_SHIFT, b"");
    }

    #[test]
    fn padding_does_not_make_a_classic_frame_another_one() {
        check(&packet(1, [1, 0xFF, 0xFF, 0], b"x", 16), 1, 0, b"x");
    }

    #[test]
    fn fd_frames_have_their_flags_and_any_length() {
        let data: Vec<u8> = (0..64).collect();
        check(&packet(1, [64, 7, 0, 0], &data, 72), 1, FD | BRS | ESI, &data);
        check(&packet(1, [64, 4, 0, 0], &data, 72), 1, FD, &data);
        check(&packet(1, [0, 1, 0, 0], &data, 72), 1, FD | BRS, b"");
        check(&packet(1, [9, 2, 9, 9], &data, 72), 1, FD | ESI, &data[..9]);
    }

    #[test]
    fn nothing_else_is_a_frame() {
        let reason = |bytes: &[u8], cut| read(bytes, cut).expect_err("no frame").into_owned();
        assert_eq!(
            reason(b"1234567", false),
            "datagram of 7 bytes, shorter than the header of a CAN frame"
        );
        assert_eq!(reason(&[0; 17], false), "datagram of 17 bytes, which no CAN frame has");
        assert_eq!(
            reason(&packet(1, [9, 0, 0, 0], b"", 16), false),
            "classic frame of 9 bytes"
        );
        assert_eq!(
            reason(&packet(1, [65, 0, 0, 0], b"", 72), false),
            "CAN FD frame of 65 bytes"
        );
        assert_eq!(
            reason(&packet(0x800, [0; 4], b"", 16), false),
            "standard identifier above 7FF"
        );
        assert_eq!(reason(&[0; 72], true), "datagram longer than a CAN frame");
        assert_eq!(reason(&packet(1, [0x80, 0, 0, 0], b"", 72), true), "CAN XL frame");
        let odd = packet(WORD_REMOTE | 1, [1, 0, 0, 0], b"", 72);
        assert_eq!(reason(&odd, false), "CAN FD frame marked as remote or error frame");
    }
}
