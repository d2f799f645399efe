//! When to ask the kernel, how much to take, and when to speak of an error.
#![forbid(unsafe_code)]

use std::collections::VecDeque;
use std::os::fd::RawFd;
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};

use libc::{
    c_int, EAGAIN, ECONNRESET, EINTR, SK_MEMINFO_DROPS, SOF_TIMESTAMPING_RAW_HARDWARE, SOF_TIMESTAMPING_RX_HARDWARE,
    SOF_TIMESTAMPING_RX_SOFTWARE, SOF_TIMESTAMPING_SOFTWARE, SO_MEMINFO, SO_RCVBUF, SO_RCVBUFFORCE, SO_RXQ_OVFL,
    SO_TIMESTAMPING, SO_TIMESTAMPNS,
};

use super::datagrams::{DatagramRows, Stamped};
use super::system::{option, set_option, wait, Buffers, Errno, Wakeup};
use crate::frame_batch::FrameBatch;

/// Rows that wait for `take` at most, give or take a few.
const MOST_ROWS: usize = 1 << 16;
/// Bytes of the receive buffer that one frame takes, as the kernel counts.
const FRAME_BYTES: u32 = 768;
/// Frames that a bus can carry in a millisecond (47 bits each at 1 Mbit/s).
const MOST_A_MILLISECOND: u32 = 22;
/// Where `SO_MEMINFO` has the drop counter: its last number.
const DROPS: usize = SK_MEMINFO_DROPS as usize;

/// How to set up a socket.
#[derive(Clone, Copy, Debug)]
pub struct Options {
    /// Bytes of receive buffer, as `setsockopt` takes them: the kernel counts twice as many.
    pub buffer: u32,
    /// Take times of the controller where it offers some.
    pub hardware: bool,
    /// How long frames may wait in the kernel, so that one call takes several.
    pub gather: Duration,
}

/// What a call came to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Outcome {
    /// So many more rows.
    Rows(usize),
    /// A signal came first.
    Interrupted,
    Failed(Errno),
}

/// A socket that somebody else has opened and will close.
pub struct ReceiveSocket {
    socket: RawFd,
    wakeup: Wakeup,
    /// Bytes of receive buffer, as the kernel counts.
    buffer: u32,
    gather: Duration,
    state: Mutex<State>,
}

struct State {
    received: DatagramRows,
    buffers: Buffers,
    failures: VecDeque<Errno>,
    /// Rows that the last call brought.
    brought: usize,
}

impl ReceiveSocket {
    /// Asks for time stamps, the drop counter and a larger buffer.
    ///
    /// # Errors
    /// It is no socket, or one that has none of this. To get less buffer than wished for is no error.
    pub fn open(socket: RawFd, name: &str, options: Options) -> Result<ReceiveSocket, Errno> {
        set_option(socket, SO_TIMESTAMPNS, 1)?;
        set_option(socket, SO_RXQ_OVFL, 1)?;
        if options.hardware {
            let wanted = SOF_TIMESTAMPING_RX_HARDWARE
                | SOF_TIMESTAMPING_RAW_HARDWARE
                | SOF_TIMESTAMPING_RX_SOFTWARE
                | SOF_TIMESTAMPING_SOFTWARE;
            set_option(socket, SO_TIMESTAMPING, wanted as c_int)?;
        }
        let buffer = enlarge(socket, options.buffer)?;
        // Half of the buffer is left for the time until the thread runs again.
        let safe = Duration::from_millis((buffer / FRAME_BYTES / MOST_A_MILLISECOND / 2).into());
        Ok(ReceiveSocket {
            socket,
            wakeup: Wakeup::new()?,
            buffer,
            gather: options.gather.min(safe),
            state: Mutex::new(State {
                received: DatagramRows::new(name, options.hardware),
                buffers: Buffers::default(),
                failures: VecDeque::new(),
                brought: 0,
            }),
        })
    }

    /// Waits for datagrams until `end` or `wake` and takes all there are, up to [`MOST_ROWS`]. An error is told when
    /// nothing is left to read: by the call after the one that brought the last rows.
    pub fn receive(&self, end: Instant) -> Outcome {
        if let Some(errno) = self.state().failures.pop_front() {
            return Outcome::Failed(errno);
        }
        let mut ready = match wait(Some(self.socket), &self.wakeup, milliseconds(end)) {
            Ok(ready) => ready,
            Err(EINTR) => return Outcome::Interrupted,
            Err(errno) => return Outcome::Failed(errno),
        };
        if ready.socket && !ready.wakeup {
            let end = end.min(Instant::now() + self.state().pause(self.gather, self.buffer));
            // A signal cuts this short; who handles it wants to have what is there.
            ready.wakeup = wait(None, &self.wakeup, milliseconds(end)).is_ok_and(|now| now.wakeup);
        }
        if ready.wakeup {
            self.wakeup.clear();
        }
        let mut state = self.state();
        let rows = if ready.socket { state.receive(self.socket) } else { 0 };
        let failure = if rows == 0 { state.failures.pop_front() } else { None };
        match failure {
            Some(errno) => Outcome::Failed(errno),
            None if rows == 0 && ready.hung_up => Outcome::Failed(ECONNRESET),
            None => Outcome::Rows(rows),
        }
    }

    /// Ends the wait of another thread, or else the next one.
    pub fn wake(&self) {
        self.wakeup.raise();
    }

    /// Takes what is still there and makes a row of the losses that no frame told; how many rows there are more.
    pub fn finish(&self) -> usize {
        let mut state = self.state();
        let before = state.received.rows.waiting();
        state.receive(self.socket);
        if let Some(counter) = self.counter() {
            let now = system_time();
            state.received.tell_rest(counter, now);
        }
        state.received.rows.waiting() - before
    }

    /// Everything since the last call.
    pub fn take(&self) -> FrameBatch {
        self.state().received.rows.take()
    }

    pub fn waiting(&self) -> usize {
        self.state().received.rows.waiting()
    }

    /// Bytes of receive buffer that were granted, as the kernel counts.
    pub fn buffer(&self) -> u32 {
        self.buffer
    }

    pub fn stamped(&self) -> Stamped {
        self.state().received.stamped
    }

    /// Frames told as lost by rows so far.
    pub fn dropped(&self) -> u64 {
        self.state().received.losses.total
    }

    /// Frames lost so far, whether a row tells of them or not yet.
    pub fn drops_now(&self) -> u64 {
        let losses = self.state().received.losses;
        losses.total + u64::from(self.counter().map_or(0, |counter| losses.beyond(counter)))
    }

    fn counter(&self) -> Option<u32> {
        option::<{ DROPS + 1 }>(self.socket, SO_MEMINFO)
            .ok()
            .map(|numbers| numbers[DROPS])
    }

    fn state(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl State {
    /// Takes what can be read; how many rows that makes. An error does not end it, for frames are behind it, but two in
    /// a row do.
    fn receive(&mut self, socket: RawFd) -> usize {
        let State {
            received,
            buffers,
            failures,
            ..
        } = self;
        let before = received.rows.waiting();
        let mut failed = false;
        while received.rows.waiting() < MOST_ROWS {
            match buffers.receive(socket) {
                Ok(datagrams) => {
                    let now = system_time();
                    datagrams.for_each(|datagram| received.add(datagram, now));
                    failed = false;
                }
                Err(EAGAIN) => break,
                Err(EINTR) => {}
                Err(_) if failed => break,
                Err(errno) => {
                    failures.push_back(errno);
                    failed = true;
                }
            }
        }
        self.brought = received.rows.waiting() - before;
        self.brought
    }

    /// How long to let frames gather: not at all when so many came that the buffer would not hold as many again for long.
    fn pause(&self, gather: Duration, buffer: u32) -> Duration {
        if self.brought > (buffer / FRAME_BYTES / 4) as usize {
            Duration::ZERO
        } else {
            gather
        }
    }
}

/// What is granted in the end, as the kernel counts.
fn enlarge(socket: RawFd, wanted: u32) -> Result<u32, Errno> {
    let size = || option::<1>(socket, SO_RCVBUF).map(|[size]| size);
    let value = wanted.min(c_int::MAX as u32 / 2);
    for name in [SO_RCVBUFFORCE, SO_RCVBUF] {
        if size()? / 2 >= value {
            break;
        }
        // Only the superuser may force it; the second one grants what the system allows to anybody.
        let _ = set_option(socket, name, value as c_int);
    }
    size()
}

/// Rounded up, so that a wait does not end before its time.
fn milliseconds(end: Instant) -> c_int {
    let left = end.saturating_duration_since(Instant::now());
    c_int::try_from(left.as_micros().div_ceil(1000)).unwrap_or(c_int::MAX)
}

/// Nanoseconds of the system clock.
fn system_time() -> i64 {
    let since = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
    i64::try_from(since.as_nanos()).unwrap_or(i64::MAX)
}
