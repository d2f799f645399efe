//! The core: bytes to frames, frames to transfers, payloads to columns.
//!
//! Read in the order in which the data flows: [`candump`] (with [`line`], [`stamp`], [`simd`]) and the other
//! [`reader`]s -> [`frames`], [`events`] -> [`wire`] -> [`slot`] -> [`session`]s and their [`session_code`]s, [`short`], [`accept`], [`ending`] ->
//! [`trust`] -> [`reassembly`] -> [`transfers`] -> [`pipeline`]; [`groups`], [`plan`], [`bits`], [`unpack`] ->
//! [`decoder`], [`packets`]; [`diagnosis`] is what broken transfers lack, [`orphans`] and [`remainders`] what is left
//! of them, [`firsts`] what came first of a session, [`id_nodes`] nodes whose transfer IDs do not count on, [`calls`]
//! which responses belong to which requests, [`joint`] where several senders lack some, [`losses`] counts which
//! transfers did not come, [`heard`] when nodes and their types were heard, [`paces`] where reports at a steady pace
//! break, [`silences`] which frame came last before a time without any, [`alike`] which frames come again, [`load`]
//! how long one takes, [`motor`] how an ESC compares with its own past, [`grouped`] puts rows by key, [`seeded`] is
//! how numbers are hashed, [`runs`] occurrences by what they are of, [`last_runs`] counts those that go on with a
//! finding, [`rows`] writes the text of views, by templates, [`evidence`] frames of findings. None of them knows
//! Python or does I/O, but for `receive`, which empties a socket of Linux; `python` is the only file that knows
//! Python, `simd`, `receive/system` and `python/buffer` are the only ones with `unsafe`.

pub mod accept;
pub mod alike;
pub mod binary;
pub mod bits;
pub mod buses;
pub mod cadence;
pub mod calls;
pub mod candump;
pub mod chain;
pub mod counts;
pub mod dataflash;
pub mod decoder;
pub mod diagnosis;
pub mod dronecan_log;
pub mod ending;
pub mod events;
pub mod evidence;
pub mod firsts;
pub mod frame_batch;
pub mod frames;
pub mod grouped;
pub mod groups;
pub mod heard;
pub mod id_nodes;
pub mod joint;
pub mod last_runs;
pub mod line;
pub mod link;
pub mod load;
pub mod losses;
pub mod mcap;
pub mod merge;
pub mod motor;
pub mod orphans;
pub mod paces;
pub mod packets;
pub mod pcap;
pub mod pcapng;
pub mod pipeline;
pub mod plan;
pub mod proto;
pub mod reader;
pub mod reassembly;
#[cfg(target_os = "linux")]
pub mod receive;
pub mod remainders;
pub mod rows;
pub mod runs;
pub mod seeded;
pub mod session;
pub mod session_code;
pub mod sessions;
pub mod short;
pub mod silences;
pub mod simd;
pub mod slot;
pub mod socketcan;
pub mod stamp;
pub mod transfers;
pub mod trust;
pub mod unpack;
pub mod verdict;
pub mod wire;
pub mod write;

#[cfg(feature = "python")]
mod python;
