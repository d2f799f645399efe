//! The readers of binary formats: small captures made by hand, and the laws that hold for any bytes.

mod comments;
mod dataflash;
mod dronecan;
mod interfaces;
mod laws;
mod pcap;
mod pcapng;
#[path = "../common/readers.rs"]
mod readers;

use readers::{read, All};

/// One frame: time, interface, identifier, flags, data.
type Row = (i64, String, u32, u16, Vec<u8>);

fn rows((batch, _): &All) -> Vec<Row> {
    let frames = &batch.frames;
    let row = |row: usize| {
        let bus = batch.buses.names()[usize::from(frames.bus[row])].clone();
        let data = frames.data_of(row).to_vec();
        (frames.t[row], bus, frames.id[row], frames.flags[row], data)
    };
    (0..frames.len()).map(row).collect()
}

fn texts((batch, _): &All) -> Vec<String> {
    let ends = batch.events.text_end.iter().map(|&end| end as usize);
    let starts = std::iter::once(0).chain(ends.clone());
    let text = |(start, end)| String::from_utf8(batch.events.text[start..end].to_vec()).unwrap();
    starts.zip(ends).map(text).collect()
}

/// The reason that ended the reading, behind the byte in front of which it did.
fn ending((_, damage): &All) -> Option<(u64, &str)> {
    damage.as_ref().map(|damage| (damage.at, damage.reason.as_str()))
}

/// Numbers in the byte order of a capture.
#[derive(Clone, Copy, PartialEq)]
enum Ends {
    Little,
    Big,
}

impl Ends {
    fn words(self, words: &[u32]) -> Vec<u8> {
        let bytes = |word: &u32| match self {
            Ends::Little => word.to_le_bytes(),
            Ends::Big => word.to_be_bytes(),
        };
        words.iter().flat_map(bytes).collect()
    }

    fn halves(self, halves: &[u16]) -> Vec<u8> {
        let bytes = |half: &u16| match self {
            Ends::Little => half.to_le_bytes(),
            Ends::Big => half.to_be_bytes(),
        };
        halves.iter().flat_map(bytes).collect()
    }
}

/// A `can_frame` in network order.
fn can(word: u32, data: &[u8]) -> Vec<u8> {
    let head = [data.len() as u8, 0, 0, 0];
    [&word.to_be_bytes()[..], &head, data, &vec![0; 8 - data.len()]].concat()
}

/// A `canfd_frame` in network order, with its flags byte.
fn can_fd(word: u32, flags: u8, data: &[u8]) -> Vec<u8> {
    let head = [data.len() as u8, flags, 0, 0];
    [&word.to_be_bytes()[..], &head, data, &vec![0; 64 - data.len()]].concat()
}
