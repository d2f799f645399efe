//! Packets inside byte arrays: the packets of sections 4.4.4 and 4.4.5, and what is not one.
#![forbid(unsafe_code)]

mod counter;

use _native::bits::Span;
use _native::packets::{find, Carrier, Counter, Family, Found, Spec, NO_FAMILY, NO_SPEC, RECOGNIZED};
use _native::packets::{NO_HEADER, TRUNCATED, UNKNOWN_ID};

const SCI: usize = 0;
const CAN: usize = 1;
const QUERY: [u8; 7] = [0xEC, 0x96, 0x1A, 5, 0xA1, 7, 0x49];

fn families() -> Vec<Family> {
    let family = |header: [u8; 2], packets: &[(u8, u16, &[u16])]| Family {
        header: header.to_vec(),
        id_at: 2,
        count_at: 3,
        unit_at: 4,
        length_at: 5,
        packets: packets
            .iter()
            .map(|&(id, length, ends)| Spec {
                id,
                length,
                checksum_ends: ends.to_vec(),
            })
            .collect(),
    };
    vec![
        family(
            [0xEC, 0x96],
            &[
                (0x08, 7, &[6]),
                (0x1E, 31, &[30, 28]),
                (0x1A, 7, &[6]),
                (0x06, 12, &[11]),
            ],
        ),
        family([0x7B, 0x8C], &[(0x15, 28, &[27]), (0x1E, 55, &[54])]),
    ]
}

/// A packet whose checksum covers the bytes 1 to `end`.
fn packet(header: [u8; 2], id: u8, count: u8, unit: u8, length: usize, end: usize) -> Vec<u8> {
    let mut out = vec![0x11; length];
    out[..6].copy_from_slice(&[header[0], header[1], id, count, unit, u8::try_from(length).unwrap()]);
    out[length - 1] = out[..end].iter().fold(0, |sum: u8, byte| sum.wrapping_add(*byte));
    out
}

fn one_row(own: usize, data: &[u8]) -> Found {
    let span = Span {
        start: 0,
        end: data.len(),
    };
    find(&families(), own, &[span], data)
}

/// (offset, len, family, spec, reason) of each piece.
fn pieces(found: &Found) -> Vec<(u32, i32, u8, i16, u8)> {
    (0..found.len())
        .map(|at| {
            (
                found.offset[at],
                found.len[at],
                found.family[at],
                found.spec[at],
                found.reason[at],
            )
        })
        .collect()
}

#[test]
fn a_packet_with_all_that_is_said_of_it() {
    let expected = Found {
        row: vec![0],
        offset: vec![0],
        start: vec![0],
        len: vec![7],
        family: vec![0],
        spec: vec![2],
        header_ok: vec![1],
        length_ok: vec![1],
        complete: vec![1],
        checksum_ok: vec![1],
        checksum_end: vec![6],
        reason: vec![RECOGNIZED],
    };
    assert_eq!(one_row(SCI, &QUERY), expected);
}

#[test]
fn the_header_of_the_other_direction_is_said() {
    let found = one_row(CAN, &QUERY);
    assert_eq!(
        (found.family, found.spec, found.header_ok, found.checksum_ok),
        (vec![0], vec![2], vec![0], vec![1])
    );
}

#[test]
fn length_and_checksum_are_judged_apart() {
    let mut wrong_length = QUERY;
    wrong_length[5] = 8;
    wrong_length[6] += 1;
    let found = one_row(SCI, &wrong_length);
    assert_eq!(
        (found.length_ok, found.checksum_ok, found.complete),
        (vec![0], vec![1], vec![1])
    );
    let mut wrong_sum = QUERY;
    wrong_sum[6] ^= 0x10;
    let found = one_row(SCI, &wrong_sum);
    assert_eq!(
        (found.length_ok, found.checksum_ok, found.checksum_end),
        (vec![1], vec![0], vec![0])
    );
}

#[test]
fn the_preferred_of_two_checksum_ranges_is_named_first() {
    let ends = |wire: &[u8]| one_row(SCI, wire).checksum_end[0];
    let long = packet([0xEC, 0x96], 0x1E, 0, 0xA1, 31, 30);
    let short = packet([0xEC, 0x96], 0x1E, 0, 0xA1, 31, 28);
    assert_eq!((ends(&long), ends(&short)), (30, 28));
    let mut both = packet([0xEC, 0x96], 0x1E, 0, 0xA1, 31, 28);
    both[28..30].fill(0);
    assert_eq!(ends(&both), 30);
}

#[test]
fn a_type_without_checksum_cannot_fail_it() {
    let mut families = families();
    families[0].packets[2].checksum_ends.clear();
    let mut wire = QUERY;
    wire[6] = 0;
    let found = find(&families, SCI, &[Span { start: 0, end: 7 }], &wire);
    assert_eq!((found.checksum_ok, found.checksum_end), (vec![1], vec![0]));
}

#[test]
fn packets_follow_each_other_and_what_lies_between_is_kept() {
    let status = packet([0x7B, 0x8C], 0x15, 1, 0xA1, 28, 27);
    let data = [&[1, 2, 3][..], &QUERY, &status, &[0xEC], &QUERY, &[9]].concat();
    let expected = [
        (0, 3, NO_FAMILY, NO_SPEC, NO_HEADER),
        (3, 7, 0, 2, RECOGNIZED),
        (10, 28, 1, 0, RECOGNIZED),
        (38, 1, NO_FAMILY, NO_SPEC, NO_HEADER),
        (39, 7, 0, 2, RECOGNIZED),
        (46, 1, NO_FAMILY, NO_SPEC, NO_HEADER),
    ];
    let found = one_row(CAN, &data);
    assert_eq!(pieces(&found), expected);
    assert_eq!(found.header_ok, [0, 0, 1, 0, 0, 0]);
}

#[test]
fn an_unknown_id_reaches_to_the_next_header() {
    let unknown = packet([0xEC, 0x96], 0x77, 1, 0xA1, 9, 8);
    let found = one_row(SCI, &[&unknown[..], &QUERY].concat());
    assert_eq!(
        pieces(&found),
        [(0, 9, 0, NO_SPEC, UNKNOWN_ID), (9, 7, 0, 2, RECOGNIZED)]
    );
    assert_eq!(pieces(&one_row(SCI, &unknown)), [(0, 9, 0, NO_SPEC, UNKNOWN_ID)]);
}

#[test]
fn a_packet_cut_off_keeps_its_spec_while_its_id_is_there() {
    let found = one_row(SCI, &[&QUERY[..], &QUERY[..4]].concat());
    assert_eq!(pieces(&found)[1], (7, 4, 0, 2, TRUNCATED));
    assert_eq!(
        (found.complete, found.length_ok, found.checksum_ok),
        (vec![1, 0], vec![1, 0], vec![1, 0])
    );
    assert_eq!(pieces(&one_row(SCI, &QUERY[..2])), [(0, 2, 0, NO_SPEC, TRUNCATED)]);
    assert_eq!(
        pieces(&one_row(SCI, &QUERY[..1])),
        [(0, 1, NO_FAMILY, NO_SPEC, NO_HEADER)]
    );
}

#[test]
fn the_own_family_is_tried_first() {
    let mut families = families();
    families[1].header = families[0].header.clone();
    let data = packet([0xEC, 0x96], 0x1E, 0, 0xA1, 55, 54);
    let span = Span { start: 0, end: 55 };
    assert_eq!(
        pieces(&find(&families, CAN, &[span], &data)),
        [(0, 55, 1, 1, RECOGNIZED)]
    );
    assert_eq!(
        pieces(&find(&families, SCI, &[span], &data))[0],
        (0, 31, 0, 1, RECOGNIZED)
    );
}

#[test]
fn rows_are_apart_and_may_come_in_any_order() {
    let data = [&QUERY[..], &QUERY[..3]].concat();
    let spans = [(7, 10), (3, 3), (0, 7), (5, 99)].map(|(start, end)| Span { start, end });
    let found = find(&families(), SCI, &spans, &data);
    assert_eq!((found.row, found.offset), (vec![0, 2, 3, 3], vec![0, 0, 0, 2]));
    assert_eq!((found.start, found.len), (vec![7, 0, 5, 7], vec![3, 7, 2, 3]));
}

fn xorshift(state: &mut u64) -> u64 {
    *state ^= *state << 13;
    *state ^= *state >> 7;
    *state ^= *state << 17;
    *state
}

/// Packets, packets cut off or with a wrong byte, and noise in which headers are frequent.
fn traffic(state: &mut u64) -> Vec<u8> {
    let mut out = vec![];
    for _ in 0..xorshift(state) % 6 {
        let mut part = match xorshift(state) % 5 {
            0 => QUERY.to_vec(),
            1 => packet([0x7B, 0x8C], 0x15, 3, 0xA2, 28, 27),
            2 => packet([0xEC, 0x96], 0x1E, 0, 0xA1, 31, 28),
            _ => (0..xorshift(state) % 20)
                .map(|_| [0xEC, 0x96, 0x7B, 0x8C, 0x1E, 7][xorshift(state) as usize % 6])
                .collect(),
        };
        let len = part.len().max(1) as u64;
        match xorshift(state) % 4 {
            0 => part.truncate((xorshift(state) % len) as usize),
            1 if !part.is_empty() => part[(xorshift(state) % len) as usize] = xorshift(state) as u8,
            _ => {}
        }
        out.append(&mut part);
    }
    out
}

#[test]
fn every_byte_belongs_to_exactly_one_piece() {
    let mut state = 0x0DDB_1A5E_5BAD_5EED;
    let mut seen = [0; 4];
    for _ in 0..2000 {
        let data = traffic(&mut state);
        let families = families();
        let found = one_row((xorshift(&mut state) % 3) as usize, &data);
        let mut at = 0;
        for (offset, len, family, spec, reason) in pieces(&found) {
            assert!(offset == at && len > 0, "{data:02X?}");
            at += len as u32;
            seen[usize::from(reason.min(3))] += 1;
            let piece = &data[offset as usize..at as usize];
            let of = families.get(usize::from(family));
            let known = of.and_then(|f| f.packets.get(usize::try_from(spec).ok()?));
            assert_eq!(
                reason == RECOGNIZED,
                known.is_some_and(|spec| usize::from(spec.length) == piece.len())
            );
            assert_eq!(reason == NO_HEADER, of.is_none());
            assert!(of.is_none_or(|f| piece.starts_with(&f.header)));
            // Only whole packets may hold a header behind their start: all else ends where one begins.
            let hides = |f: &Family| piece.windows(2).skip(1).any(|two| two == f.header);
            assert!(known.is_some() || !families.iter().any(hides), "{data:02X?}");
        }
        assert_eq!(at as usize, data.len());
    }
    assert!(seen.iter().all(|&count| count > 100), "{seen:?}");
}

#[test]
fn families_without_sense_do_no_harm() {
    let spec = |id, length| Spec {
        id,
        length,
        checksum_ends: vec![0, 9, u16::MAX],
    };
    let family = |header: &[u8], at, packets| Family {
        header: header.to_vec(),
        id_at: at,
        count_at: at,
        unit_at: usize::MAX,
        length_at: usize::MAX,
        packets,
    };
    let families = [
        family(&[], 0, vec![spec(0, 0)]),
        family(&[1], 0, vec![spec(1, 0)]),
        family(&[2], usize::MAX, vec![]),
        family(&[3, 0], 1, vec![spec(0, u16::MAX)]),
    ];
    let data = [1, 1, 0, 3, 0, 2];
    let found = find(&families, 9, &[Span { start: 0, end: 6 }], &data);
    let expected = [(0, 1, 1, 0), (1, 1, 1, 0), (2, 1, NO_FAMILY, NO_SPEC), (3, 3, 3, 0)];
    assert_eq!(
        pieces(&found).iter().map(|p| (p.0, p.1, p.2, p.3)).collect::<Vec<_>>(),
        expected
    );
    let carrier = Carrier {
        bus: 0,
        src: 1,
        type_id: 2,
    };
    assert_eq!(
        Counter::default()
            .steps(&families, &found, &[carrier], &data)
            .step_valid,
        [0; 4]
    );
    assert!(find(&[], 0, &[], &[]).is_empty());
}
