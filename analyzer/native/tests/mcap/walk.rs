//! Records, channels and counts.

use _native::frames::{NO_TIME, RX, TX};
use _native::mcap::{Kind, Layout, Role, Stop, Walk, Wire, MAX_WAITING};
use _native::stamp::Stamps;

use crate::common::messages::record;
use crate::common::rows;

fn id_only() -> Layout {
    Layout::json(vec![
        (Role::Id, vec!["id".to_owned()]),
        (Role::Bus, vec!["bus".to_owned()]),
    ])
    .unwrap()
}

fn walk(data: &[u8]) -> (usize, Stop) {
    let mut walk = Walk::default();
    walk.channel(1, "x", id_only());
    let stop = walk.walk(data, 0, usize::MAX);
    rows(&mut walk);
    stop
}

#[test]
fn a_walk_stops_in_front_of_what_it_cannot_take() {
    let good = record(1, 5, b"{\"id\":1}");
    let end = good.len();
    assert_eq!(walk(&[]), (0, Stop::End));
    assert_eq!(walk(&good), (end, Stop::End));
    assert_eq!(walk(&[&good[..], &[7]].concat()), (end, Stop::Opcode));
    assert_eq!(walk(&[&[0][..], &good].concat()), (0, Stop::Opcode));
    for cut in 1..end {
        assert_eq!(walk(&good[..cut]), (0, Stop::Incomplete), "{cut}");
        assert_eq!(
            walk(&[&good[..], &good[..cut]].concat()),
            (end, Stop::Incomplete),
            "{cut}"
        );
    }
    for length in [0, 21, 1 << 33, u64::MAX] {
        let mut broken = good.clone();
        broken[1..9].copy_from_slice(&length.to_le_bytes());
        assert_eq!(walk(&[good.clone(), broken].concat()), (end, Stop::Broken), "{length}");
    }
    let mut empty = good.clone();
    empty[1..9].copy_from_slice(&22_u64.to_le_bytes());
    assert_eq!(walk(&empty[..31]), (31, Stop::End));
    let mut long = good.clone();
    long[1..9].copy_from_slice(&(1_u64 << 32).to_le_bytes());
    assert_eq!(walk(&long), (0, Stop::Incomplete));
    let mut from = Walk::default();
    assert_eq!(from.walk(&good, end, usize::MAX), (end, Stop::End));
    assert_eq!(from.walk(&good, usize::MAX, usize::MAX), (end, Stop::End));
}

#[test]
fn a_walk_pauses_when_enough_rows_wait() {
    let good = record(1, 5, b"{\"id\":1}");
    let data = [good.clone(), record(2, 5, b""), record(1, 5, b"{"), good.clone()].concat();
    let mut walk = Walk::default();
    walk.channel(1, "x", id_only());
    assert_eq!(walk.walk(&data, 0, 0), (0, Stop::Full));
    let (at, stop) = walk.walk(&data, 0, 2);
    assert_eq!((at, stop), (data.len() - good.len(), Stop::Full));
    assert_eq!(rows(&mut walk).0.len(), 2);
    assert_eq!(walk.walk(&data, at, 2), (data.len(), Stop::End));
    assert_eq!(rows(&mut walk).0[0].0, 4, "record numbers go on");
    assert!(MAX_WAITING * 500 < i32::MAX as usize, "offsets of columns fit");
}

#[test]
fn every_record_is_counted_once() {
    let mut walk = Walk::default();
    walk.channel(1, "one", id_only());
    walk.channel(u16::MAX, "last", id_only());
    let data = [
        record(0, 1, b"{\"id\":1}"),
        record(1, 2, b"{\"id\":2}"),
        record(1, 3, b"{\"id\":536870913}"),
        record(1, 4, b"{\"id\":"),
        record(u16::MAX, 5, b"{\"id\":5}"),
        record(2, 6, b""),
        record(1, u64::MAX, b"{\"id\":7}"),
    ];
    assert_eq!(walk.walk(&data.concat(), 0, usize::MAX).1, Stop::End);
    walk.rows.other(10);
    let (rows, batch) = rows(&mut walk);
    let lines: Vec<u32> = rows.iter().map(|(line, _)| *line).collect();
    assert_eq!(lines, [2, 3, 4, 5, 7]);
    let counts = batch.counts;
    assert_eq!((counts.lines, counts.frames, counts.error_frames), (17, 2, 1));
    assert_eq!((counts.unreadable, counts.other), (2, 12));
    assert_eq!(rows[2].1, Err("message 3 of channel 1: JSON ends early".to_owned()));
    assert_eq!(
        rows[4].1,
        Err("message 4 of channel 1: time stamp out of range".to_owned())
    );
    assert_eq!((walk.log_times, walk.header_times), (3, 0));
    assert_eq!(batch.buses.names(), ["one", "last"]);
    assert_eq!(
        batch.stamps.bits(),
        Stamps::ABSOLUTE.bits() | Stamps::NANOSECONDS.bits()
    );
}

#[test]
fn times_of_the_message_and_of_the_recorder_are_told_apart() {
    let mut walk = Walk::default();
    let stamp = (Role::StampNs, vec!["t".to_owned()]);
    walk.channel(
        1,
        "x",
        Layout::json(vec![(Role::Id, vec!["id".to_owned()]), stamp]).unwrap(),
    );
    let data = [
        record(1, 9, b"{\"id\":1,\"t\":3}"),
        record(1, 9, b"{\"id\":1}"),
        record(1, 9, b"{\"id\":536870913,\"t\":4}"),
    ];
    walk.walk(&data.concat(), 0, usize::MAX);
    let (rows, _) = rows(&mut walk);
    let times: Vec<i64> = rows.into_iter().map(|(_, row)| row.unwrap().t).collect();
    assert_eq!(times, [3, 9, 4]);
    assert_eq!((walk.log_times, walk.header_times), (1, 2));
}

#[test]
fn nothing_is_a_time_in_a_channel_without_times() {
    let mut walk = Walk::default();
    let fields = [
        (Role::Id, "id"),
        (Role::StampNs, "t"),
        (Role::Error, "bad"),
        (Role::Sent, "tx"),
    ];
    let fields = fields.map(|(role, name)| (role, vec![name.to_owned()]));
    walk.channel(1, "x", Layout::json(fields.to_vec()).unwrap());
    walk.mark(1, RX);
    walk.untimed(1);
    let data = [
        record(1, 9, b"{\"id\":1,\"t\":3}"),
        record(1, u64::MAX, b"{\"id\":1}"),
        record(1, 9, b"{\"id\":4,\"bad\":true,\"tx\":true}"),
        record(1, 9, b"{\"id\":4,\"bad\":true}"),
    ];
    walk.walk(&data.concat(), 0, usize::MAX);
    let batch = walk.take();
    assert_eq!(
        (&batch.frames.t[..], &batch.events.t[..]),
        (&[NO_TIME; 2][..], &[NO_TIME; 2][..])
    );
    assert_eq!((walk.log_times, walk.header_times, walk.absent_times), (0, 0, 4));
    assert_eq!(batch.stamps, Stamps::NONE);
    assert_eq!(batch.events.flags, [TX, RX]);
    walk.channel(1, "x", id_only());
    walk.walk(&record(1, 9, b"{\"id\":1}"), 0, usize::MAX);
    assert_eq!(walk.take().frames.t, [9]);
}

#[test]
fn a_channel_can_be_announced_again() {
    let mut walk = Walk::default();
    let message = record(1, 5, b"{\"id\":1}");
    walk.channel(1, "a", Layout::ros(Wire::Cdr, Kind::CanMsgs));
    walk.walk(&message, 0, usize::MAX);
    walk.channel(1, "b", id_only());
    walk.walk(&message, 0, usize::MAX);
    let broken = record(1, 5, b"");
    walk.walk(&broken, 0, usize::MAX);
    let (rows, batch) = rows(&mut walk);
    assert!(rows[0].1.as_ref().is_err_and(|text| text.starts_with("message 1 of")));
    assert_eq!(rows[1].1.as_ref().map(|sent| sent.name.as_str()), Ok("b"));
    assert!(rows[2].1.as_ref().is_err_and(|text| text.starts_with("message 3 of")));
    assert_eq!(batch.buses.names(), ["b"]);
}

#[test]
fn interfaces_of_one_channel_may_alternate_and_run_out() {
    let mut walk = Walk::default();
    walk.channel(1, "x", id_only());
    let names = |count: usize| {
        (0..count)
            .chain(0..count)
            .map(|bus| format!("{{\"id\":1,\"bus\":\"c{bus}\"}}"))
    };
    let data: Vec<u8> = names(256).flat_map(|text| record(1, 5, text.as_bytes())).collect();
    walk.walk(&data, 0, usize::MAX);
    let (rows, batch) = rows(&mut walk);
    assert_eq!((batch.counts.frames, batch.counts.unreadable), (510, 2));
    for (line, row) in rows {
        let bus = (line as usize - 1) % 256;
        match row {
            Ok(sent) => assert_eq!(sent.name, format!("c{bus}")),
            Err(text) => assert!(bus == 255 && text.ends_with("more than 255 interfaces"), "{text}"),
        }
    }
}

#[test]
fn a_walk_that_asks_stops_in_front_of_unknown_channels() {
    let mut walk = Walk::default();
    walk.asks = true;
    walk.ignore(2);
    let first = record(2, 5, b"");
    let data = [first.clone(), record(9, 5, b"{\"id\":1}"), record(9, 5, b"{\"id\":2}")].concat();
    assert_eq!(walk.walk(&data, 0, usize::MAX), (first.len(), Stop::Unknown));
    walk.channel(9, "x", id_only());
    assert_eq!(walk.walk(&data, first.len(), usize::MAX), (data.len(), Stop::End));
    assert_eq!(walk.last, data.len() - record(9, 5, b"{\"id\":2}").len());
    walk.ignore(9);
    assert_eq!(walk.walk(&data, first.len(), usize::MAX), (data.len(), Stop::End));
    let (rows, batch) = rows(&mut walk);
    assert_eq!((rows.len(), batch.counts.other), (2, 3));
}

#[test]
fn a_channel_may_state_a_direction_and_a_name_for_frames_without() {
    let mut walk = Walk::default();
    let fields = [(Role::Id, "id"), (Role::Bus, "bus"), (Role::Sent, "tx")];
    let fields = fields.map(|(role, name)| (role, vec![name.to_owned()]));
    walk.channel(1, "announced", Layout::json(fields.to_vec()).unwrap());
    walk.mark(1, TX);
    let texts = [
        "{\"id\":1}",
        "{\"id\":1,\"tx\":false,\"bus\":\"can\"}",
        "{\"id\":1,\"bus\":\"can1\"}",
    ];
    let data: Vec<u8> = texts.iter().flat_map(|text| record(1, 5, text.as_bytes())).collect();
    walk.walk(&data, 0, usize::MAX);
    let rows: Vec<_> = rows(&mut walk).0.into_iter().map(|(_, row)| row.unwrap()).collect();
    let [first, second, third] = &rows[..] else {
        panic!("three frames");
    };
    assert_eq!((first.flags, first.name.as_str()), (TX, "announced"));
    assert_eq!((second.flags, second.name.as_str()), (RX, "announced"));
    assert_eq!((third.flags, third.name.as_str()), (TX, "can1"));
}
