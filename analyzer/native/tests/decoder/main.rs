//! Descriptions of tables: what is made of fields, and which rows have a length in front of their tail array.
#![forbid(unsafe_code)]

mod packets;

use _native::bits::{spans, Span};
use _native::decoder::length::{Length, Limit};
use _native::decoder::make::{Formula, Look, Make, Measure, Piece};
use _native::decoder::number::Linear;
use _native::decoder::Decoder;
use _native::plan::{Plan, Token};
use _native::unpack::column::Flat;
use _native::unpack::{BYTE_PREFIX, PREFIX, TAIL};

const SAME: Linear = linear(1.0, 1.0, 0.0);

const fn linear(times: f64, by: f64, plus: f64) -> Linear {
    Linear { times, by, plus }
}

fn plan(tokens: &[(&str, u32, u32)]) -> Plan {
    let tokens: Vec<Token> = tokens.iter().map(|(word, a, b)| ((*word).to_owned(), *a, *b)).collect();
    Plan::parse(&tokens).expect("a layout that is right")
}

fn made(tokens: &[(&str, u32, u32)], makes: Vec<Make>, rows: &[&[u8]]) -> Vec<Flat> {
    let mut decoder = Decoder::new(plan(tokens));
    decoder.makes = makes;
    let (payload, spans) = arena(rows);
    let columns = decoder.rows(&spans, &[], &payload);
    columns
        .into_iter()
        .flat_map(_native::unpack::column::Column::flatten)
        .collect()
}

fn arena(rows: &[&[u8]]) -> (Vec<u8>, Vec<Span>) {
    let mut ends = vec![0_i32];
    for row in rows {
        ends.push(ends[ends.len() - 1] + row.len() as i32);
    }
    (rows.concat(), spans(&ends, None))
}

fn reals(flat: &Flat) -> Vec<f64> {
    let bytes = flat.buffer.as_deref().unwrap_or_default();
    bytes
        .as_chunks()
        .0
        .iter()
        .map(|cell| f64::from_le_bytes(*cell))
        .collect()
}

fn text(flat: &Flat) -> (Vec<u8>, &str) {
    let ends = flat.buffer.as_deref().unwrap_or_default();
    let letters = flat.letters.as_deref().unwrap_or_default();
    let low = ends.iter().step_by(4).copied().collect();
    (low, std::str::from_utf8(letters).expect("a text"))
}

#[test]
fn a_word_has_parts_unless_it_is_special() {
    let part = |low, width, look| Make::Part {
        field: 0,
        low,
        width,
        look,
        without: vec![0xFFFF],
    };
    let makes = vec![
        part(15, 1, Look::Flag),
        part(4, 9, Look::Number),
        part(0, 4, Look::Physical(linear(3.0, 10.0, 0.0))),
        Make::Shown {
            field: 0,
            scales: vec![(vec![], linear(1.0, 2.0, 0.0))],
        },
    ];
    let rows: [&[u8]; 3] = [&[0x57, 0x81], &[0xFF, 0xFF], &[0x01]];
    let [flag, number, physical, shown] = &made(&[("struct", 1, 0), ("uint", 16, 0)], makes, &rows)[..] else {
        panic!("four columns");
    };
    for part in [flag, number, physical] {
        assert_eq!((part.len, part.validity.as_deref()), (3, Some(&[0b001][..])));
    }
    assert_eq!(flag.buffer.as_deref().map(|bits| bits[0] & 1), Some(1));
    assert_eq!(
        number.buffer.as_deref().map(|cells| cells[..2].to_vec()),
        Some(vec![0x15, 0])
    );
    assert_eq!(reals(physical)[0].to_bits(), 2.1_f64.to_bits());
    assert_eq!(
        (reals(shown)[..2].to_vec(), shown.validity.as_deref()),
        (vec![16_555.5, 32_767.5], Some(&[0b011][..]))
    );
}

#[test]
fn numbers_are_computed_in_lists_and_out_of_them() {
    let formula = Formula {
        linear: linear(1.0, 2.0, 1.0),
        pieces: vec![
            Piece {
                start: 6.0,
                stop: 8.0,
                add: -5.0,
            },
            Piece {
                start: 7.0,
                stop: f64::INFINITY,
                add: 100.0,
            },
        ],
        low: -1.0,
        high: 20.0,
        without: vec![3],
    };
    let derived = |element| Make::Derived {
        field: 0,
        element,
        formula: formula.clone(),
    };
    let rows: [&[u8]; 3] = [&[2, 3, 10, 12, 14], &[], &[0xFE, 21]];
    let columns = made(
        &[("struct", 1, 0), ("list", 8, 4), ("int", 8, 0)],
        vec![derived(None), derived(Some(1))],
        &rows,
    );
    let [lists, values, second] = &columns[..] else {
        panic!("a list with its values, and a column");
    };
    assert_eq!(
        lists.buffer.as_deref(),
        Some(&[0, 0, 0, 0, 5, 0, 0, 0, 5, 0, 0, 0, 7, 0, 0, 0][..])
    );
    assert_eq!(values.validity.as_deref(), Some(&[0b001_1101][..]));
    let expected = [2.0, 0.0, 1.0, 2.0, 108.0];
    for at in [0, 2, 3, 4] {
        assert_eq!(reals(values)[at].to_bits(), f64::to_bits(expected[at]));
    }
    assert_eq!((second.len, second.validity.as_deref()), (3, Some(&[0][..])));
}

#[test]
fn texts_units_and_days() {
    let measure = |mode, unit: &str, exact, factor| Measure {
        mode,
        exact,
        factor,
        unit: unit.into(),
    };
    let measures = vec![measure(1, "A", linear(1.0, 10.0, 0.0), 0.1), measure(2, "", SAME, 1.0)];
    let makes = vec![
        Make::Measured {
            field: 1,
            by: 0,
            measures,
        },
        Make::Day {
            field: 2,
            element: None,
        },
        Make::Text { field: 3 },
    ];
    let tokens = [
        ("struct", 4, 0),
        ("uint", 8, 0),
        ("int", 16, 0),
        ("uint", 32, 0),
        ("list", 9, 4),
        ("uint", 8, 0),
    ];
    let day = 20_240_703_u32.to_le_bytes();
    let row = |mode: u8, rest: &[u8]| [&[mode, 0xFD, 0xFF], &day[..], rest].concat();
    let rows = [row(1, b"V1 \0?"), row(7, b"\x01\xAB"), row(2, b"")];
    let columns = made(&tokens, makes, &[&rows[0], &rows[1], &rows[2], &[2]]);
    let [value, unit, day, letters] = &columns[..] else {
        panic!("four columns");
    };
    assert_eq!(
        (value.validity.as_deref(), unit.validity.as_deref()),
        (Some(&[0b0101][..]), Some(&[0b0101][..]))
    );
    assert_eq!(
        [reals(value)[0].to_bits(), reals(value)[2].to_bits()],
        [-0.3, -3.0].map(f64::to_bits)
    );
    assert_eq!(text(unit), (vec![0, 1, 1, 1, 1], "A"));
    assert_eq!(
        (text(day), day.validity.as_deref()),
        (
            (vec![0, 10, 20, 30, 30], "2024-07-032024-07-032024-07-03"),
            Some(&[0b0111][..])
        )
    );
    assert_eq!(text(letters), (vec![0, 2, 7, 7, 7], "V1\u{1}\\xab"));
}

#[test]
fn numbers_inside_structures_are_scaled() {
    let tokens = [
        ("struct", 1, 0),
        ("list", 3, 2),
        ("struct", 2, 0),
        ("uint", 8, 0),
        ("union", 2, 1),
        ("uint", 7, 0),
        ("bool", 1, 0),
    ];
    let scales = vec![(vec![0], linear(1.0, 4.0, 0.0)), (vec![1, 0], linear(2.0, 1.0, 0.0))];
    let columns = made(&tokens, vec![Make::Shown { field: 0, scales }], &[&[10, 5, 6, 0x80]]);
    let [list, _, first, _, second, flag] = &columns[..] else {
        panic!("a list of structures with a union");
    };
    assert_eq!(list.buffer.as_deref(), Some(&[0, 0, 0, 0, 2, 0, 0, 0][..]));
    assert_eq!(reals(first), [2.5, 1.5]);
    assert_eq!(
        (reals(second)[0].to_bits(), second.validity.as_deref()),
        (10_f64.to_bits(), Some(&[0b01][..]))
    );
    assert_eq!(flag.validity.as_deref(), Some(&[0b10][..]));
}

#[test]
fn a_length_counts_what_stands_behind_it() {
    let cases: [(&[u8], u8); 7] = [
        (b"..\x03ABc", PREFIX),
        (b"..\x02ABc", TAIL),
        (b"..\x03AXc", TAIL),
        (b"..\x02AB", PREFIX),
        (b"..\x01A", TAIL),
        (b"..", TAIL),
        (b"", TAIL),
    ];
    let plan = plan(&[("struct", 2, 0), ("uint", 16, 0), ("list", 250, 8), ("uint", 8, 0)]);
    let (payload, spans) = arena(&cases.map(|(row, _)| row));
    let codes = |length: &Length, fd: [u8; 7]| length.unpack(&plan, &spans, &fd, &payload).0;
    let counted = |at| Length::Counted {
        at,
        header: b"AB".to_vec(),
    };
    assert_eq!(codes(&counted(2), [0; 7]), cases.map(|(_, code)| code));
    assert_eq!(codes(&counted(usize::MAX), [0; 7]), [TAIL; 7]);
    assert_eq!(codes(&counted(2), [1; 7]), [PREFIX; 7]);
    assert_eq!(
        codes(&Length::Never, [0, 1, 0, 1, 1, 0, 0]),
        [TAIL, PREFIX, TAIL, PREFIX, PREFIX, TAIL, TAIL]
    );
}

#[test]
fn a_length_is_believed_where_the_rest_fits() {
    let plan = plan(&[("struct", 1, 0), ("list", 20, 5), ("int", 14, 0)]);
    let limit = Limit {
        field: 0,
        low: -10.0,
        high: 10.0,
        special: vec![77],
    };
    let length = Length::Fits(vec![limit]);
    // 14 bits: low byte, then the six above, left-aligned; four of them fill seven bytes.
    let seven = [1, 0, 4, 0, 0x10, 0, 0];
    let byte = [&[4_u8][..], &seven].concat();
    let rows: [&[u8]; 3] = [&seven, &byte, &byte[..4]];
    let (payload, spans) = arena(&rows);
    let (codes, found) = length.unpack(&plan, &spans, &[0; 3], &payload);
    assert_eq!(codes, [TAIL, BYTE_PREFIX, TAIL]);
    assert_eq!(found.left[1], 0);
}
