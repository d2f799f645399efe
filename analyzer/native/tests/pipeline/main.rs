//! The laws of the whole way from text to transfers, over valid traffic that is then damaged: random bytes
//! alone would never get past the first check.

#[path = "../common/capture.rs"]
mod capture;
#[path = "../common/log.rs"]
mod log;
mod random;
#[path = "../common/sender.rs"]
mod sender;
#[path = "../common/tables.rs"]
mod tables;
mod traffic;
#[path = "../common/wreck.rs"]
mod wreck;

use _native::frames::BRS;
use _native::transfers::Status;
use _native::verdict::Verdict;
use _native::wire::Id;

use log::{seconds, text};
use random::Random;
use sender::signatures;
use tables::Tables;
use traffic::{traffic, Sent};
use wreck::{damage_frame, damage_text, FRAME_DAMAGES, TEXT_DAMAGES};

/// All tables of a text, with the laws; and every other way to cut and take it must give the same.
fn read(random: &mut Random, text: &[u8]) -> Tables {
    let whole = Tables::of(std::iter::once((text, false)));
    whole.check();
    for most in [1 + random.below(7), 1 + random.below(400)] {
        let mut rest = text;
        let chunks = std::iter::from_fn(|| {
            let (chunk, behind) = rest.split_at(rest.len().min(1 + random.below(most)));
            rest = behind;
            (!chunk.is_empty()).then(|| (chunk, random.one_in(3)))
        });
        assert_eq!(Tables::of(chunks), whole, "chunks of up to {most} bytes");
    }
    whole
}

/// The transfers of a session as they were received, which have to be those that were sent.
fn assert_received(tables: &Tables, sent: &Sent) {
    let (id, rows) = (Id::parse(sent.id), &tables.capture.transfers);
    let known = !signatures(id.kind.is_service(), id.type_id).is_empty();
    let status = if known { Status::Ok } else { Status::Unchecked };
    let key = (id.kind as u8, id.type_id, id.src, id.dst);
    let bus = format!("can{}", sent.bus);
    let own = (0..rows.len()).filter(|&row| {
        (rows.kind[row], rows.type_id[row], rows.src[row], rows.dst[row]) == key
            && tables.buses[usize::from(rows.bus[row])] == bus
    });
    let received = own.map(|row| (rows.transfer_id[row], rows.payload_of(row), rows.status[row]));
    let sent = sent
        .transfers
        .iter()
        .map(|(transfer_id, payload)| (*transfer_id, &payload[..], status as u8));
    assert!(received.eq(sent), "{key:?}");
}

#[test]
fn valid_traffic_arrives_as_it_was_sent() {
    let mut random = Random(0x5EED_0001);
    let mut unknown = 0;
    for _ in 0..300 {
        let traffic = traffic(&mut random);
        let tables = read(&mut random, &text(&traffic.frames));
        assert_eq!(tables.capture.frames.len(), traffic.frames.len());
        for sent in &traffic.sent {
            let id = Id::parse(sent.id);
            let known = !signatures(id.kind.is_service(), id.type_id).is_empty();
            // An unknown type has to show three transfers in a row, or two with the CRC of one type.
            if known || sent.transfers.len() >= 3 {
                assert_received(&tables, sent);
                unknown += usize::from(!known);
            }
        }
        let others = [Verdict::Used, Verdict::Foreign].map(|verdict| tables.counts[verdict as usize]);
        assert_eq!(others.iter().sum::<u64>(), tables.lines.frames);
    }
    assert!(unknown > 100, "{unknown} sessions of unknown types");
}

#[test]
fn relative_stamps_give_the_same_tables_from_zero_on() {
    let mut random = Random(0x5EED_0004);
    for _ in 0..100 {
        let frames = traffic(&mut random).frames;
        let start = frames[0].t;
        let mut moved = frames.clone();
        for frame in &mut moved {
            frame.t -= start;
        }
        let expected = Tables::of(std::iter::once((&text(&moved)[..], false))).capture;
        let mut last = start;
        let (mut since_start, mut since_last) = (String::new(), String::new());
        for frame in &frames {
            since_start += &frame.console(&format!(" ({})", seconds(frame.t - start)));
            since_last += &frame.console(&format!(" ({})", seconds(frame.t - last)));
            last = frame.t;
        }
        let mut forms = vec![since_start];
        // A few differences that never shrink on one interface look like times.
        if frames.len() > 20 {
            forms.push(since_last);
        }
        for form in forms {
            let mut capture = read(&mut random, form.as_bytes()).capture;
            // Only the console form keeps the bit rate switch to itself.
            let flags = capture.frames.flags.iter_mut().zip(&expected.frames.flags);
            flags.for_each(|(flags, expected)| *flags |= expected & BRS);
            assert_eq!(capture, expected, "{form}");
        }
    }
}

#[test]
fn damaged_frames_are_all_accounted_for() {
    let mut random = Random(0x5EED_0002);
    let mut seen = [0; 8];
    let mut statuses = [0; 7];
    for _ in 0..1000 {
        let mut frames = traffic(&mut random).frames;
        for _ in 0..=random.below(1 + frames.len() / 4) {
            let (kind, at) = (random.next() as u8 % FRAME_DAMAGES, random.below(1 << 16));
            damage_frame(&mut frames, kind, at, random.next());
        }
        let tables = read(&mut random, &text(&frames));
        seen.iter_mut()
            .zip(tables.counts)
            .for_each(|(sum, count)| *sum += count);
        for &status in &tables.capture.transfers.status {
            statuses[usize::from(status)] += 1;
        }
    }
    assert!(seen.iter().all(|&frames| frames > 0), "every verdict occurs: {seen:?}");
    assert!(
        statuses.iter().all(|&rows| rows > 0),
        "every status occurs: {statuses:?}"
    );
}

#[test]
fn damaged_text_is_all_accounted_for() {
    let mut random = Random(0x5EED_0003);
    let (mut unreadable, mut frames) = (0, 0);
    for _ in 0..800 {
        let mut text = text(&traffic(&mut random).frames);
        for _ in 0..=random.below(12) {
            let (kind, at) = (random.next() as u8 % TEXT_DAMAGES, random.below(1 << 20));
            damage_text(&mut text, kind, at, random.next() as u8);
        }
        let tables = read(&mut random, &text);
        unreadable += tables.lines.unreadable;
        frames += tables.lines.frames;
    }
    assert!(unreadable > 500 && frames > 10 * unreadable, "{unreadable} of {frames}");
}
