//! Text that may be coded either way: what follows decides, whatever stands between and however it is cut.

use _native::mcap::{Form, Layout, Role, Stop, Walk};

use crate::common::messages::record;
use crate::common::{rows, Row};

/// Identifier and data, or what is wrong.
type Short = Result<(u32, Vec<u8>), String>;

fn layout() -> Layout {
    let fields = [(Role::IdText, "id"), (Role::DataText, "data"), (Role::Dlc, "dlc")];
    Layout::json(fields.map(|(role, name)| (role, vec![name.to_owned()])).to_vec()).unwrap()
}

fn walk() -> Walk {
    let mut walk = Walk::default();
    walk.channel(1, "x", layout());
    walk.channel(2, "y", layout());
    walk
}

fn message(channel: u16, id: &str, data: &str) -> Vec<u8> {
    record(channel, 5, format!("{{\"id\":{id},\"data\":{data}}}").as_bytes())
}

/// Identifier and data of each row, or what is wrong with it.
fn short(rows: Vec<Row>) -> Vec<Short> {
    rows.into_iter()
        .map(|(_, row)| row.map(|sent| (sent.id, sent.data)))
        .collect()
}

fn read(messages: &[Vec<u8>]) -> (Vec<Short>, Vec<(u16, &'static str)>) {
    let mut walk = walk();
    let data = messages.concat();
    assert_eq!(walk.walk(&data, 0, usize::MAX), (data.len(), Stop::End));
    walk.finish();
    (short(rows(&mut walk).0), walk.assumed)
}

#[test]
fn a_later_message_decides_for_those_before() {
    for (texts, id, data) in [
        (["AAAAAAAA", "AQEBAQEB"], 1, &[0; 6][..]),
        (["AAAAAAAA", "A63500"], 1, &[0xAA; 4]),
        (["", "AQEBAQEB"], 1, &[]),
        (["AAAA", "A6350000"], 1, &[0xAA; 2]),
    ] {
        let messages = texts.map(|text| message(1, "1", &format!("\"{text}\"")));
        let (rows, assumed) = read(&messages);
        assert_eq!(rows[0], Ok((id, data.to_vec())), "{texts:?}");
        assert_eq!(assumed.is_empty(), texts[0] != "AAAA", "{texts:?}");
    }
    for (ids, first, second) in [
        (["18504060", "1850406A"], 0x1850_4060, 0x1850_406A),
        (["18504060", "08504060"], 0x1850_4060, 0x0850_4060),
        (["10", "536870911"], 10, 0x1FFF_FFFF),
        (["10", "11"], 10, 11),
    ] {
        let (rows, assumed) = read(&ids.map(|id| message(1, &format!("\"{id}\""), "[]")));
        assert_eq!(rows, [first, second].map(|id| Ok((id, vec![]))), "{ids:?}");
        let expected: &[(u16, &str)] = if ids[1] == "11" { &[(1, "id")] } else { &[] };
        assert_eq!(assumed, expected, "{ids:?}");
    }
}

#[test]
fn a_coding_holds_for_the_whole_channel() {
    let texts = ["A63500", "AAAAAAAA", "AQEBAQEB"];
    let (rows, _) = read(&texts.map(|text| message(1, "1", &format!("\"{text}\""))));
    assert_eq!(rows[1], Ok((1, vec![0xAA; 4])));
    assert!(rows[2]
        .as_ref()
        .is_err_and(|text| text.ends_with("not a hex digit in the data")));
    let (rows, _) = read(&["\"0A\"", "\"10\"", "\"0x10\"", "16", "\"G\""].map(|id| message(1, id, "\"\"")));
    assert_eq!(rows[..4], [10, 16, 16, 16].map(|id| Ok((id, vec![]))));
    assert!(rows[4].is_err());
}

#[test]
fn strings_of_protobuf_are_text_too() {
    let fields = vec![
        (Role::Id, vec![1], Form::Varint),
        (Role::DataText, vec![2], Form::String),
    ];
    let mut walk = Walk::default();
    walk.channel(1, "x", Layout::protobuf(fields).unwrap());
    for text in [&b"\x08\x05\x12\x04AAAA"[..], b"\x08\x05\x12\x04AQEB"] {
        walk.walk(&record(1, 5, text), 0, usize::MAX);
    }
    assert_eq!(short(rows(&mut walk).0), [Ok((5, vec![0; 3])), Ok((5, vec![1; 3]))]);
}

#[test]
fn a_wait_ends() {
    let either = message(1, "1", "\"AAAA\"");
    let mut walk = walk();
    for _ in 0..63 {
        walk.walk(&either, 0, usize::MAX);
    }
    assert_eq!(walk.rows.waiting(), 0);
    walk.walk(&either, 0, usize::MAX);
    assert_eq!((walk.rows.waiting(), &walk.assumed[..]), (64, &[(1, "data")][..]));
    let mut walk = self::walk();
    walk.walk(&either, 0, usize::MAX);
    let long = message(2, "1", &format!("[],\"x\":\"{}\"", "x".repeat(1 << 20)));
    for _ in 0..16 {
        walk.walk(&long, 0, usize::MAX);
    }
    assert_eq!(walk.rows.waiting(), 17);
    for again in [
        |walk: &mut Walk| walk.channel(1, "x", layout()),
        |walk: &mut Walk| walk.ignore(1),
    ] {
        let mut walk = self::walk();
        walk.walk(&either, 0, usize::MAX);
        walk.channel(3, "z", layout());
        assert_eq!(walk.rows.waiting(), 0, "a new channel changes nothing");
        again(&mut walk);
        assert_eq!(walk.rows.waiting(), 1);
    }
}

#[test]
fn everything_keeps_its_order_however_it_is_cut() {
    let parts = [
        message(1, "1", "\"AAAAAAAA\""),
        message(2, "\"20\"", "\"AAAA\""),
        record(7, 5, b""),
        message(1, "2", "[1]"),
        record(1, 5, b"{"),
        message(1, "3", "\"AQEB\""),
        message(1, "4", "\"AAAA\""),
        message(2, "\"2A\"", "\"AAA=\""),
        message(2, "\"30\"", "\"AAAA\""),
    ];
    let mut walk = walk();
    let mut all = vec![];
    for part in &parts {
        walk.walk(part, 0, usize::MAX);
        walk.unreadable("from outside");
        all.extend(rows(&mut walk).0);
    }
    assert!(walk.assumed.is_empty());
    let lines: Vec<u32> = all.iter().map(|(line, _)| *line).collect();
    assert_eq!(lines, (1..=18).filter(|&line| line != 5).collect::<Vec<_>>());
    let sound: Vec<_> = short(all).into_iter().flatten().collect();
    let expected = [
        (1, vec![0; 6]),
        (0x20, vec![0; 3]),
        (2, vec![1]),
        (3, vec![1; 3]),
        (4, vec![0; 3]),
        (0x2A, vec![0; 2]),
        (0x30, vec![0; 3]),
    ];
    assert_eq!(sound, expected);
}

#[test]
fn a_message_may_be_passed() {
    let mut walk = Walk::default();
    walk.asks = true;
    let one = record(9, 5, b"{}");
    assert_eq!(walk.walk(&one, 0, usize::MAX), (0, Stop::Unknown));
    walk.pass(9);
    assert_eq!(
        walk.walk(&[&one[..], &one].concat(), 0, usize::MAX),
        (one.len(), Stop::Unknown)
    );
    assert_eq!(rows(&mut walk).1.counts.other, 1);
}
