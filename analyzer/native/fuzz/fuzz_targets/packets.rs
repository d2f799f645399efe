//! The laws of packets: every byte belongs to one, and what is said of each can be seen in its bytes.

use std::sync::Arc;

use _native::bits::Span;
use _native::decoder::make::Make;
use _native::decoder::packet::{context, Order, Wrap};
use _native::decoder::Decoder;
use _native::groups::{Group, MESSAGE};
use _native::packets::cut::cut;
use _native::packets::{find, Carrier, Counter, Family, Found, Spec, NO_FAMILY, NO_SPEC, RECOGNIZED};
use _native::plan::Plan;
use _native::transfers::{Row, Sink as _, Transfers};
use _native::unpack::column::Column;
use _native::wire::{Id, Kind};

fn families() -> [Family; 3] {
    let spec = |id, length, checksum_ends: &[u16]| Spec {
        id,
        length,
        checksum_ends: checksum_ends.to_vec(),
    };
    let family = |header: &[u8], packets| Family {
        header: header.to_vec(),
        id_at: 2,
        count_at: 3,
        unit_at: 4,
        length_at: 5,
        packets,
    };
    [
        family(
            b"<>",
            vec![spec(b'a', 9, &[8]), spec(b'b', 12, &[11, 10, 12]), spec(b'c', 7, &[])],
        ),
        family(b"<", vec![spec(b'a', 30, &[29]), spec(b'z', 0, &[])]),
        family(b"", vec![spec(b'a', 4, &[])]),
    ]
}

pub fn check(spans: &[Span], bytes: &[u8]) {
    let families = families();
    for own in 0..families.len() {
        let found = find(&families, own, spans, bytes);
        assert_tiled(&found, spans);
        (0..found.len()).for_each(|at| assert_packet(&families, own, &found, at, bytes));
        assert_steps(&families, &found, own, spans, bytes);
        assert_tables(&families, &found, spans.len(), bytes);
    }
}

/// Every packet is a row of one table, with its bytes, and has a cell in each column.
fn assert_tables(families: &[Family], found: &Found, messages: usize, bytes: &[u8]) {
    let mut transfers = Transfers::default();
    for at in 0..messages {
        let id = Id {
            kind: Kind::Message,
            type_id: 1,
            src: at as u8 & 0x7F,
            dst: 0,
        };
        transfers.push(&Row::bare(id, &[]));
    }
    let rows = (0..messages as u32).collect();
    let carriers = Arc::new(Group {
        transfers: Arc::new(transfers),
        rows,
        kind: MESSAGE,
        type_id: 1,
        variant: 0,
    });
    let steps = Counter::default().steps(families, found, &[], bytes);
    let tables = cut(found, &steps, bytes, &carriers, 3);
    assert_eq!(tables.iter().map(|table| table.len()).sum::<usize>(), found.len());
    let whole: usize = found.len.iter().map(|len| len.unsigned_abs() as usize).sum();
    assert_eq!(tables.iter().map(|table| table.data.len()).sum::<usize>(), whole);
    let tokens = [("struct", 2, 0), ("uint", 16, 0), ("uint", 24, 0)].map(|(word, a, b)| (word.to_owned(), a, b));
    let mut decoder = Decoder::new(Plan::parse(&tokens).expect("a layout that is right"));
    decoder.makes = vec![Make::Shown {
        field: 1,
        scales: vec![],
    }];
    decoder.numbers = vec![(0, 2), (2, 3), (1, 200)];
    decoder.wraps = vec![Wrap {
        field: 0,
        bits: 16,
        unit_at: 4,
        physical: None,
    }];
    let (mut counters, same) = (vec![], |columns: &[Column], rows| {
        columns.iter().all(|column| column.len() == rows)
    });
    for table in &tables {
        assert!(same(&context(table), table.len()));
        let flags: Vec<u8> = (0..table.len()).map(|row| row as u8 & 1).collect();
        let order = Order {
            big: &flags,
            decided: &flags,
        };
        if table.known.is_some() {
            assert!(same(&decoder.packets(table, Some(order), &mut counters), table.len()));
        }
        assert_eq!(
            decoder.packet_fields(table, false).len(),
            decoder.packet_fields(table, true).len()
        );
        let all: Vec<u32> = (0..table.len() as u32).collect();
        assert_eq!(table.pick(&all).data, table.data);
    }
}

/// The packets of a row lie one behind the other, from its first byte to its last.
fn assert_tiled(found: &Found, spans: &[Span]) {
    let mut at = 0;
    for (row, span) in spans.iter().enumerate() {
        let mut offset = 0;
        while at < found.len() && found.row[at] as usize == row {
            assert_eq!(found.offset[at] as usize, offset);
            assert_eq!(found.start[at] as usize, span.start + offset);
            assert!(found.len[at] > 0);
            offset += found.len[at] as usize;
            at += 1;
        }
        assert_eq!(offset, span.end - span.start);
    }
    assert_eq!(at, found.len());
}

fn assert_packet(families: &[Family], own: usize, found: &Found, at: usize, bytes: &[u8]) {
    let data = &bytes[found.start[at] as usize..][..found.len[at] as usize];
    let recognized = found.reason[at] == RECOGNIZED;
    assert_eq!(found.complete[at] != 0, recognized);
    let number = found.family[at];
    assert_eq!(
        found.header_ok[at] != 0,
        number != NO_FAMILY && usize::from(number) == own
    );
    if number == NO_FAMILY {
        assert!(!recognized && found.spec[at] == NO_SPEC);
        return;
    }
    let family = &families[usize::from(number)];
    assert!(!family.header.is_empty() && data.starts_with(&family.header));
    let Some(spec) = usize::try_from(found.spec[at]).ok().map(|spec| &family.packets[spec]) else {
        assert!(!recognized);
        return;
    };
    assert_eq!(bytes[found.start[at] as usize + family.id_at], spec.id);
    let length = usize::from(spec.length).max(family.header.len());
    if !recognized {
        assert!(data.len() < length && found.checksum_ok[at] == 0);
        return;
    }
    assert_eq!(data.len(), length);
    let sum = |end: usize| data[..end].iter().fold(0_u8, |sum, byte| sum.wrapping_add(*byte));
    let agrees = |end: &&u16| sum(usize::from(**end)) == data[data.len() - 1];
    let end = spec.checksum_ends.iter().find(agrees);
    assert_eq!(u16::from(found.checksum_end[at]), end.copied().unwrap_or(0));
    assert_eq!(
        found.checksum_ok[at] != 0,
        end.is_some() || spec.checksum_ends.is_empty()
    );
}

/// The steps do not depend on which rows were looked at together.
fn assert_steps(families: &[Family], found: &Found, own: usize, spans: &[Span], bytes: &[u8]) {
    let carriers = |spans: &[Span]| -> Vec<Carrier> {
        let carrier = |span: &Span| Carrier {
            bus: 0,
            src: (span.start % 3) as u8,
            type_id: 1,
        };
        spans.iter().map(carrier).collect()
    };
    let whole = Counter::default().steps(families, found, &carriers(spans), bytes);
    assert_eq!(whole.step.len(), found.len());
    let (first, second) = spans.split_at(spans.len() / 2);
    let mut counter = Counter::default();
    let parts = [first, second].map(|spans| {
        let found = find(families, own, spans, bytes);
        counter.steps(families, &found, &carriers(spans), bytes)
    });
    assert_eq!(parts.each_ref().map(|part| part.step.clone()).concat(), whole.step);
    assert_eq!(
        parts.each_ref().map(|part| part.step_valid.clone()).concat(),
        whole.step_valid
    );
    assert_eq!(
        parts.each_ref().map(|part| part.step_id.clone()).concat(),
        whole.step_id
    );
    assert_eq!(
        parts.each_ref().map(|part| part.step_id_valid.clone()).concat(),
        whole.step_id_valid
    );
}
