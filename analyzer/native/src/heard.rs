//! When each node, and each type that it sends, was heard: by the identifiers of frames, whatever became of them.
#![forbid(unsafe_code)]

pub mod by_session;
pub mod nodes;
pub mod sessions;
