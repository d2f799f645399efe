//! A SocketCAN socket, emptied many datagrams at a time: the one place of the core that asks the kernel for something.
//!
//! [`control`] reads what comes beside a datagram (time, drop counter), [`frame`] the datagram, [`losses`] is the drop
//! counter, [`datagrams`] makes the rows, [`socket`] decides when to ask and what to do with errors; [`system`] holds the
//! system calls, and nothing but these.
#![deny(unsafe_code)] // `forbid` would hold for `system`, too

pub mod control;
pub mod datagrams;
pub mod frame;
pub mod losses;
pub mod socket;
pub mod system;
