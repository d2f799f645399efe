//! The candump reader: its dialects line by line, and the laws that hold for any text.

// Texts are built once; plain `format!` reads best.
#![allow(clippy::format_collect, clippy::format_push_string)]

mod forms;
mod laws;
mod rest;
mod times;

use _native::candump::Candump;
use _native::counts::Counts;
use _native::events::{EventKind, Events};
use _native::frames::Frames;

pub(crate) type Parsed = (Candump, Frames, Events);

pub(crate) fn parse(text: &[u8]) -> Parsed {
    let (mut candump, mut frames, mut events) = (Candump::new(), Frames::default(), Events::default());
    candump.feed(text, &mut frames, &mut events);
    candump.finish(&mut frames, &mut events);
    let Counts {
        lines,
        frames: rows,
        error_frames,
        drops,
        comments,
        blank,
        unreadable,
        ..
    } = candump.counts();
    assert_eq!(
        lines,
        rows + error_frames + drops + comments + blank + unreadable,
        "every line is one thing"
    );
    assert_eq!(
        (rows, error_frames + drops + comments + unreadable),
        (frames.len() as u64, events.len() as u64)
    );
    (candump, frames, events)
}

/// A line with its end.
pub(crate) fn parse_line(line: &[u8]) -> Parsed {
    parse(&[line, b"\n"].concat())
}

pub(crate) fn texts(events: &Events) -> Vec<&str> {
    let ends = events.text_end.iter().map(|&end| end as usize);
    let starts = std::iter::once(0).chain(ends.clone());
    starts
        .zip(ends)
        .map(|(start, end)| std::str::from_utf8(&events.text[start..end]).unwrap())
        .collect()
}

/// The only row of a line: time, interface, identifier, flags, data.
pub(crate) fn frame(line: &str) -> (i64, String, u32, u16, Vec<u8>) {
    let (candump, frames, events) = parse_line(line.as_bytes());
    assert_eq!((frames.len(), events.len()), (1, 0), "{line:?}: {:?}", texts(&events));
    assert_eq!(frames.line, [1]);
    (
        frames.t[0],
        candump.buses()[0].clone(),
        frames.id[0],
        frames.flags[0],
        frames.data_of(0).to_vec(),
    )
}

pub(crate) fn expect(line: &str, t: i64, bus: &str, id: u32, flags: u16, data: &[u8]) {
    assert_eq!(frame(line), (t, bus.to_owned(), id, flags, data.to_vec()), "{line:?}");
}

pub(crate) fn reason(line: &[u8]) -> String {
    let (candump, frames, events) = parse_line(line);
    assert_eq!(
        (frames.len(), events.kind.as_slice()),
        (0, &[EventKind::Unreadable as u8][..]),
        "{line:?}"
    );
    assert!(candump.buses().is_empty(), "an unreadable line makes no interface");
    let text = texts(&events)[0].to_owned();
    text.split(": ").next().unwrap().to_owned()
}
