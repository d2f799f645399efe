//! A SocketCAN socket for Python: waits without the interpreter, and lets signals through.

use std::os::fd::RawFd;
use std::time::{Duration, Instant};

use pyo3::exceptions::PyOSError;
use pyo3::prelude::*;
use pyo3::types::PyDict;

use super::reader::FrameBatch;
use super::Dict;
use crate::receive::socket::{Options, Outcome, ReceiveSocket};

/// The longest wait, some 24 days.
const LONGEST_MS: u64 = i32::MAX as u64;

/// Takes frames from a socket that python-can has opened, set up and bound, and that it keeps open meanwhile.
#[pyclass(frozen)]
pub struct SocketReceiver(ReceiveSocket);

#[pymethods]
impl SocketReceiver {
    /// `bus` is the name of the interface; `buffer` bytes of receive buffer are asked for, with `hardware` times of the
    /// controller, and frames may wait in the kernel for `gather_ms`. Raises `OSError`.
    #[new]
    #[pyo3(signature = (fd, bus, *, buffer = 4 << 20, hardware = false, gather_ms = 50))]
    fn new(py: Python<'_>, fd: RawFd, bus: &str, buffer: u32, hardware: bool, gather_ms: u32) -> PyResult<Self> {
        let options = Options {
            buffer,
            hardware,
            gather: Duration::from_millis(gather_ms.into()),
        };
        let socket = ReceiveSocket::open(fd, bus, options);
        socket.map(SocketReceiver).map_err(|errno| failure(py, errno))
    }

    /// Waits for frames, `wake` or the end of the time, and takes all there are, or so many that some 65,536 rows wait for
    /// `take`: the number of new rows. Raises `OSError` with what the kernel says, once nothing is left to read; the next
    /// call goes on.
    fn receive(&self, py: Python<'_>, timeout_ms: u64) -> PyResult<usize> {
        let end = Instant::now() + Duration::from_millis(timeout_ms.min(LONGEST_MS));
        loop {
            match py.detach(|| self.0.receive(end)) {
                Outcome::Rows(rows) => return Ok(rows),
                Outcome::Interrupted => py.check_signals()?,
                Outcome::Failed(errno) => return Err(failure(py, errno)),
            }
        }
    }

    /// Ends the wait of another thread, or else the next one.
    fn wake(&self) {
        self.0.wake();
    }

    /// Takes what is still there and makes a row of the losses that no frame told: the number of new rows.
    fn finish(&self, py: Python<'_>) -> usize {
        py.detach(|| self.0.finish())
    }

    /// Everything since the last call.
    fn take(&self, py: Python<'_>) -> FrameBatch {
        FrameBatch(py.detach(|| self.0.take()))
    }

    /// Rows of frames and events that wait for `take`.
    #[getter]
    fn waiting(&self, py: Python<'_>) -> usize {
        py.detach(|| self.0.waiting())
    }

    /// Bytes of receive buffer that were granted, as the kernel counts: a classic frame takes 768.
    #[getter]
    fn buffer(&self) -> u32 {
        self.0.buffer()
    }

    /// Frames told as lost by rows so far.
    #[getter]
    fn dropped(&self, py: Python<'_>) -> u64 {
        py.detach(|| self.0.dropped())
    }

    /// Frames lost so far, whether a row tells of them or not yet.
    fn drops_now(&self, py: Python<'_>) -> u64 {
        py.detach(|| self.0.drops_now())
    }

    /// How many datagrams got their time from where: the `kernel`, the `hardware`, or the moment they were `read`.
    #[getter]
    fn stamped<'py>(&self, py: Python<'py>) -> PyResult<Dict<'py>> {
        let stamped = py.detach(|| self.0.stamped());
        let dict = PyDict::new(py);
        dict.set_item("kernel", stamped.kernel)?;
        dict.set_item("hardware", stamped.hardware)?;
        dict.set_item("read", stamped.read)?;
        Ok(dict)
    }
}

fn failure(py: Python<'_>, errno: i32) -> PyErr {
    let text = py
        .import("os")
        .and_then(|os| os.call_method1("strerror", (errno,))?.extract::<String>());
    text.map_or_else(|error| error, |text| PyOSError::new_err((errno, text)))
}
