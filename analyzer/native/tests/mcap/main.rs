//! The walk over MCAP messages: each layout by hand-made bytes, and the laws that hold for any.

#[path = "../common/mcap.rs"]
mod common;
mod json;
mod laws;
mod protobuf;
mod ros;
mod texts;
mod walk;

use _native::mcap::{Layout, Stop, Walk};

use common::messages::record;
use common::{rows, Sent};

pub(crate) const LOG_TIME: u64 = 1_700_000_000_000_000_042;

/// What becomes of one message on a channel whose interface is announced as `announced`.
pub(crate) fn read(layout: Layout, message: &[u8]) -> Result<Sent, String> {
    let mut walk = Walk::default();
    walk.channel(3, "announced", layout);
    let record = record(3, LOG_TIME, message);
    assert_eq!(walk.walk(&record, 0, usize::MAX), (record.len(), Stop::End));
    let (mut rows, batch) = rows(&mut walk);
    assert_eq!((rows.len(), rows[0].0), (1, 1));
    let times = batch.counts.frames + batch.counts.error_frames;
    assert_eq!(walk.log_times + walk.header_times, times);
    rows.remove(0).1.map_err(|text| {
        assert!(
            batch.buses.names().is_empty(),
            "an unreadable message makes no interface"
        );
        text.strip_prefix("message 1 of channel 3: ")
            .expect("says which")
            .to_owned()
    })
}

pub(crate) fn sent(t: i64, name: &str, id: u32, flags: u16, data: &[u8]) -> Sent {
    Sent {
        t,
        name: name.to_owned(),
        id,
        flags,
        data: data.to_vec(),
    }
}

/// A frame of a message that states neither time nor interface.
pub(crate) fn plain(id: u32, flags: u16, data: &[u8]) -> Sent {
    sent(LOG_TIME as i64, "announced", id, flags, data)
}
