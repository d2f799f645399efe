//! The core: bytes to frames, frames to transfers, payloads to columns.
//!
//! Read in the order in which the data flows: [`candump`] (with [`line`], [`stamp`], [`simd`]) ->
//! [`frames`], [`events`] -> [`wire`] -> [`slot`] -> [`session`], [`ending`] -> [`trust`] ->
//! [`reassembly`] -> [`transfers`] -> [`pipeline`]; [`plan`], [`bits`], [`unpack`] -> [`packets`]. None of them knows Python or does
//! I/O; `python` is the only file that knows Python, `simd` the only one with `unsafe`.

pub mod bits;
pub mod candump;
pub mod ending;
pub mod events;
pub mod frames;
pub mod line;
pub mod packets;
pub mod pipeline;
pub mod plan;
pub mod reassembly;
pub mod session;
pub mod sessions;
pub mod simd;
pub mod slot;
pub mod stamp;
pub mod transfers;
pub mod trust;
pub mod unpack;
pub mod verdict;
pub mod wire;

#[cfg(feature = "python")]
mod python;
