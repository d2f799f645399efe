//! Datagrams to rows: each is a frame, an error frame or unreadable, and a drop stands before the frame that tells it.
#![forbid(unsafe_code)]

use libc::{c_int, MSG_DONTROUTE, MSG_TRUNC};

use super::control::Notes;
use super::frame;
use super::losses::Losses;
use crate::frames::{RX, TX};
use crate::line::escape;
use crate::reader::Rows;
use crate::stamp::Stamps;

/// Characters of an interface name that are quoted.
const QUOTED: usize = 64;

/// What one `recvmsg` gives.
#[derive(Clone, Copy, Debug)]
pub struct Datagram<'a> {
    pub bytes: &'a [u8],
    pub control: &'a [u8],
    /// `msg_flags`.
    pub flags: c_int,
}

/// How many datagrams got their time from where.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Stamped {
    /// From the kernel: the system clock when the frame was taken in.
    pub kernel: u64,
    /// From the controller's own clock, which is not the system clock.
    pub hardware: u64,
    /// From nobody: the system clock when the frame was read.
    pub read: u64,
}

/// Rows of one interface under way.
#[derive(Debug)]
pub struct DatagramRows {
    pub rows: Rows,
    pub losses: Losses,
    pub stamped: Stamped,
    /// The interface, quoted.
    name: String,
    bus: u8,
    /// Take the controller's time where there is one.
    hardware: bool,
    /// Time of the last datagram.
    last: i64,
}

impl DatagramRows {
    pub fn new(name: &str, hardware: bool) -> Self {
        let mut rows = Rows::default();
        DatagramRows {
            bus: rows.bus(name.as_bytes()).unwrap_or_default(),
            rows,
            losses: Losses::default(),
            stamped: Stamped::default(),
            name: escape(name.as_bytes(), QUOTED),
            hardware,
            last: 0,
        }
    }

    /// Makes the rows of a datagram that was read at `now`.
    pub fn add(&mut self, datagram: Datagram<'_>, now: i64) {
        let notes = Notes::read(datagram.control);
        let t = self.time(&notes, now);
        self.last = t;
        if let Some(counter) = notes.dropped {
            self.tell(counter, t);
        }
        match frame::read(datagram.bytes, datagram.flags & MSG_TRUNC != 0) {
            Ok(mut frame) => {
                // As candump and python-can have it: sent is what any program of this machine sent.
                frame.flags |= if datagram.flags & MSG_DONTROUTE == 0 { RX } else { TX };
                frame.push(t, self.bus, &mut self.rows);
            }
            Err(reason) => self.rows.unreadable(t, Some(self.bus), &reason),
        }
        self.rows.stamp(Stamps::ABSOLUTE);
        self.rows.stamp(Stamps::NANOSECONDS);
    }

    /// Makes a row of what is lost beyond the last frame, as `counter` says at `now`.
    pub fn tell_rest(&mut self, counter: u32, now: i64) {
        // Times of the controller are not of the clock that says what is now.
        let t = if self.stamped.hardware > 0 { self.last } else { now };
        self.tell(counter, t);
    }

    /// Makes a row of what the drop counter has on top of all that was told, in the words of candump.
    fn tell(&mut self, counter: u32, t: i64) {
        let frames = self.losses.tell(counter);
        if frames == 0 {
            return;
        }
        let (name, total) = (&self.name, self.losses.total);
        let ending = if frames == 1 { "" } else { "s" };
        let text = format!("DROPCOUNT: dropped {frames} CAN frame{ending} on '{name}' socket (total drops {total})");
        self.rows.drops(t, Some(self.bus), frames, &text);
    }

    fn time(&mut self, notes: &Notes, now: i64) -> i64 {
        if let Some(t) = notes.hardware.filter(|_| self.hardware) {
            self.stamped.hardware += 1;
            t
        } else if let Some(t) = notes.kernel {
            self.stamped.kernel += 1;
            t
        } else {
            self.stamped.read += 1;
            now
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::control::tests::{message, timespec};
    use super::super::frame::tests::packet;
    use super::*;
    use crate::frames::WORD_ERROR;
    use libc::{SCM_TIMESTAMPING, SCM_TIMESTAMPNS, SO_RXQ_OVFL};

    const T: i64 = 1_773_475_330_123_456_789;

    fn stamp(t: i64) -> Vec<u8> {
        message(SCM_TIMESTAMPNS, &timespec(t))
    }

    fn counter(count: u32) -> Vec<u8> {
        message(SO_RXQ_OVFL, &count.to_ne_bytes())
    }

    fn add(received: &mut DatagramRows, bytes: &[u8], control: &[u8], flags: c_int) {
        received.add(Datagram { bytes, control, flags }, T + 1000);
    }

    fn frame(id: u32) -> Vec<u8> {
        packet(id, [1, 0, 0, 0], b"x", 16)
    }

    #[test]
    fn a_drop_stands_before_the_frame_that_tells_it() {
        let mut received = DatagramRows::new("can0", false);
        for (at, count) in [(0, 0), (1, 5), (2, 5), (3, 6)] {
            add(&mut received, &frame(1), &[stamp(T + at), counter(count)].concat(), 0);
        }
        let batch = received.rows.take();
        assert_eq!(batch.frames.line, [1, 3, 4, 6]);
        assert_eq!(
            (&batch.events.line[..], &batch.events.class[..]),
            (&[2, 5][..], &[5, 1][..])
        );
        assert_eq!(batch.events.t, [T + 1, T + 3]);
        assert_eq!(
            batch.events.text_of(0),
            "DROPCOUNT: dropped 5 CAN frames on 'can0' socket (total drops 5)"
        );
        assert_eq!(
            batch.events.text_of(1),
            "DROPCOUNT: dropped 1 CAN frame on 'can0' socket (total drops 6)"
        );
        assert_eq!(
            (batch.counts.dropped, batch.counts.lines, received.losses.total),
            (6, 6, 6)
        );
    }

    #[test]
    fn hardware_times_are_taken_on_request_only() {
        let both = [timespec(T), timespec(0), timespec(7)].concat();
        let control = [stamp(T), message(SCM_TIMESTAMPING, &both)].concat();
        for (hardware, expected) in [(false, T), (true, 7)] {
            let mut received = DatagramRows::new("can0", hardware);
            add(&mut received, &frame(1), &control, 0);
            add(&mut received, &frame(1), &stamp(T), 0);
            add(&mut received, &frame(1), &[], 0);
            let stamped = received.stamped;
            assert_eq!(received.rows.take().frames.t, [expected, T, T + 1000]);
            let taken = u64::from(hardware);
            assert_eq!((stamped.hardware, stamped.kernel, stamped.read), (taken, 2 - taken, 1));
        }
    }

    #[test]
    fn sent_is_what_this_machine_sent() {
        let mut received = DatagramRows::new("can0", false);
        let error = packet(WORD_ERROR | 0x40, [8, 0, 0, 0], &[0; 8], 16);
        for flags in [0, MSG_DONTROUTE, MSG_DONTROUTE | libc::MSG_CONFIRM] {
            add(&mut received, &frame(1), &[], flags);
            add(&mut received, &error, &[], flags);
        }
        let batch = received.rows.take();
        assert_eq!(batch.frames.flags, [RX, TX, TX]);
        assert_eq!(batch.events.flags, [RX, TX, TX]);
        assert_eq!(batch.counts.error_frames, 3);
    }

    #[test]
    fn every_datagram_is_one_row() {
        let mut received = DatagramRows::new("can0", false);
        for size in 0..100 {
            add(
                &mut received,
                &vec![0xFF; size.min(72)],
                &stamp(T),
                if size > 72 { MSG_TRUNC } else { 0 },
            );
        }
        let batch = received.rows.take();
        assert_eq!(
            (batch.counts.unreadable, batch.events.len(), batch.counts.lines),
            (100, 100, 100)
        );
    }
}
