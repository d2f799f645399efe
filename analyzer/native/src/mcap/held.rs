//! Messages that wait until another one shows how text is coded; everything behind them waits, too.
#![forbid(unsafe_code)]

use super::layout::Read;
use super::{json, protobuf, Channel, Found, Walk, HEADER};

/// Bytes of messages that may wait.
const MAX_HELD: usize = 1 << 24;

/// What waits, in its order.
#[derive(Default)]
pub(super) struct Held {
    list: Vec<Later>,
    bytes: usize,
    /// Channels whose coding is waited for.
    channels: Vec<u16>,
}

enum Later {
    Message(Vec<u8>),
    Unreadable(String),
    Other(u64),
}

impl Held {
    pub fn is_empty(&self) -> bool {
        self.list.is_empty()
    }

    fn add(&mut self, later: Later, bytes: usize) {
        self.list.push(later);
        self.bytes += bytes + size_of::<Later>();
    }
}

impl Walk {
    /// A damaged record that the caller found.
    pub fn unreadable(&mut self, text: &str) {
        if self.held.is_empty() {
            self.rows.unreadable(crate::frames::NO_TIME, None, text);
        } else {
            self.held.add(Later::Unreadable(text.to_owned()), text.len());
            self.release_some();
        }
    }

    /// Sound records that have nothing to do with CAN.
    pub fn other(&mut self, count: u64) {
        if self.held.is_empty() {
            self.rows.other(count);
        } else if let Some(Later::Other(before)) = self.held.list.last_mut() {
            *before += count;
        } else {
            self.held.add(Later::Other(count), 0);
            self.release_some();
        }
    }

    /// The input ends here: what waits is read as assumed.
    pub fn finish(&mut self) {
        for id in std::mem::take(&mut self.held.channels) {
            self.assume(id);
        }
        self.held.bytes = 0;
        for later in std::mem::take(&mut self.held.list) {
            match later {
                Later::Message(record) => self.add(&record),
                Later::Unreadable(text) => self.rows.unreadable(crate::frames::NO_TIME, None, &text),
                Later::Other(count) => self.rows.other(count),
            }
        }
    }

    /// Takes a message of a channel whose text is not understood yet, or one behind a message that waits.
    pub(super) fn wait(&mut self, id: u16, record: &[u8]) {
        let Some(Some(channel)) = self.channels.get_mut(usize::from(id)) else {
            return;
        };
        if channel.is_open() {
            let enough = channel.look(&record[HEADER..], &mut self.found);
            if channel.waits() && !self.held.channels.contains(&id) {
                self.held.channels.push(id);
            }
            if enough {
                self.assume(id);
            }
        }
        if self.held.is_empty() && self.held.channels.is_empty() {
            self.add(record);
        } else {
            self.held.add(Later::Message(record.to_vec()), record.len());
            self.release_some();
        }
    }

    /// Reads everything that waits if nothing is left to wait for, or too much waits.
    fn release_some(&mut self) {
        let channels = &self.channels;
        let waits = |id: &u16| {
            channels[usize::from(*id)]
                .as_ref()
                .is_some_and(|channel| channel.waits())
        };
        self.held.channels.retain(waits);
        if self.held.channels.is_empty() || self.held.bytes > MAX_HELD {
            self.finish();
        }
    }

    fn assume(&mut self, id: u16) {
        if let Some(Some(channel)) = self.channels.get_mut(usize::from(id)) {
            let assumed = channel.assume();
            self.assumed
                .extend(assumed.into_iter().flatten().map(|what| (id, what)));
        }
    }
}

impl Channel {
    /// Whether a message may still show how text is coded.
    pub fn is_open(&self) -> bool {
        self.id.is_open() || self.data.is_open()
    }

    fn waits(&self) -> bool {
        self.id.waits() || self.data.waits()
    }

    /// Looks how the text of a message is coded; whether there were enough messages that did not show it.
    fn look(&mut self, data: &[u8], found: &mut Found) -> bool {
        found.clear();
        let read = match &self.layout.0 {
            Read::Json(fields) => json::read(fields, data, found),
            Read::Protobuf(fields, defaults) => protobuf::read(fields, defaults, data, found),
            Read::Ros(..) | Read::Comments | Read::Drops => return false,
        };
        if read.is_err() {
            return false;
        }
        let (id, data) = found.signs();
        let enough = self.id.see(id);
        self.data.see(data) || enough
    }

    /// Hex for data and decimal numbers for identifiers where messages wait; the fields whose coding was assumed.
    fn assume(&mut self) -> [Option<&'static str>; 2] {
        use super::texts::Coding::{Hex, Other};
        [(&mut self.data, Hex, "data"), (&mut self.id, Other, "id")].map(|(text, coding, what)| {
            let waits = text.waits();
            if waits {
                text.coding = coding;
            }
            waits.then_some(what)
        })
    }
}
