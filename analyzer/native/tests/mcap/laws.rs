//! Laws that hold for any messages: valid ones give their frames back, damaged ones are counted, and it does not matter
//! how the records are cut.

#[path = "../pipeline/random.rs"]
mod random;

use _native::frames::{BRS, ERROR, ESI, EXTENDED, FD, REMOTE, TX};
use _native::mcap::{Stop, Walk};

use crate::common::messages::record;
use crate::common::{rows, shapes, Row, Sent, Shape};
use random::Random;

const LOG_TIME: u64 = 77;

fn any(random: &mut Random, shape: Shape) -> Sent {
    let flags = [
        0,
        EXTENDED,
        FD,
        FD | EXTENDED | BRS,
        EXTENDED | REMOTE,
        REMOTE,
        ERROR,
        ESI | FD | TX,
    ];
    let lengths = [0, 1, 2, 7, 8, 12, 48, 64];
    let length = lengths[random.below(lengths.len())];
    let sent = Sent {
        t: if random.one_in(4) {
            0
        } else {
            i64::from(random.next()) << 20
        },
        name: ["", "can0", "can1", "a", "interface"][random.below(5)].to_owned(),
        id: random.next(),
        flags: flags[random.below(flags.len())],
        data: random.bytes(length),
    };
    shape.carried(&sent)
}

/// What comes back of a frame.
fn expected(sent: &Sent) -> Sent {
    let mut row = sent.clone();
    if row.t == 0 {
        row.t = LOG_TIME as i64;
    }
    if row.name.is_empty() {
        "announced".clone_into(&mut row.name);
    }
    row
}

fn started(shape: Shape) -> Walk {
    let mut walk = Walk::default();
    walk.channel(9, "announced", shape.layout());
    walk.mark(9, shape.marks());
    walk
}

fn walked(shape: Shape, data: &[u8]) -> (Vec<Row>, (usize, Stop)) {
    let mut walk = started(shape);
    let stop = walk.walk(data, 0, usize::MAX);
    (rows(&mut walk).0, stop)
}

#[test]
fn frames_come_back_from_every_layout() {
    let mut random = Random(1);
    for shape in shapes() {
        let sent: Vec<Sent> = (0..300).map(|_| any(&mut random, shape)).collect();
        let data: Vec<u8> = sent
            .iter()
            .flat_map(|sent| record(9, LOG_TIME, &shape.message(sent)))
            .collect();
        let (rows, stop) = walked(shape, &data);
        assert_eq!(stop, (data.len(), Stop::End));
        assert_eq!(rows.len(), sent.len());
        for (row, (line, sent)) in rows.into_iter().zip((1..).zip(&sent)) {
            assert_eq!(row, (line, Ok(expected(sent))), "{shape:?}");
        }
    }
}

#[test]
fn a_cut_message_is_unreadable_at_every_byte() {
    let mut random = Random(2);
    for shape in shapes() {
        let first = record(9, LOG_TIME, &shape.message(&any(&mut random, shape)));
        for _ in 0..8 {
            let message = shape.message(&any(&mut random, shape));
            for end in 0..message.len() {
                let data = [&first[..], &record(9, LOG_TIME, &message[..end]), &first].concat();
                let (rows, stop) = walked(shape, &data);
                assert_eq!(stop, (data.len(), Stop::End));
                assert_eq!(rows.len(), 3);
                let whole = rows[0].1.is_ok() && rows[0].1 == rows[2].1;
                assert!(whole, "{shape:?}: the neighbours are not affected");
                let parses = matches!(shape, Shape::Protobuf(_)) || message[end..].trim_ascii().is_empty();
                assert!(parses || rows[1].1.is_err(), "{shape:?} cut at {end}");
            }
        }
    }
}

#[test]
fn a_flipped_byte_costs_its_own_message_only() {
    let mut random = Random(3);
    for shape in shapes() {
        let first = record(9, LOG_TIME, &shape.message(&any(&mut random, shape)));
        for _ in 0..4 {
            let message = shape.message(&any(&mut random, shape));
            for at in 0..message.len() {
                for bits in [1 << random.below(8), 0xFF, random.next() as u8] {
                    let mut damaged = message.clone();
                    damaged[at] ^= bits;
                    let data = [&first[..], &record(9, LOG_TIME, &damaged), &first].concat();
                    let (rows, stop) = walked(shape, &data);
                    assert_eq!((rows.len(), stop), (3, (data.len(), Stop::End)));
                    assert!(rows[0].1.is_ok() && rows[0].1 == rows[2].1);
                }
            }
        }
    }
}

#[test]
fn damaged_records_stop_the_walk_or_are_counted() {
    let mut random = Random(4);
    for shape in shapes() {
        let data: Vec<u8> = (0..3)
            .flat_map(|_| record(9, LOG_TIME, &shape.message(&any(&mut random, shape))))
            .collect();
        for at in 0..data.len() {
            let mut damaged = data.clone();
            damaged[at] ^= (random.next() as u8).max(1);
            let (_, (end, stop)) = walked(shape, &damaged);
            assert!(end <= damaged.len() && (stop == Stop::End) == (end == damaged.len()));
        }
    }
}

#[test]
fn every_way_to_cut_gives_the_same_rows() {
    let mut random = Random(5);
    for shape in shapes() {
        let data: Vec<u8> = (0..40)
            .flat_map(|_| {
                record(
                    9 + u16::from(random.one_in(5)),
                    LOG_TIME,
                    &shape.message(&any(&mut random, shape)),
                )
            })
            .collect();
        let whole = walked(shape, &data).0;
        for _ in 0..20 {
            let mut walk = started(shape);
            let (mut parts, mut from, mut to) = (vec![], 0, 0);
            while from < data.len() {
                to = data.len().min(to + 1 + random.below(200));
                let limit = 1 + random.below(5);
                let (used, stop) = walk.walk(&data[from..to], 0, limit);
                assert!(matches!(stop, Stop::End | Stop::Incomplete | Stop::Full));
                from += used;
                if stop == Stop::Full || random.one_in(3) {
                    parts.extend(rows(&mut walk).0);
                }
            }
            parts.extend(rows(&mut walk).0);
            assert!(parts == whole, "{shape:?}");
        }
    }
}
