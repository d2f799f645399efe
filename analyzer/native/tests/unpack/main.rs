//! Payload unpacking: cases computed by hand, and an oracle that reads bit by bit.
#![forbid(unsafe_code)]

mod cases;
mod float16;
mod laws;
mod lists;
mod oracle;
mod plans;
mod random;
mod table;
