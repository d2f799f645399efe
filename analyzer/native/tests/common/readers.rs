//! The readers of binary formats, and the laws that hold for whatever they are given.

use _native::dataflash::Dataflash;
use _native::dronecan_log::DronecanLog;
use _native::events::EventKind;
use _native::frame_batch::FrameBatch;
use _native::frames::{DLC_SHIFT, ERROR, EXTENDED};
use _native::pcap::Pcap;
use _native::pcapng::Pcapng;
use _native::reader::{Damage, Reader, Rows};

pub const FORMS: [&str; 4] = ["pcap", "pcapng", "dataflash", "dronecan"];

/// All rows of an input, and what ended the reading early.
pub type All = (FrameBatch, Option<Damage>);

pub fn reader(form: &str) -> Box<dyn Reader> {
    match form {
        "pcap" => Box::new(Pcap::default()),
        "pcapng" => Box::new(Pcapng::default()),
        "dataflash" => Box::new(Dataflash::default()),
        _ => Box::new(DronecanLog::default()),
    }
}

/// Reads bytes in chunks of these sizes, over and over, and hands rows over behind each chunk.
pub fn read_cut(form: &str, bytes: &[u8], sizes: &[usize]) -> All {
    let (mut reader, mut rows, mut all) = (reader(form), Rows::default(), FrameBatch::default());
    let (mut rest, mut sizes) = (bytes, sizes.iter().cycle());
    while !rest.is_empty() {
        let size = sizes.next().map_or(rest.len(), |size| (*size).clamp(1, rest.len()));
        let (chunk, behind) = rest.split_at(size);
        reader.feed(chunk, &mut rows);
        add(&mut all, &rows.take());
        rest = behind;
    }
    reader.finish(&mut rows);
    add(&mut all, &rows.take());
    (all, reader.damage().cloned())
}

fn add(all: &mut FrameBatch, batch: &FrameBatch) {
    all.frames.extend(&batch.frames);
    all.events.extend(&batch.events, 0..batch.events.len());
    all.counts.add(&batch.counts);
    all.stamps.insert(batch.stamps);
    all.buses = batch.buses.clone();
}

/// Reads bytes as a whole and checks that every record is accounted for and every row can be.
pub fn read(form: &str, bytes: &[u8]) -> All {
    let (all, damage) = read_cut(form, bytes, &[]);
    let (frames, events, counts) = (&all.frames, &all.events, &all.counts);
    let of_events = counts.error_frames + counts.drops + counts.comments + counts.unreadable;
    assert_eq!(counts.lines, counts.frames + of_events + counts.other);
    let (comments, own): (Vec<_>, Vec<_>) =
        (0..events.len()).partition(|&row| events.kind[row] == EventKind::FrameComment as u8);
    let lines_of = |rows: &[usize]| rows.iter().map(|&row| events.line[row]).collect::<Vec<_>>();
    assert_eq!((counts.frames, of_events), (frames.len() as u64, own.len() as u64));
    let mut lines = [&frames.line[..], &lines_of(&own)].concat();
    for rows in [&frames.line, &lines_of(&own), &lines_of(&comments)] {
        assert!(rows.windows(2).all(|two| two[0] < two[1]), "record numbers ascend");
    }
    lines.sort_unstable();
    assert!(lines.windows(2).all(|two| two[0] < two[1]), "one row a record");
    for line in lines_of(&comments) {
        let at = own.iter().find(|&&row| events.line[row] == line);
        let of_error = at.is_some_and(|&row| events.kind[row] == EventKind::ErrorFrame as u8);
        assert!(
            of_error || frames.line.binary_search(&line).is_ok(),
            "on a frame of its record"
        );
    }
    assert!(lines.iter().all(|line| (1..=counts.lines).contains(&u64::from(*line))));
    let buses = all.buses.names().len();
    assert!(frames.bus.iter().all(|bus| usize::from(*bus) < buses));
    for row in 0..frames.len() {
        let (id, flags, data) = (frames.id[row], frames.flags[row], frames.data_of(row));
        assert!(id <= if flags & EXTENDED != 0 { 0x1FFF_FFFF } else { 0x7FF });
        assert!(flags & ERROR == 0 && flags >> DLC_SHIFT <= 15 && data.len() <= 64);
    }
    for row in own {
        assert!(events
            .text_of(row)
            .bytes()
            .all(|byte| byte == b' ' || byte.is_ascii_graphic()));
    }
    assert!(std::str::from_utf8(&events.text).is_ok());
    assert!(damage.as_ref().is_none_or(|damage| damage.at < bytes.len() as u64));
    (all, damage)
}

/// Checks that another way to cut the input gives the same.
pub fn check(form: &str, bytes: &[u8], sizes: &[usize]) -> All {
    let (whole, cut) = (read(form, bytes), read_cut(form, bytes, sizes));
    let parts = |(batch, damage): &All| {
        let FrameBatch {
            frames,
            events,
            counts,
            stamps,
            buses,
        } = batch.clone();
        (frames, events, counts, stamps, buses, damage.clone())
    };
    assert_eq!(parts(&whole), parts(&cut), "{form} in chunks of {sizes:?}");
    whole
}
