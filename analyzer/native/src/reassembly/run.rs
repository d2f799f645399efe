//! The way of a frame to its session: the short one as long as it goes, the long one for the rest.
#![forbid(unsafe_code)]

#[cfg(test)]
mod tests;

use super::columns::Columns;
use super::{key, Reassembler, Standing, SWEEP_NS};
use crate::frames::{Frames, ERROR, EXTENDED, FD, NO_TIME, REMOTE};
use crate::slot::{Frame, TIMEOUT_NS};
use crate::verdict::{frame_anomaly, Outcome, Verdict};
use crate::wire::session_bits;

impl Reassembler {
    /// Runs the rows of `frames` from `first` on.
    pub fn feed(&mut self, frames: &Frames, first: usize) {
        self.feed_by(Self::run, frames, first);
    }

    /// `run` goes as far as it can from a row on, and says how far.
    fn feed_by(&mut self, run: impl Fn(&mut Self, &Frames, usize) -> usize, frames: &Frames, first: usize) {
        let (count, done) = (frames.len() - first, self.results.verdict.len());
        // What is in order needs no further store.
        self.results.verdict.resize(done + count, Verdict::Used as u8);
        self.results.anomaly.resize(done + count, 0);
        self.counts[Verdict::Used as usize] += count as u64;
        let mut row = run(self, frames, first);
        while row < frames.len() {
            let outcome = self.hear(frames, row);
            if outcome != Outcome::USED {
                let at = done + row - first;
                self.counts[Verdict::Used as usize] -= 1;
                self.counts[outcome.verdict as usize] += 1;
                self.results.verdict[at] = outcome.verdict as u8;
                self.results.anomaly[at] = outcome.anomaly;
            }
            row = run(self, frames, row + 1);
        }
    }

    /// Runs rows from `first` on that go the short way: of trusted sessions, in time and with no sweep due. Returns the
    /// first other row.
    fn run(&mut self, frames: &Frames, first: usize) -> usize {
        let rows = Columns::of(frames, first);
        // Differences from times so early would tell of a frame without one.
        let earliest = self
            .next_sweep
            .saturating_sub(2 * SWEEP_NS)
            .max(NO_TIME + 2 * TIMEOUT_NS);
        let window = self.next_sweep.max(earliest).wrapping_sub(earliest) as u64;
        let Reassembler {
            index,
            sessions,
            staged,
            bus_time,
            ..
        } = self;
        let (mut row, mut now) = (0, self.now);
        while let Some((bus, word)) = rows.word(row, self.next_frame) {
            let last = &mut bus_time[usize::from(bus)];
            if word.t < *last || word.t.wrapping_sub(earliest) as u64 >= window {
                break;
            }
            let found = index
                .find(key(bus, session_bits(word.id)))
                .and_then(|at| sessions.get_mut(at));
            let Some(Standing::Trusted(session)) = found.map(|place| &mut place.standing) else {
                break;
            };
            let rest = rows
                .rest(row, &word)
                .filter(|rest| window > rest.t_last.wrapping_sub(earliest) as u64);
            let taken = rest.map_or(0, |rest| session.accept_whole(&word, &rest, staged));
            if taken > 1 {
                row += taken;
                now = rows.t[row - 1];
            } else {
                if taken == 0 && !session.accept_short(&word, staged) {
                    break;
                }
                row += 1;
                now = word.t;
            }
            *last = now;
        }
        self.now = now;
        self.next_frame += row as u64;
        self.since_sweep += row;
        first + row
    }

    /// Any one frame, the long way.
    #[inline(never)]
    fn hear(&mut self, frames: &Frames, row: usize) -> Outcome {
        let (t, bus, flags) = (frames.t[row], frames.bus[row], frames.flags[row]);
        let frame = Frame {
            number: self.next_frame,
            t,
            id: frames.id[row],
            fd: flags & FD != 0,
            data: frames.data_of(row),
        };
        self.next_frame += 1;
        let late = self.clock(bus, t);
        let mut outcome = if flags & (EXTENDED | REMOTE | ERROR) == EXTENDED {
            self.extended(bus, &frame, false)
        } else if flags & EXTENDED != 0 {
            self.extended(bus, &frame, true)
        } else {
            Outcome::FOREIGN
        };
        outcome.anomaly |= late | (u16::from(frame.impossible_length()) * frame_anomaly::IMPOSSIBLE_LENGTH);
        outcome
    }

    /// Follows the capture time; the anomaly of a frame that is earlier than its predecessor.
    #[inline]
    fn clock(&mut self, bus: u8, t: i64) -> u16 {
        if t == NO_TIME {
            return 0;
        }
        let last = &mut self.bus_time[usize::from(bus)];
        let late = u16::from(t < *last) * frame_anomaly::BACKWARDS;
        *last = t;
        self.now = t;
        self.since_sweep += 1;
        // A single stamp far ahead of the others must not put the sweeps off.
        let due = t >= self.next_sweep || t < self.next_sweep.saturating_sub(2 * SWEEP_NS);
        if due && self.since_sweep >= self.sessions.len() {
            self.sweep(t);
        }
        late
    }

    /// Closes what has timed out on sessions that fell silent.
    #[cold]
    fn sweep(&mut self, t: i64) {
        self.next_sweep = t.saturating_add(SWEEP_NS);
        self.since_sweep = 0;
        for place in &mut self.sessions {
            match &mut place.standing {
                Standing::Trusted(session) => session.expire(t, &mut self.staged),
                Standing::Foreign => {}
                Standing::Early(early) => early.expire(t),
                Standing::Probation(trial) => trial.session.expire(t, &mut trial.probation.transfers),
            }
        }
    }
}
