//! System calls in safe clothes: the only `unsafe` beside `simd`, and the only file of the core that does I/O.
//!
//! Descriptors are plain numbers here. A wrong one makes a call fail with `EBADF`; whatever it is, the kernel writes
//! nowhere but into memory that the call was given.
#![allow(unsafe_code)]
#![warn(clippy::undocumented_unsafe_blocks, unsafe_op_in_unsafe_fn)]

use std::io;
use std::mem::{size_of, size_of_val, zeroed};
use std::os::fd::{AsRawFd, FromRawFd, OwnedFd, RawFd};
use std::ptr::null_mut;

use libc::{
    c_int, iovec, mmsghdr, nfds_t, pollfd, socklen_t, CANFD_MTU, EFD_CLOEXEC, EFD_NONBLOCK, MSG_DONTWAIT, SOL_SOCKET,
};

use super::datagrams::Datagram;

/// Datagrams that one call takes at most.
pub const BATCH: usize = 128;

/// The number of a system error.
pub type Errno = c_int;

/// Control messages of one datagram: both kinds of time stamps and the drop counter take 120 bytes.
#[derive(Clone, Copy)]
#[repr(align(8))]
struct Control([u8; 192]);

#[derive(Clone, Copy)]
struct Slot {
    bytes: [u8; CANFD_MTU],
    control: Control,
    size: usize,
    noted: usize,
    flags: c_int,
}

/// Room for the datagrams of one call.
pub struct Buffers(Vec<Slot>);

impl Default for Buffers {
    fn default() -> Self {
        let empty = Slot {
            bytes: [0; CANFD_MTU],
            control: Control([0; 192]),
            size: 0,
            noted: 0,
            flags: 0,
        };
        Buffers(vec![empty; BATCH])
    }
}

impl Buffers {
    /// Takes datagrams that are there already.
    ///
    /// # Errors
    /// `EAGAIN` if there is none, else what is wrong with the socket.
    #[allow(clippy::unnecessary_cast)] // C libraries have different types for it
    pub fn receive(&mut self, socket: RawFd) -> Result<impl Iterator<Item = Datagram<'_>>, Errno> {
        // SAFETY: both are C structures of numbers and pointers, for which zeros are a value.
        let (mut heads, mut vectors): ([mmsghdr; BATCH], [iovec; BATCH]) = unsafe { zeroed() };
        for ((slot, vector), head) in self.0.iter_mut().zip(&mut vectors).zip(&mut heads) {
            vector.iov_base = slot.bytes.as_mut_ptr().cast();
            vector.iov_len = CANFD_MTU;
            head.msg_hdr.msg_iov = vector;
            head.msg_hdr.msg_iovlen = 1;
            head.msg_hdr.msg_control = slot.control.0.as_mut_ptr().cast();
            head.msg_hdr.msg_controllen = size_of::<Control>() as _;
        }
        // SAFETY: `heads` has BATCH entries, each with one vector of CANFD_MTU writable bytes and with room for control
        // messages of the stated size; all of it outlives the call, and nothing else touches it meanwhile.
        let taken =
            check(unsafe { libc::recvmmsg(socket, heads.as_mut_ptr(), BATCH as _, MSG_DONTWAIT as _, null_mut()) })?;
        let taken = taken as usize;
        for (slot, head) in self.0.iter_mut().zip(&heads).take(taken) {
            slot.size = (head.msg_len as usize).min(CANFD_MTU);
            slot.noted = (head.msg_hdr.msg_controllen as usize).min(size_of::<Control>());
            slot.flags = head.msg_hdr.msg_flags;
        }
        Ok(self.0.iter().take(taken).map(|slot| Datagram {
            bytes: &slot.bytes[..slot.size],
            control: &slot.control.0[..slot.noted],
            flags: slot.flags,
        }))
    }
}

/// Ends a wait from another thread; holds until it is cleared.
pub struct Wakeup(OwnedFd);

impl Wakeup {
    /// # Errors
    /// No descriptor left.
    pub fn new() -> Result<Wakeup, Errno> {
        // SAFETY: takes numbers only.
        let wakeup = check(unsafe { libc::eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK) })?;
        // SAFETY: the descriptor is new, and nobody else has it.
        Ok(Wakeup(unsafe { OwnedFd::from_raw_fd(wakeup) }))
    }

    pub fn raise(&self) {
        let once = 1_u64;
        // SAFETY: writes the eight bytes of a number. It fails only after 2^64 times, and is raised then.
        unsafe { libc::write(self.0.as_raw_fd(), (&raw const once).cast(), size_of_val(&once)) };
    }

    pub fn clear(&self) {
        let mut times = 0_u64;
        // SAFETY: reads eight bytes into a number. It fails if it is not raised, which is what is wanted.
        unsafe { libc::read(self.0.as_raw_fd(), (&raw mut times).cast(), size_of_val(&times)) };
    }
}

/// What a wait ended with; nothing of it when the time was over.
#[derive(Clone, Copy, Debug, Default)]
pub struct Ready {
    /// Datagrams or an error.
    pub socket: bool,
    /// Nothing more will come.
    pub hung_up: bool,
    pub wakeup: bool,
}

/// Waits for a socket, or only for the wakeup.
///
/// # Errors
/// `EINTR` after a signal.
pub fn wait(socket: Option<RawFd>, wakeup: &Wakeup, milliseconds: c_int) -> Result<Ready, Errno> {
    let entry = |fd| pollfd {
        fd,
        events: libc::POLLIN,
        revents: 0,
    };
    let mut waiting = [entry(wakeup.0.as_raw_fd()), entry(socket.unwrap_or(-1))];
    // SAFETY: `waiting` has as many entries as stated; the kernel writes their `revents` and passes over a negative one.
    check(unsafe { libc::poll(waiting.as_mut_ptr(), waiting.len() as nfds_t, milliseconds) })?;
    let [wakeup, socket] = waiting.map(|entry| entry.revents);
    Ok(Ready {
        socket: socket != 0,
        hung_up: socket & libc::POLLHUP != 0,
        wakeup: wakeup != 0,
    })
}

/// Sets an option of `SOL_SOCKET`.
///
/// # Errors
/// It is not known, not allowed, or this is no socket.
pub fn set_option(socket: RawFd, name: c_int, value: c_int) -> Result<(), Errno> {
    let size = size_of_val(&value) as socklen_t;
    // SAFETY: the kernel reads `size` bytes of `value`, which has as many.
    check(unsafe { libc::setsockopt(socket, SOL_SOCKET, name, (&raw const value).cast(), size) })?;
    Ok(())
}

/// An option of `SOL_SOCKET` that has up to `N` numbers; those that the kernel does not know are 0.
///
/// # Errors
/// It is not known, or this is no socket.
pub fn option<const N: usize>(socket: RawFd, name: c_int) -> Result<[u32; N], Errno> {
    let mut values = [0; N];
    let mut size = size_of_val(&values) as socklen_t;
    // SAFETY: the kernel writes at most `size` bytes, which is what `values` has.
    check(unsafe { libc::getsockopt(socket, SOL_SOCKET, name, values.as_mut_ptr().cast(), &raw mut size) })?;
    Ok(values)
}

fn check(result: c_int) -> Result<c_int, Errno> {
    if result < 0 {
        Err(io::Error::last_os_error().raw_os_error().unwrap_or_default())
    } else {
        Ok(result)
    }
}
