//! What the kernel says beside a datagram: when it came, and how many it had to drop so far.
#![forbid(unsafe_code)]

use std::mem::size_of;

use libc::{SCM_TIMESTAMPING, SCM_TIMESTAMPNS, SOL_SOCKET, SO_RXQ_OVFL};

const SECOND: i64 = 1_000_000_000;
/// Bytes of `struct cmsghdr`: its length, level and type.
const HEADER: usize = size_of::<usize>() + 8;

/// What the control messages of one datagram say.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Notes {
    /// When the kernel took it in, in nanoseconds of the system clock.
    pub kernel: Option<i64>,
    /// When the controller took it in, in nanoseconds of its own clock.
    pub hardware: Option<i64>,
    /// The socket's drop counter when the datagram was queued; the kernel leaves a 0 out.
    pub dropped: Option<u32>,
}

impl Notes {
    /// Reads control messages as `recvmsg` leaves them; what is cut off or of another kind is passed over.
    pub fn read(mut control: &[u8]) -> Notes {
        let mut notes = Notes::default();
        while let Some((length, rest)) = control.split_first_chunk() {
            let length = usize::from_ne_bytes(*length);
            let (Some(level), Some(kind)) = (word(rest, 0), word(rest, 4)) else {
                break;
            };
            let Some(data) = control.get(HEADER..length) else {
                break;
            };
            if level == SOL_SOCKET {
                match kind {
                    SCM_TIMESTAMPNS => notes.kernel = time(data),
                    SCM_TIMESTAMPING => {
                        let (software, _, raw) = thirds(data);
                        notes.kernel = notes.kernel.or(offered(software));
                        notes.hardware = offered(raw);
                    }
                    SO_RXQ_OVFL => notes.dropped = word(data, 0).map(|count| count as u32),
                    _ => {}
                }
            }
            control = control
                .get(length.next_multiple_of(size_of::<usize>())..)
                .unwrap_or(&[]);
        }
        notes
    }
}

/// The three times of `SCM_TIMESTAMPING`; the second one is no longer in use.
fn thirds(data: &[u8]) -> (&[u8], &[u8], &[u8]) {
    let size = data.len() / 3;
    (&data[..size], &data[size..2 * size], &data[2 * size..])
}

/// A time that is not set reads 0.
fn offered(data: &[u8]) -> Option<i64> {
    time(data).filter(|&t| t != 0)
}

/// `struct timespec` of either width.
fn time(data: &[u8]) -> Option<i64> {
    let (seconds, nanoseconds) = match data.len() {
        8 => (word(data, 0)?.into(), word(data, 4)?.into()),
        16 => (long(data, 0)?, long(data, 8)?),
        _ => return None,
    };
    seconds.checked_mul(SECOND)?.checked_add(nanoseconds)
}

fn word(bytes: &[u8], at: usize) -> Option<i32> {
    Some(i32::from_ne_bytes(*bytes.get(at..)?.first_chunk()?))
}

fn long(bytes: &[u8], at: usize) -> Option<i64> {
    Some(i64::from_ne_bytes(*bytes.get(at..)?.first_chunk()?))
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;

    pub fn message(kind: i32, data: &[u8]) -> Vec<u8> {
        let mut out = (HEADER + data.len()).to_ne_bytes().to_vec();
        out.extend(SOL_SOCKET.to_ne_bytes());
        out.extend(kind.to_ne_bytes());
        out.extend(data);
        out.resize(out.len().next_multiple_of(size_of::<usize>()), 0xEE);
        out
    }

    pub fn timespec(t: i64) -> Vec<u8> {
        [(t / SECOND).to_ne_bytes(), (t % SECOND).to_ne_bytes()].concat()
    }

    const T: i64 = 1_773_475_330_123_456_789;

    fn timestamping(software: i64, raw: i64) -> Vec<u8> {
        message(
            SCM_TIMESTAMPING,
            &[timespec(software), timespec(0), timespec(raw)].concat(),
        )
    }

    #[test]
    fn all_kinds_are_read_in_any_order() {
        let count = message(SO_RXQ_OVFL, &7_u32.to_ne_bytes());
        let kernel = message(SCM_TIMESTAMPNS, &timespec(T));
        let both = timestamping(T + 1, 5);
        let expected = Notes {
            kernel: Some(T),
            hardware: Some(5),
            dropped: Some(7),
        };
        assert_eq!(
            Notes::read(&[kernel.clone(), both.clone(), count.clone()].concat()),
            expected
        );
        assert_eq!(Notes::read(&[count, both, kernel].concat()), expected);
    }

    #[test]
    fn a_time_that_is_not_offered_is_none() {
        let notes = Notes::read(&timestamping(T, 0));
        assert_eq!((notes.kernel, notes.hardware), (Some(T), None));
        assert_eq!(Notes::read(&timestamping(0, 0)), Notes::default());
        assert_eq!(Notes::read(&message(SCM_TIMESTAMPNS, &timespec(T)[..12])).kernel, None);
        let far = [i64::MAX.to_ne_bytes(), [0; 8]].concat();
        assert_eq!(Notes::read(&message(SCM_TIMESTAMPNS, &far)).kernel, None);
    }

    #[test]
    fn a_timespec_of_32_bits_is_read() {
        let short = [9_i32.to_ne_bytes(), 8_i32.to_ne_bytes()].concat();
        let notes = Notes::read(&message(SCM_TIMESTAMPNS, &short));
        assert_eq!(notes.kernel, Some(9 * SECOND + 8));
    }

    #[test]
    fn other_messages_are_passed_over() {
        let mut foreign = message(SO_RXQ_OVFL, &9_u32.to_ne_bytes());
        foreign[size_of::<usize>()] ^= 0x40; // another level
        let all = [message(1, b"abc"), foreign, message(SO_RXQ_OVFL, &3_u32.to_ne_bytes())].concat();
        assert_eq!(Notes::read(&all).dropped, Some(3));
    }

    #[test]
    fn what_is_cut_is_not_made_up() {
        let whole = [
            message(SCM_TIMESTAMPNS, &timespec(T)),
            message(SO_RXQ_OVFL, &3_u32.to_ne_bytes()),
        ]
        .concat();
        for end in 0..whole.len() {
            let notes = Notes::read(&whole[..end]);
            assert_eq!(notes.kernel.is_some(), end >= HEADER + 16);
            assert_eq!(notes.dropped.is_some(), end >= 2 * HEADER + 20);
        }
        for length in [0, 1, HEADER - 1, usize::MAX] {
            let mut odd = whole.clone();
            odd[..size_of::<usize>()].copy_from_slice(&length.to_ne_bytes());
            assert_eq!(Notes::read(&odd), Notes::default());
        }
    }
}
