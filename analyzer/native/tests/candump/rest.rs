//! Lines that are not frames: error frames, drop counts, comments, and what cannot be read.

use _native::candump::MAX_LINE;
use _native::counts::Counts;
use _native::events::EventKind;
use _native::frames::{RX, TX};

use crate::{parse, parse_line, reason, texts};

#[test]
fn error_frames() {
    for (line, class, counters, words) in [
        (
            "(1.5) can0 20000004#0000000000000000",
            4,
            None,
            "controller; data 00 00 00 00 00 00 00 00",
        ),
        (
            "(1.5)  can0  20000204   [8]  00 08 00 00 00 00 60 07   ERRORFRAME",
            0x204,
            Some((0x60, 7)),
            "controller (transmit warning), counters (transmit 96, receive 7); data 00 08 00 00 00 00 60 07",
        ),
        (
            "(1.5) can0 20000088#0000041900000000 R",
            0x88,
            None,
            "protocol (stuff), bus error; data 00 00 04 19 00 00 00 00",
        ),
        (
            "(1.5)  can0  20000200   [2]  01 02",
            0x200,
            None,
            "counters; data 01 02",
        ),
        ("(1.5) can0 A0000040#", 0x40, None, "bus off"),
        ("(1.5) can0 20000040# T", 0x40, None, "bus off"),
    ] {
        let (candump, frames, events) = parse_line(line.as_bytes());
        assert_eq!(
            (candump.counts().error_frames, frames.len()),
            (1, 0),
            "{line}: {:?}",
            texts(&events)
        );
        assert_eq!(
            (events.kind[0], events.class[0], events.t[0]),
            (EventKind::ErrorFrame as u8, class, 1_500_000_000)
        );
        assert_eq!((events.bus[0], events.bus_valid[0], events.line[0]), (0, 1, 1));
        let way = match line.rsplit(' ').next() {
            Some("T") => TX,
            Some("R") => RX,
            _ => 0,
        };
        assert_eq!(events.flags[0], way, "{line}");
        let found = (events.errors_valid[0] == 1).then(|| (events.tx_errors[0], events.rx_errors[0]));
        assert_eq!((found, texts(&events)[0]), (counters, words), "{line}");
    }
    let explained = b"  can0  20000088   [8]  00 00 04 00 00 00 00 00   ERRORFRAME\n\tprotocol-violation{{bit-stuffing-error}{}}\n\tbus-error\n  can0  123   [0]\n\tbus-error\n";
    let (candump, _, events) = parse(explained);
    assert_eq!(
        (
            candump.counts().comments,
            candump.counts().frames,
            candump.counts().unreadable
        ),
        (2, 1, 1)
    );
    assert_eq!(
        texts(&events)[1..],
        [
            "protocol-violation{{bit-stuffing-error}{}}",
            "bus-error",
            "no identifier: \\x09bus-error"
        ]
    );
}

#[test]
fn drop_counts_comments_and_blank_lines() {
    let text = b"# made by hand\n\n  ; too\n \t\r\nDROPCOUNT: dropped 5 CAN frames on 'can0,123:7FF' socket (total drops 12)\n\
        DROPCOUNT: dropped 1 CAN frame on 'any' socket (total drops 13)\n# \x1b]0;title\x07\n";
    let (candump, _, events) = parse(text);
    let expected = Counts {
        lines: 7,
        drops: 2,
        comments: 3,
        blank: 2,
        dropped: 6,
        ..Counts::default()
    };
    assert_eq!(
        (candump.counts(), candump.buses()),
        (expected, &["can0".to_owned()][..])
    );
    assert_eq!(events.line, [1, 3, 5, 6, 7]);
    assert_eq!(
        (events.class.as_slice(), events.bus_valid.as_slice()),
        (&[0, 0, 5, 1, 0][..], &[0, 0, 1, 0, 0][..])
    );
    assert_eq!(texts(&events)[0], "# made by hand");
    assert_eq!(texts(&events)[4], "# \\x1b]0;title\\x07");
    assert_eq!(reason(b"DROPCOUNT: dropped 5"), "drop count not understood");
    let long = [b"#".as_slice(), &[b'x'; 500]].concat();
    assert_eq!(texts(&parse_line(&long).2)[0].len(), 200);
}

#[test]
fn nine_classic_bytes_are_kept_for_the_reassembly_to_judge() {
    for line in [
        "(1.0) can0 123#112233445566778899",
        "  can0  123   [9]  11 22 33 44 55 66 77 88 99",
    ] {
        let (_, rows, ..) = parse_line(line.as_bytes());
        assert_eq!(
            rows.data,
            [0x11, 0x22, 0x33, 0x44, 0x55, 0x66, 0x77, 0x88, 0x99],
            "{line}"
        );
        assert_eq!(rows.flags, [0], "{line}");
    }
}

#[test]
fn what_cannot_be_read_says_why() {
    for (line, why) in [
        ("(1.0) can0 123#123", "odd number of hex digits"),
        ("(1.0) can0 123#11.", "no byte after a dot"),
        ("(1.0) can0 123#1G", "not a hex digit in the data"),
        ("(1.0) can0 800#11", "standard identifier above 7FF"),
        ("(1.0) can0 40000123#11", "identifier above 1FFFFFFF"),
        ("(1.0) can0 123456789#11", "identifier longer than 8 digits"),
        ("(1.0) can0 #11", "no identifier"),
        ("(1.0) can0", "no identifier"),
        ("  can0  ERROR", "no identifier"),
        ("(1.0) 123#11", "no interface name"),
        ("(1.0)", "no interface name"),
        ("(1.0 can0 123#11", "time stamp without a closing bracket"),
        ("(x.0) can0 123#11", "time stamp is not a number"),
        ("(9223372037.0) can0 123#11", "time stamp out of range"),
        ("(1.0) can0 123#11 X", "unknown text after the frame"),
        ("(1.0) can0 123#11 R R", "unknown text after the frame"),
        ("  can0  123   [8]  01 02 03 04 05", "says 8 bytes, has 5"),
        ("  can0  123   [8]  01 02 03 0", "says 8 bytes, has 3"),
        ("  can0  123   [2]  01 02 03", "says 2 bytes, has 3"),
        ("  can0  123   [3]  01 02   '12'", "says 3 bytes, has 2"),
        ("  can0  123  [65]  01", "data longer than 64 bytes"),
        ("  can0  123 [0008]  01", "CAN XL frame"),
        ("  can0  123  [0x]  01", "no length in brackets"),
        ("  can0  123", "no length in brackets"),
        ("  can0  123   [1]  01  what", "unknown text after the data"),
        ("  can0  123  [08]  remote request", "remote request on a CAN FD frame"),
        ("  can0  TX B  077  [01]  05", "columns of -x not understood"),
    ] {
        assert_eq!(reason(line.as_bytes()), why, "{line}");
    }
    assert_eq!(
        reason(&[b'x'; 65].map(|b| b)),
        "no identifier".replace("no identifier", "interface name longer than 64 bytes")
    );
    let (_, _, events) = parse_line(&[b"\0\xFFcan0\x1b[2J".as_slice(), &[b'z'; 200]].concat());
    let text = texts(&events)[0];
    assert!(
        text.starts_with("interface name longer than 64 bytes: \\x00\\xffcan0\\x1b[2Jzz") && text.ends_with("zz...")
    );
    assert_eq!(text.split_once(": ").unwrap().1.len(), 80);
}

#[test]
fn a_line_that_never_ends_is_counted_once() {
    for length in [MAX_LINE, MAX_LINE + 1, 5 * MAX_LINE] {
        let mut text = b"# ".to_vec();
        text.resize(length, b'x');
        for end in ["", "\n", "\n(1.0) can0 123#\n"] {
            let expected = if length > MAX_LINE || end.is_empty() {
                EventKind::Unreadable
            } else {
                EventKind::Comment
            };
            let (candump, frames, events) = parse(&[&text, end.as_bytes()].concat());
            assert_eq!(events.kind, [expected as u8], "{length}");
            assert_eq!(
                (candump.counts().lines, frames.len()),
                if end.len() > 1 { (2, 1) } else { (1, 0) }
            );
        }
    }
    let text = [b"\x1b[1m".as_slice(), &vec![b'x'; MAX_LINE]].concat();
    assert_eq!(reason(&text), "line longer than 65536 bytes");
    let excerpt = format!("line longer than 65536 bytes: {}...", "x".repeat(77));
    assert_eq!(texts(&parse(&vec![b'x'; MAX_LINE + 1]).2), [excerpt]);
}

#[test]
fn a_last_line_without_its_end_is_cut_wherever_that_is() {
    for line in [
        "(1.0) can0 1F040A05#112233 R",
        "  can0  1F040A05   [3]  11 22 33   '.\"3'",
        "# a comment",
        "DROPCOUNT: dropped 5 CAN frames on 'can0' socket (total drops 12)",
        " \r",
    ] {
        for end in 1..=line.len() {
            let text = [b"(1.0) can0 123#\n", &line.as_bytes()[..end]].concat();
            let (candump, frames, events) = parse(&text);
            let expected = Counts {
                lines: 2,
                frames: 1,
                unreadable: 1,
                ..Counts::default()
            };
            assert_eq!((candump.counts(), frames.len()), (expected, 1));
            assert_eq!((events.line[0], events.bus_valid[0]), (2, 0));
            let text = texts(&events)[0];
            assert!(
                text.starts_with("the capture ends in the middle of this line: "),
                "{text}"
            );
        }
    }
}
