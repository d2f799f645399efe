//! ROS messages, byte by byte.

use _native::frames::{DLC_SHIFT, ERROR, EXTENDED, FD, REMOTE, TX};
use _native::mcap::{Kind, Layout, Stop, Walk, Wire};

use crate::common::messages::record;
use crate::common::Sent;
use crate::{read, sent, LOG_TIME};

const T: i64 = 1_700_000_000_000_180_000;

fn cdr(kind: Kind, message: &[u8]) -> Result<Sent, String> {
    read(Layout::ros(Wire::Cdr, kind), message)
}

/// `can_msgs/Frame` of `can0`, extended identifier 05040601, 7 bytes.
fn classic() -> Vec<u8> {
    b"\0\x01\0\0\x00\xf1Se\x20\xbf\x02\0\x05\0\0\0can0\0\xAA\xAA\xAA\x01\x06\x04\x05\0\x01\0\x07\x01\x02\x03\x04\x05\x06\x07\xFF"
        .to_vec()
}

fn with(mut message: Vec<u8>, at: usize, byte: u8) -> Vec<u8> {
    message[at] = byte;
    message
}

#[test]
fn can_msgs_in_little_endian() {
    let frame = sent(T, "can0", 0x0504_0601, EXTENDED, &[1, 2, 3, 4, 5, 6, 7]);
    assert_eq!(cdr(Kind::CanMsgs, &classic()), Ok(frame.clone()));
    let padded = [classic(), vec![0; 3]].concat();
    assert_eq!(cdr(Kind::CanMsgs, &padded), Ok(frame.clone()));
    assert_eq!(
        cdr(Kind::CanMsgs, &with(classic(), 1, 7)),
        Ok(frame),
        "the second version of CDR"
    );
}

#[test]
fn can_msgs_in_big_endian() {
    let message =
        b"\0\0\0\0eS\xf1\0\0\x02\xbf\x20\0\0\0\x05can0\0\0\0\0\x05\x04\x06\x01\0\x01\0\x02\x01\x02\0\0\0\0\0\0";
    let frame = sent(T, "can0", 0x0504_0601, EXTENDED, &[1, 2]);
    assert_eq!(cdr(Kind::CanMsgs, message), Ok(frame.clone()));
    assert_eq!(cdr(Kind::CanMsgs, &with(message.to_vec(), 1, 6)), Ok(frame));
}

#[test]
fn socketcan_messages_in_both_lengths() {
    let head = b"\0\x01\0\0\x00\xf1Se\x20\xbf\x02\0\x03\0\0\0v1\0\0".to_vec();
    let fd = |length: u8| {
        [
            &head[..],
            b"\x23\x01\0\0\0\0",
            &[length, 0, length, 0, 0, 0],
            &[9; 64][..length.into()],
        ]
        .concat()
    };
    for length in [0, 1, 8, 9, 12, 64] {
        let long = if length > 8 { FD } else { 0 };
        let frame = sent(T, "v1", 0x123, long, &[9; 64][..length.into()]);
        assert_eq!(cdr(Kind::SocketCanFd, &fd(length)), Ok(frame));
        for (flag, bits) in [(0, 0), (1, FD)] {
            let message = [&head[..], &[0x23, 1, 0, 0, 0, 0, 0, flag, length], &[9; 64]].concat();
            let frame = sent(T, "v1", 0x123, bits, &[9; 64][..length.into()]);
            assert_eq!(cdr(Kind::SocketCan, &message), Ok(frame));
        }
    }
    let long = |message: &[u8], kind| cdr(kind, message).unwrap_err();
    assert_eq!(long(&with(fd(8), 26, 7), Kind::SocketCanFd), "says 7 bytes, has 8");
    assert_eq!(
        long(&with(fd(64), 28, 65), Kind::SocketCanFd),
        "data longer than 64 bytes"
    );
    let message = [&head[..], &[0x23, 1, 0, 0, 0, 0, 0, 1, 65], &[9; 64]].concat();
    assert_eq!(long(&message, Kind::SocketCan), "data longer than 64 bytes");
}

/// An interface in CAN FD mode delivers classic frames, too, and the message does not say which is which.
#[test]
fn short_frames_are_can_fd_if_their_identifier_is() {
    let message = |id: u8, length: u8| {
        let head = [
            b"\0\x01\0\0\x01\0\0\0\0\0\0\0\0\0\0\0",
            &[id, 0, 0, 0, 0, 0, length, 0][..],
        ]
        .concat();
        record(
            3,
            LOG_TIME,
            &[&head, &[length, 0, 0, 0][..], &[7; 64][..length.into()]].concat(),
        )
    };
    let messages = [(1, 8), (2, 8), (1, 9), (1, 8), (2, 64), (3, 0), (2, 1), (1, 0)];
    let records: Vec<u8> = messages
        .into_iter()
        .flat_map(|(id, length)| message(id, length))
        .collect();
    for (marked, expected) in [(0, [0, 0, FD, FD, FD, 0, FD, FD]), (FD | TX, [FD | TX; 8])] {
        let mut walk = Walk::default();
        walk.channel(3, "can0", Layout::ros(Wire::Cdr, Kind::SocketCanFd));
        walk.mark(3, marked);
        assert_eq!(walk.walk(&records, 0, usize::MAX), (records.len(), Stop::End));
        assert_eq!(walk.take().frames.flags, expected);
    }
}

#[test]
fn ros1_is_packed() {
    let message = b"\x05\0\0\0\x00\xf1Se\x20\xbf\x02\0\x03\0\0\0v10\x01\x06\x04\x05\0\x01\0\x02\x01\x02\0\0\0\0\0\0";
    let read = |message: &[u8]| read(Layout::ros(Wire::Ros1, Kind::CanMsgs), message);
    assert_eq!(read(message), Ok(sent(T, "v10", 0x0504_0601, EXTENDED, &[1, 2])));
    let longer = [&message[..], &[0]].concat();
    assert_eq!(read(&longer).unwrap_err(), "1 bytes too many");
    let mut late = message.to_vec();
    late[4..8].copy_from_slice(&u32::MAX.to_le_bytes());
    let t = i64::from(u32::MAX) * 1_000_000_000 + 180_000;
    assert_eq!(read(&late).unwrap().t, t, "seconds have no sign");
}

#[test]
fn names_of_any_length_keep_the_alignment() {
    for big in [false, true] {
        let word = |value: u32| if big { value.to_be_bytes() } else { value.to_le_bytes() };
        for length in 0..10_usize {
            let name = &"interface"[..length];
            for nul in [0, 1] {
                let mut message = vec![0, u8::from(!big), 0, 0];
                message.extend([word(1), word(2), word((length + nul) as u32)].concat());
                message.extend(name.bytes().chain(std::iter::repeat_n(0, nul)));
                message.resize(message.len().next_multiple_of(4), 0xAA);
                message.extend(word(0x7FF));
                message.extend([0, 0, 0, 1, 0x55, 0, 0, 0, 0, 0, 0, 0]);
                let name = if length == 0 { "announced" } else { name };
                assert_eq!(
                    cdr(Kind::CanMsgs, &message),
                    Ok(sent(1_000_000_002, name, 0x7FF, 0, &[0x55]))
                );
            }
        }
    }
}

#[test]
fn remote_and_error_frames() {
    let remote = with(classic(), 28, 1);
    let flags = EXTENDED | REMOTE | 7 << DLC_SHIFT;
    assert_eq!(
        cdr(Kind::CanMsgs, &remote),
        Ok(sent(T, "can0", 0x0504_0601, flags, &[]))
    );
    let error = with(with(classic(), 30, 1), 27, 0x20);
    assert_eq!(
        cdr(Kind::CanMsgs, &error),
        Ok(sent(T, "can0", 0x0004_0601, ERROR, &[1, 2, 3, 4, 5, 6, 7]))
    );
    // The same by the flag bits of the kernel's word.
    assert_eq!(
        cdr(Kind::CanMsgs, &with(classic(), 27, 0x45)),
        Ok(sent(T, "can0", 0x0504_0601, flags, &[]))
    );
    let not_said = with(with(classic(), 27, 0x85), 29, 0);
    assert_eq!(cdr(Kind::CanMsgs, &not_said).unwrap().flags, EXTENDED);
    assert_eq!(cdr(Kind::CanMsgs, &with(classic(), 27, 0x25)).unwrap().flags, ERROR);
}

#[test]
fn without_a_stamp_the_recorder_has_the_time() {
    let mut message = classic();
    message[4..12].fill(0);
    assert_eq!(cdr(Kind::CanMsgs, &message).unwrap().t, LOG_TIME as i64);
    assert_eq!(cdr(Kind::CanMsgs, &with(message, 8, 1)).unwrap().t, 1);
}

#[test]
fn what_cannot_be_read_says_why() {
    for (at, byte, reason) in [
        (0, 1, "CDR encapsulation 0101 not understood"),
        (1, 3, "CDR encapsulation 0003 not understood"),
        (7, 0x80, "time stamp out of range"),
        (11, 0x3C, "time stamp out of range"),
        (12, 200, "data ends early"),
        (15, 255, "data ends early"),
        (28, 2, "flag with the value 2"),
        (29, 0, "standard identifier above 7FF"),
        (31, 9, "data longer than 8 bytes"),
    ] {
        assert_eq!(
            cdr(Kind::CanMsgs, &with(classic(), at, byte)).unwrap_err(),
            reason,
            "{at}"
        );
    }
    let longer = [classic(), vec![0; 4]].concat();
    assert_eq!(cdr(Kind::CanMsgs, &longer).unwrap_err(), "4 bytes too many");
    for end in 0..classic().len() {
        assert_eq!(
            cdr(Kind::CanMsgs, &classic()[..end]).unwrap_err(),
            "data ends early",
            "{end}"
        );
    }
    let head = &b"\0\x01\0\0\x00\xf1Se\x20\xbf\x02\0\x03\0\0\0v1\0\0\x23\x01\0\0"[..];
    let both = [head, &[1, 0, 0, 1, 8], &[9; 64]].concat();
    assert_eq!(
        cdr(Kind::SocketCan, &both).unwrap_err(),
        "remote request on a CAN FD frame"
    );
    let long = [head, &[1, 0, 0, 0, 9], &[9; 64]].concat();
    assert_eq!(cdr(Kind::SocketCan, &long).unwrap_err(), "data longer than 8 bytes");
    let error = [head, &[0, 0, 1, 0, 9], &[9; 64]].concat();
    assert_eq!(cdr(Kind::SocketCan, &error).unwrap_err(), "data longer than 8 bytes");
}
