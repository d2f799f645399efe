//! Frames joined with what became of them, and the laws that hold whatever the frames were.

use _native::frames::{Frames, EXTENDED, FD, NO_TIME, REMOTE};
use _native::reassembly::Results;
use _native::slot::{MAX_TRANSFER, TIMEOUT_NS};
use _native::transfers::{Status, Transfers};
use _native::verdict::{Verdict, VERDICTS};
use _native::wire::{nameless_bits, priority, session_bits, Id, Kind};

use crate::sender::{crc, signatures};

/// The batches of one capture, put together.
#[derive(Debug, Default, PartialEq, Eq)]
pub struct Capture {
    pub frames: Frames,
    pub verdict: Vec<u8>,
    pub anomaly: Vec<u16>,
    pub transfers: Transfers,
}

impl Capture {
    pub fn join(&mut self, frames: &Frames, results: Results) {
        assert_eq!(results.first_frame, self.frames.len() as u64);
        for row in 0..frames.len() {
            let (t, bus, id, flags) = (frames.t[row], frames.bus[row], frames.id[row], frames.flags[row]);
            let (line, data) = (frames.line[row].into(), frames.data_of(row));
            self.frames.push(t, bus, id, flags, line, data);
        }
        self.verdict.extend(results.verdict);
        self.anomaly.extend(results.anomaly);
        let settled = results.settled;
        for ((frame, verdict), anomaly) in settled.frame.into_iter().zip(settled.verdict).zip(settled.anomaly) {
            assert!(
                frame < results.first_frame,
                "a frame of this batch is corrected in place"
            );
            self.verdict[frame as usize] = verdict;
            self.anomaly[frame as usize] |= anomaly;
        }
        self.transfers.append(results.transfers);
    }

    /// Every frame is in exactly one transfer or has another verdict, `counts` agree, and each row says what its
    /// frames say.
    pub fn check(&self, counts: [u64; VERDICTS]) {
        assert_eq!(self.verdict.len(), self.frames.len());
        assert_eq!(self.anomaly.len(), self.frames.len());
        let mut counted = [0; VERDICTS];
        self.verdict
            .iter()
            .for_each(|&verdict| counted[usize::from(verdict)] += 1);
        assert_eq!(counts, counted, "the counts are those of the final verdicts");
        let mut named = self.transfers.frame.clone();
        named.sort_unstable();
        let used = (0..)
            .zip(&self.verdict)
            .filter(|(_, &verdict)| verdict == Verdict::Used as u8);
        assert!(used.map(|(frame, _)| frame).eq(named), "used = named by one transfer");
        (0..self.transfers.len()).for_each(|row| self.check_transfer(row));
        (0..self.frames.len()).for_each(|frame| self.check_verdict(frame));
    }

    fn tail(&self, frame: usize) -> Option<u8> {
        self.frames.data_of(frame).last().copied()
    }

    fn session(&self, frame: usize) -> (u8, u32) {
        (self.frames.bus[frame], session_bits(self.frames.id[frame]))
    }

    fn check_verdict(&self, frame: usize) {
        let later = self.tail(frame).is_some_and(|tail| tail & 0x80 == 0);
        let bare = self.frames.data_of(frame).is_empty() || self.frames.flags[frame] & REMOTE != 0;
        let copied = || {
            let same = |other: &usize| self.session(*other) == self.session(frame);
            let mut before = (0..frame).rev().filter(same);
            before.any(|other| self.frames.data_of(other) == self.frames.data_of(frame))
        };
        let extended = self.frames.flags[frame] & EXTENDED != 0;
        let holds = match self.verdict[frame] {
            verdict if verdict == Verdict::Foreign as u8 => true,
            verdict if verdict == Verdict::NoTail as u8 => extended && bare,
            _ if !extended || bare => false,
            verdict if verdict == Verdict::Orphan as u8 || verdict == Verdict::WrongTransferId as u8 => later,
            verdict if verdict == Verdict::Duplicate as u8 => copied(),
            _ => true,
        };
        assert!(holds, "frame {frame} with verdict {}", self.verdict[frame]);
    }

    fn check_transfer(&self, row: usize) {
        let (rows, frames) = (&self.transfers, &self.frames);
        let numbers: Vec<usize> = rows.frames_of(row).iter().map(|&frame| frame as usize).collect();
        assert!(numbers.is_sorted_by(|a, b| a < b), "transfer {row}: frames {numbers:?}");
        let (first, last) = (numbers[0], numbers[numbers.len() - 1]);
        let nameless = rows.kind[row] == Kind::Message as u8 && rows.src[row] == 0;
        let bits_of = |frame: usize| {
            let raw = frames.id[frame];
            nameless_bits(raw).filter(|_| nameless).unwrap_or(session_bits(raw))
        };
        let id = Id::of_session(bits_of(first));
        assert_eq!((rows.t[row], rows.t_end[row]), (frames.t[first], frames.t[last]));
        assert_eq!(
            (rows.bus[row], rows.priority[row]),
            (frames.bus[first], priority(frames.id[first]))
        );
        assert_eq!(
            (rows.kind[row], rows.type_id[row], rows.src[row], rows.dst[row]),
            (id.kind as u8, id.type_id, id.src, id.dst)
        );
        for &frame in &numbers {
            assert_eq!((frames.bus[frame], bits_of(frame)), (frames.bus[first], bits_of(first)));
            assert_eq!(self.tail(frame).map(|tail| tail & 31), Some(rows.transfer_id[row]));
            let timed = frames.t[first] != NO_TIME && frames.t[frame] != NO_TIME;
            assert!(!timed || frames.t[frame].saturating_sub(frames.t[first]) <= TIMEOUT_NS);
        }
        assert!(rows.payload_of(row).len() < MAX_TRANSFER + 64);
        self.check_payload(row, &numbers, &signatures(id.kind.is_service(), id.type_id));
    }

    /// The payload is what the frames hold, in order, between CRC and tail bytes; the status is the one it deserves.
    fn check_payload(&self, row: usize, numbers: &[usize], signatures: &[u64]) {
        let rows = &self.transfers;
        let (mut bytes, mut marks) = (vec![], vec![]);
        let (mut sound, mut fd) = (true, false);
        for (at, &frame) in numbers.iter().enumerate() {
            if let Some((tail, body)) = self.frames.data_of(frame).split_last() {
                // Behind a break in the sequence the frames are evidence only.
                sound &= at == 0 || usize::from(tail >> 5 & 1) == at % 2;
                fd |= sound && self.frames.flags[frame] & FD != 0;
                bytes.extend_from_slice(if sound { body } else { &[] });
                marks.push(tail & 0xE0);
            }
        }
        assert_eq!(rows.fd[row] != 0, fd, "transfer {row}");
        let single = marks[0] & 0xC0 == 0xC0;
        assert!(marks[0] & 0xA0 == 0x80 || single, "transfer {row} starts with a start");
        let payload = if single { Some(&bytes[..]) } else { bytes.get(2..) };
        assert_eq!(rows.payload_of(row), payload.unwrap_or(&[]), "transfer {row}");
        let wire = bytes
            .first_chunk()
            .filter(|_| !single)
            .map(|crc| u16::from_le_bytes(*crc));
        let sequence = (0..marks.len()).all(|at| {
            let (start, end, toggle) = (at == 0, at + 1 == marks.len(), at % 2 == 1);
            marks[at] == (u8::from(start) << 7) | (u8::from(end) << 6) | (u8::from(toggle) << 5)
        });
        let status = rows.status[row];
        let broken = [Status::Interrupted, Status::TimedOut, Status::Open].map(|status| status as u8);
        let sums = |payload: Option<&[u8]>| -> Vec<u16> {
            let payload = payload.unwrap_or(&[]);
            signatures.iter().map(|&signature| crc(signature, payload)).collect()
        };
        let (expected, here) = match (single, wire) {
            _ if broken.contains(&status) && !single => {
                assert!(!sequence, "transfer {row} is whole, its status {status}");
                (status, None)
            }
            (true, _) if signatures.is_empty() => (Status::Unchecked as u8, None),
            (true, _) => (Status::Ok as u8, None),
            (_, None) => (Status::TooShort as u8, None),
            (_, Some(wire)) => match sums(payload)[..] {
                [] => (Status::Unchecked as u8, None),
                ref sums if sums.contains(&wire) => (Status::Ok as u8, Some(wire)),
                [preferred, ..] => (Status::BadCrc as u8, Some(preferred)),
            },
        };
        assert!(
            sequence || single || broken.contains(&status),
            "transfer {row}: {marks:02X?}"
        );
        assert_eq!(status, expected, "transfer {row}");
        let valid = u8::from(wire.is_some()) | (u8::from(here.is_some()) << 1);
        assert_eq!(
            (rows.crc_valid[row], rows.crc_wire[row], rows.crc_here[row]),
            (valid, wire.unwrap_or(0), here.unwrap_or(0)),
            "transfer {row}"
        );
    }
}
