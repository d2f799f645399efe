//! Comments on packets of pcapng: whole texts of a bounded length, of frames and of error frames.

use _native::events::EventKind;

use crate::pcapng::{interface, option, packet, section};
use crate::{can, read, Ends};

const L: Ends = Ends::Little;

#[test]
fn comments_on_frames_and_error_frames_are_whole_texts_of_a_bounded_length() {
    let said = |texts: &[&[u8]]| {
        let options = texts.iter().map(|text| option(L, 1, text));
        [options.collect::<Vec<_>>().concat(), vec![0; 4]].concat()
    };
    let long = "ü".repeat(4000);
    let bytes = [
        section(L),
        interface(L, 227, &[]),
        packet(L, 0, 1, &can(1, &[1]), &said(&["schön".as_bytes(), b"", b"two"])),
        packet(L, 0, 2, &can(0x2000_0004, &[0; 8]), &said(&[b"error"])),
        packet(L, 0, 3, &can(2, &[1]), &said(&[long.as_bytes()])),
        packet(L, 0, 4, &can(3, &[1]), &said(&[b"\xff\x1b[31m"])),
        packet(L, 0, 5, &can(4, &[1]), &said(&[b""])),
    ];
    let all = read("pcapng", &bytes.concat());
    let events = &all.0.events;
    let comments: Vec<_> = (0..events.len())
        .filter(|&row| events.kind[row] == EventKind::FrameComment as u8)
        .map(|row| (events.line[row], events.text_of(row)))
        .collect();
    assert_eq!(comments.len(), 4);
    assert_eq!(comments[0], (3, "schön\ntwo".to_owned()));
    assert_eq!(comments[1], (4, "error".to_owned()));
    assert_eq!(comments[2].1, "ü".repeat(2048));
    assert_eq!(comments[3].1, "\u{fffd}\x1b[31m");
    assert_eq!(
        (all.0.counts.lines, all.0.counts.frames, all.0.counts.error_frames),
        (7, 4, 1)
    );
}
