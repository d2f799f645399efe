//! Frames straight into the reassembly: what each sequence must give. Every sequence is read many times, with the
//! results taken at other places, and has to give the same.

mod bounds;
#[path = "../common/capture.rs"]
mod capture;
mod counters;
mod faulty;
mod receiver;
mod restart;
#[path = "../common/sender.rs"]
mod sender;
mod trust;

use _native::frames::{Frames, EXTENDED, FD, REMOTE};
use _native::reassembly::Reassembler;
use _native::transfers::Status;
use _native::verdict::Verdict;

use capture::Capture;
use sender::{cut, signatures};

pub(crate) const MS: i64 = 1_000_000;
/// Messages of a known type (1034) from node 10.
pub(crate) const ESC: u32 = 0x1004_0A0A;

/// Frames under way to the reassembly: one bus, 1 ms from frame to frame.
#[derive(Default)]
pub(crate) struct Bus {
    frames: Frames,
    t: i64,
}

impl Bus {
    pub(crate) fn wait(&mut self, ns: i64) -> &mut Self {
        self.t += ns;
        self
    }

    fn push(&mut self, id: u32, flags: u16, data: &[u8]) -> &mut Self {
        self.t += MS;
        let line = self.frames.len() as u64 + 1;
        self.frames.push(self.t, 0, id, flags, line, data);
        self
    }

    /// A classic data frame with a 29-bit identifier.
    pub(crate) fn frame(&mut self, id: u32, data: &[u8]) -> &mut Self {
        self.push(id, EXTENDED, data)
    }

    pub(crate) fn fd_frame(&mut self, id: u32, data: &[u8]) -> &mut Self {
        self.push(id, EXTENDED | FD, data)
    }

    pub(crate) fn standard(&mut self, id: u32, data: &[u8]) -> &mut Self {
        self.push(id, 0, data)
    }

    pub(crate) fn remote(&mut self, id: u32) -> &mut Self {
        self.push(id, EXTENDED | REMOTE, &[])
    }

    pub(crate) fn transfer(&mut self, id: u32, transfer_id: u8, payload: &[u8]) -> &mut Self {
        for data in cut(id, transfer_id, payload, false) {
            self.frame(id, &data);
        }
        self
    }

    /// What the reassembly makes of it, without the end of capture.
    pub(crate) fn so_far(&self) -> Capture {
        self.read(usize::MAX, false)
    }

    /// What the reassembly makes of it: the same wherever the results are taken.
    pub(crate) fn end(&self) -> Capture {
        let whole = self.read(usize::MAX, true);
        for stride in [1, 2, 3, 7, 50] {
            assert_eq!(self.read(stride, true), whole, "taken every {stride} frames");
        }
        whole
    }

    fn read(&self, stride: usize, finish: bool) -> Capture {
        let mut reassembler = Reassembler::new(Box::new(signatures));
        let (mut capture, mut batch, mut fed) = (Capture::default(), Frames::default(), 0);
        for row in 0..self.frames.len() {
            let (t, bus, id) = (self.frames.t[row], self.frames.bus[row], self.frames.id[row]);
            let (flags, line) = (self.frames.flags[row], self.frames.line[row].into());
            batch.push(t, bus, id, flags, line, self.frames.data_of(row));
            if batch.len() == stride {
                reassembler.feed(&batch, fed);
                capture.join(&std::mem::take(&mut batch), reassembler.take());
                fed = 0;
            } else if row % 2 == 0 {
                reassembler.feed(&batch, fed);
                fed = batch.len();
            }
        }
        reassembler.feed(&batch, fed);
        if finish {
            reassembler.finish();
        }
        capture.join(&batch, reassembler.take());
        if finish {
            capture.check(reassembler.counts());
        }
        capture
    }
}

impl Capture {
    pub(crate) fn assert_verdicts(&self, expected: &[Verdict]) -> &Self {
        let expected: Vec<u8> = expected.iter().map(|&verdict| verdict as u8).collect();
        assert_eq!(self.verdict, expected);
        self
    }

    /// Status and anomaly bits of each transfer.
    pub(crate) fn assert_transfers(&self, expected: &[(Status, u32)]) -> &Self {
        let rows = self.transfers.status.iter().zip(&self.transfers.anomaly);
        let rows: Vec<(u8, u32)> = rows.map(|(&status, &anomaly)| (status, anomaly)).collect();
        let expected: Vec<(u8, u32)> = expected.iter().map(|&(status, bits)| (status as u8, bits)).collect();
        assert_eq!(rows, expected, "frames {:?}", self.transfers.frame);
        self
    }
}
