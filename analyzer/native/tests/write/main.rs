//! Whatever legible lines say is written so that it reads the same again: valid lines, and valid lines damaged.

use std::collections::HashMap;

use _native::candump::Candump;
use _native::frame_batch::FrameBatch;
use _native::frames::{ERROR, FD, NO_TIME, RX, TX};
use _native::mcap::{Kind, Layout, Stop, Walk, Wire};
use _native::pcapng::Pcapng;
use _native::reader::{Reader, Rows};
use _native::stamp::Stamps;
use _native::write::mcap::{Content, Messages};
use _native::write::recorded::Recorded;
use _native::write::{candump, pcapng, Writer};

const LINES: [&str; 21] = [
    "(1700000000.000180) can0 05040601#A63500000000009C R",
    "(1700000000.000000181) vcan-1 123#1122 T",
    "can0 7FF#",
    "(0000000001.5) can0 123##1112233",
    "(1700000000.000200) can0 12345678##3",
    "(1700000000.000200) can0 123#R",
    "(1700000000.000200) can0 123#R8_F T",
    "(1700000000.000200) can0 123#1122334455667788_B",
    "(1700000000.000200) can1 20000004#000C000000006087",
    "(1700000000.000210) can1 20000004#0100000000000000 T",
    "can1 20000080#00 R",
    "  can0  TX - -  20000002   [1]  0B   ERRORFRAME",
    "DROPCOUNT: dropped 5 CAN frames on 'can0' socket (total drops 12)",
    "# a comment",
    "; (1700000000.000200001) a comment with a time",
    "DROPCOUNT: dropped 7 CAN frames on 'can1' socket (total drops 19) (1700000000.000200)",
    "(1700000000.000200) can0 123#112233445566778899AA",
    "(000.000000)  can0  05040601   [8]  A6 35 00 00 00 00 00 9C",
    "(2020-12-19 12:04:45.485261)  can0  20000088   [8]  00 00 04 19 00 00 07 07   ERRORFRAME",
    "",
    "can0  123  [3] remote request",
];

struct Random(u64);

impl Random {
    fn below(&mut self, limit: usize) -> usize {
        self.0 = self
            .0
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 33) as usize % limit
    }

    /// Some of the lines; `damage` bytes of them are something else.
    fn log(&mut self, damage: usize) -> Vec<u8> {
        let lines = (0..self.below(20)).map(|_| LINES[self.below(LINES.len())].to_owned() + "\n");
        let mut log = lines.collect::<String>().into_bytes();
        for _ in 0..damage.min(log.len()) {
            let at = self.below(log.len());
            log[at] = [b'0', b'9', b'F', b' ', b'#', b'(', b'_', b'R', b'\n', b'\'', 0x1B, 0xFF][self.below(12)];
        }
        log
    }
}

fn read(mut reader: impl Reader, bytes: &[u8]) -> FrameBatch {
    let mut rows = Rows::default();
    reader.feed(bytes, &mut rows);
    reader.finish(&mut rows);
    assert_eq!(reader.damage(), None);
    rows.take()
}

fn write(mut writer: impl Writer, batch: &FrameBatch) -> Vec<u8> {
    let mut out = vec![];
    writer.start(&mut out);
    writer.write(batch, &HashMap::new(), &mut out);
    out
}

/// Frames and error frames in the order of their records, with names: time, name, identifier, flags, data.
fn frames(batch: &FrameBatch) -> Vec<(i64, String, u32, u16, Vec<u8>)> {
    let name = |bus: u8| batch.buses.names()[usize::from(bus)].clone();
    let (frames, events) = (&batch.frames, &batch.events);
    let mut all: Vec<_> = (0..frames.len())
        .map(|row| {
            let what = (frames.id[row], frames.flags[row], frames.data_of(row).to_vec());
            (frames.line[row], frames.t[row], name(frames.bus[row]), what)
        })
        .collect();
    all.extend((0..events.len()).filter(|&row| events.kind[row] == 0).map(|row| {
        let what = (
            events.class[row],
            ERROR | events.flags[row],
            events.data_of(row).to_vec(),
        );
        (events.line[row], events.t[row], name(events.bus[row]), what)
    }));
    all.sort();
    all.into_iter()
        .map(|(_, t, name, (id, flags, data))| (t, name, id, flags, data))
        .collect()
}

/// The same without what neither pcapng nor MCAP holds.
fn classic(batch: &FrameBatch) -> Vec<(i64, String, u32, u16, Vec<u8>)> {
    let mut all = frames(batch);
    all.retain(|(_, _, _, flags, data)| flags & FD != 0 || data.len() <= 8);
    all
}

/// Whether any frame or error frame has no time.
fn has_none(batch: &FrameBatch) -> bool {
    frames(batch).iter().any(|row| row.0 == NO_TIME)
}

#[test]
fn rows_as_recorded_are_those_that_the_text_of_a_recording_gives() {
    let mut random = Random(3);
    for round in 0..2000 {
        let logs = [random.log(round % 4), random.log((round + 1) % 4)].concat();
        let batch = read(Candump::new(), &logs);
        let (frames, events) = (batch.frames.len() as u32, batch.events.len() as u32);
        let mut recorded = Recorded::default();
        let (mut writer, mut reader, mut rows) = (candump::Candump::recording(), Candump::new(), Rows::default());
        for part in 0..3 {
            let third = |count: u32| (count * part / 3..count * (part + 1) / 3).collect::<Vec<_>>();
            let part = batch.pick(&third(frames), &third(events));
            let mut text = vec![];
            writer.write(&part, &HashMap::new(), &mut text);
            if !text.is_empty() {
                Reader::feed(&mut reader, &text, &mut rows);
            }
            let (direct, expected) = (recorded.apply(&part), rows.take());
            let shown = String::from_utf8_lossy(&text);
            assert_eq!(direct.frames, expected.frames, "{shown}");
            assert_eq!(direct.events, expected.events, "{shown}");
            assert_eq!(direct.counts, expected.counts, "{shown}");
            assert_eq!(
                (direct.stamps, &direct.buses),
                (expected.stamps, &expected.buses),
                "{shown}"
            );
        }
        assert!(recorded.account().lost().eq(writer.account().lost()));
    }
}

#[test]
fn text_reads_the_same_again() {
    let mut random = Random(1);
    for round in 0..4000 {
        let log = random.log(round % 4);
        let batch = read(Candump::new(), &log);
        let out = write(candump::Candump::default(), &batch);
        let again = read(Candump::new(), &out);
        let shown = String::from_utf8_lossy(&log);
        assert_eq!(frames(&again).len(), frames(&batch).len(), "{shown}");
        assert_eq!(
            (again.counts.unreadable, again.counts.dropped),
            (0, batch.counts.dropped),
            "{shown}"
        );
        assert_eq!(again.counts.comments, batch.counts.comments, "{shown}");
        for (new, old) in frames(&again).into_iter().zip(frames(&batch)) {
            assert_eq!((new.2, new.3, new.4), (old.2, old.3, old.4), "{shown}");
            assert_eq!(new.0, if old.0 < 0 { i64::MIN } else { old.0 }, "{shown}");
        }
        assert_eq!(write(candump::Candump::default(), &again), out, "{shown}");
    }
}

#[test]
fn packets_read_the_same_again() {
    let mut random = Random(2);
    for round in 0..4000 {
        let log = random.log(round % 4);
        let batch = read(Candump::new(), &log);
        let again = read(Pcapng::default(), &write(pcapng::Pcapng::default(), &batch));
        let shown = String::from_utf8_lossy(&log);
        assert_eq!(classic(&again), classic(&batch), "{shown}");
        assert_eq!(again.stamps.contains(Stamps::NONE), has_none(&again), "{shown}");
        assert_eq!(again.counts.dropped, batch.counts.dropped, "{shown}");
        assert_eq!(again.counts.comments, batch.counts.comments, "{shown}");
    }
}

#[test]
fn messages_read_the_same_again() {
    let mut random = Random(3);
    for round in 0..4000 {
        let log = random.log(round % 4);
        let batch = read(Candump::new(), &log);
        let (mut messages, mut walk) = (Messages::default(), Walk::default());
        let (mut at, limit) = (Some(0), 1 + random.below(500));
        while let Some(start) = at {
            at = messages.add(&batch, start, limit);
            let Some(chunk) = messages.take(0) else { continue };
            for (id, channel) in (1..).zip(messages.channels()) {
                let (layout, flags) = match channel.content {
                    Content::Frames(flags) if flags & FD != 0 => (Layout::ros(Wire::Cdr, Kind::SocketCanFd), flags),
                    Content::Frames(flags) => (Layout::ros(Wire::Cdr, Kind::CanMsgs), flags),
                    Content::Drops => (Layout::drops(), 0),
                    Content::Comments => (Layout::comments(), 0),
                };
                walk.channel(id, &channel.bus, layout);
                walk.mark(id, flags | [0, RX, TX][channel.direction as usize]);
                if !channel.timed {
                    walk.untimed(id);
                }
            }
            assert_eq!(
                walk.walk(&chunk.messages, 0, usize::MAX),
                (chunk.messages.len(), Stop::End)
            );
            let indexed: u64 = chunk.indexes.iter().map(|(.., count)| count).sum();
            assert!(indexed > 0 && chunk.messages.len() < limit + 300);
        }
        let again = walk.take();
        let shown = String::from_utf8_lossy(&log);
        assert_eq!(classic(&again), classic(&batch), "{shown}");
        assert_eq!(remarks(&again).len(), remarks(&batch).len(), "{shown}");
        for (new, old) in remarks(&again).into_iter().zip(remarks(&batch)) {
            let count = old.1.is_some();
            let t = if count && old.0 == NO_TIME { NO_TIME } else { new.0 };
            let text = if count { &old.2 } else { &new.2 };
            assert_eq!((t, new.1, text), (old.0, old.1, &old.2), "{shown}");
        }
        assert_eq!(again.stamps.contains(Stamps::NONE), has_none(&again), "{shown}");
        assert_eq!(again.counts.unreadable, 0, "{shown}");
    }
}

/// Comments and numbers of lost frames with their times; a count without one may get one.
fn remarks(batch: &FrameBatch) -> Vec<(i64, Option<u32>, String)> {
    let events = &batch.events;
    let rows = (0..events.len()).filter(|&row| matches!(events.kind[row], 1 | 4));
    let number = |row: usize| (events.kind[row] == 1).then(|| events.class[row]);
    rows.map(|row| (events.t[row], number(row), events.text_of(row)))
        .collect()
}
