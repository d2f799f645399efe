//! Packets: cut out of messages, turned round, their counters continued.

use std::collections::HashMap;
use std::sync::Arc;

use _native::decoder::make::Make;
use _native::decoder::packet::{Order, Wrap};
use _native::decoder::unwrap::Unwrapper;
use _native::decoder::Decoder;
use _native::groups::{Group, MESSAGE};
use _native::packets::cut::{cut, Cut};
use _native::packets::{find, Carrier, Counter, Family, Spec};
use _native::transfers::{Row, Sink as _, Status, Transfers};
use _native::unpack::column::Flat;
use _native::wire::{Id, Kind};

use super::{arena, plan, text};

/// Packets of 8 bytes: header, id, count, unit, length, a number of two bytes, checksum over the seven before it.
fn packet(unit: u8, number: u16) -> Vec<u8> {
    let mut out = vec![b'<', 7, 1, unit, 8];
    out.extend(number.to_le_bytes());
    out.push(out.iter().fold(0, |sum: u8, byte| sum.wrapping_add(*byte)));
    out
}

/// What is found in messages of node 5, of which those with a broken CRC come last.
fn found(arrays: &[Vec<u8>], good: usize) -> Vec<Cut> {
    let spec = |id, length, ends: &[u16]| Spec {
        id,
        length,
        checksum_ends: ends.to_vec(),
    };
    let families = [Family {
        header: b"<".to_vec(),
        id_at: 1,
        count_at: 2,
        unit_at: 3,
        length_at: 4,
        packets: vec![spec(9, 6, &[]), spec(7, 8, &[7])],
    }];
    let mut transfers = Transfers::default();
    for at in 0..arrays.len() {
        let id = Id {
            kind: Kind::Message,
            type_id: 1,
            src: 5,
            dst: 0,
        };
        let status = if at < good { Status::Ok } else { Status::BadCrc };
        transfers.push(&Row {
            bus: 1,
            status,
            ..Row::bare(id, &[])
        });
    }
    let rows = (0..arrays.len() as u32).collect();
    let carriers = Group {
        transfers: Arc::new(transfers),
        rows,
        kind: MESSAGE,
        type_id: 1,
        variant: 0,
    };
    let (data, spans) = arena(&arrays.iter().map(Vec::as_slice).collect::<Vec<_>>());
    let found = find(&families, 0, &spans, &data);
    let senders = vec![
        Carrier {
            bus: 1,
            src: 5,
            type_id: 1
        };
        arrays.len()
    ];
    let steps = Counter::default().steps(&families, &found, &senders, &data);
    cut(&found, &steps, &data, &Arc::new(carriers), 100)
}

#[test]
fn packets_are_cut_turned_and_continued() {
    let mut damaged = packet(1, 60_000);
    damaged[5] ^= 1;
    let arrays = [
        [packet(1, 65_535), packet(2, 9), b"??".to_vec()].concat(),
        [packet(1, 1), damaged].concat(),
        packet(1, u16::from_be_bytes([2, 0])),
        packet(1, 3),
    ];
    let tables = found(&arrays, 3);
    let known: Vec<_> = tables.iter().map(|table| (table.known, table.len())).collect();
    assert_eq!(known, [(Some((0, 1)), 6), (None, 1)]);
    let numbers = &tables[0];
    assert_eq!(
        numbers.positions(),
        [100 << 16, 100 << 16 | 8, 101 << 16, 101 << 16 | 8, 102 << 16, 103 << 16]
    );
    assert_eq!(numbers.sound(), [1, 1, 1, 0, 1, 0]);
    assert_eq!(numbers.messages().senders(), [0x105; 6]);
    assert_eq!(
        numbers.pick(&[4, 9, 1]).data,
        [packet(1, 0x0200), packet(2, 9)].concat()
    );
    let layout = [
        ("struct", 3, 0),
        ("array", 5, 0),
        ("uint", 8, 0),
        ("uint", 16, 0),
        ("uint", 8, 0),
    ];
    let mut decoder = Decoder::new(plan(&layout));
    decoder.makes = vec![Make::Shown {
        field: 1,
        scales: vec![],
    }];
    decoder.numbers = vec![(5, 2), (7, 9)];
    decoder.wraps = vec![Wrap {
        field: 1,
        bits: 16,
        unit_at: 3,
        physical: None,
    }];
    let order = Order {
        big: &[0, 0, 0, 0, 1, 0],
        decided: &[1; 6],
    };
    let columns = decoder.packets(numbers, Some(order), &mut vec![]);
    assert_eq!(columns.len(), 5 + 1 + 8 + 2 + 1 + 1);
    let flats: Vec<Flat> = columns
        .into_iter()
        .flat_map(_native::unpack::column::Column::flatten)
        .collect();
    let field = flats[16].buffer.as_deref().unwrap_or_default();
    let field: Vec<u16> = field
        .as_chunks()
        .0
        .iter()
        .map(|cell| u16::from_le_bytes(*cell))
        .collect();
    assert_eq!(field, [65_535, 9, 1, 60_001, 2, 3]);
    let total = flats[17].buffer.as_deref().unwrap_or_default();
    let total: Vec<u64> = total
        .as_chunks()
        .0
        .iter()
        .map(|cell| u64::from_le_bytes(*cell))
        .collect();
    // What is damaged, or read in the other order, is no part of the sequence.
    assert_eq!(
        (total, flats[17].validity.as_deref()),
        (vec![65_535, 9, 65_537, 0, 2, 0], Some(&[0b1_0111][..]))
    );
    let both = [false, true].map(|big| decoder.packet_fields(&numbers.pick(&[4]), big).remove(0).flatten());
    assert_eq!(
        both.map(|flat| flat[0].buffer.clone()),
        [Some(vec![0, 2]), Some(vec![2, 0])]
    );
}

#[test]
fn bytes_that_are_no_packet_say_why() {
    let tables = found(&[b"?<\x00\x01..<\x07".to_vec()], 1);
    let columns = _native::decoder::packet::context(&tables[1]);
    let [.., reason, data] = &columns
        .into_iter()
        .flat_map(_native::unpack::column::Column::flatten)
        .collect::<Vec<_>>()[..]
    else {
        panic!("reason and data");
    };
    assert_eq!(text(reason), (vec![0, 9, 25], "no headerunknown frame id"));
    assert_eq!(text(data), (vec![0, 1, 6], "?<\0\x01.."));
    assert_eq!((tables[0].known, tables[0].ok()), (Some((0, 1)), vec![0]));
}

#[test]
fn counters_are_continued_as_if_they_were_followed_one_by_one() {
    let mut state = 1_u32;
    let mut random = |below: usize| {
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        (state >> 16) as usize % below
    };
    for _ in 0..300 {
        let rows = random(60);
        let counters: Vec<u32> = (0..rows).map(|_| random(4) as u32).collect();
        let raw: Vec<u64> = (0..rows).map(|_| [0, 1, 7, 8, 9, 14, 15][random(7)]).collect();
        let mut last: HashMap<u32, (u64, u64)> = HashMap::new();
        let one_by_one = counters.iter().zip(&raw).map(|(&counter, &value)| {
            let (before, mut wrapped) = last.get(&counter).copied().unwrap_or((value, 0));
            if before > value + 8 {
                wrapped += 16;
            } else if value < before {
                wrapped = 0;
            }
            last.insert(counter, (value, wrapped));
            value + wrapped
        });
        let one_by_one: Vec<u64> = one_by_one.collect();
        let (cut, mut unwrapper) = (random(rows + 1), Unwrapper::default());
        let parts = [0..cut, cut..rows].map(|part| unwrapper.follow(4, &counters[part.clone()], &raw[part]));
        assert_eq!(parts.concat(), one_by_one);
    }
    let many: Vec<u32> = (0..=Unwrapper::MAX_COUNTERS as u32).rev().collect();
    let mut unwrapper = Unwrapper::default();
    unwrapper.follow(4, &many, &vec![15; many.len()]);
    // The one with the highest number was above those that are remembered.
    assert_eq!(unwrapper.follow(4, &[many[0], many[1]], &[1, 1]), [1, 17]);
}
