//! The laws of packets: every byte belongs to one, and what is said of each can be seen in its bytes.

use _native::bits::Span;
use _native::packets::{find, Carrier, Counter, Family, Found, Spec, NO_FAMILY, NO_SPEC, RECOGNIZED};

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
