//! A SocketCAN socket, emptied in batches: the one place of the core that asks the kernel for something.
//!
//! [`control`] reads what comes beside a datagram (time, drop counter), [`frame`] the datagram, [`losses`] is the drop
//! counter, [`intake`] makes the rows, [`source`] decides when to ask and what to do with errors; [`system`] holds the
//! system calls, and nothing but these.
#![deny(unsafe_code)] // `forbid` would hold for `system`, too

pub mod control;
pub mod frame;
pub mod intake;
pub mod losses;
pub mod source;
pub mod system;
