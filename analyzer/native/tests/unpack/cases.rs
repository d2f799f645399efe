//! Scalars, padding, short rows and unions, computed by hand.

use crate::table::{decode, decode_one, Row, Value};
use Value::{Bool, Double, Int, Null, Single, Struct, Uint};

const ESC_STATUS: [(&str, u32, u32); 8] = [
    ("struct", 7, 0),
    ("uint", 32, 0),
    ("float", 16, 0),
    ("float", 16, 0),
    ("float", 16, 0),
    ("int", 18, 0),
    ("uint", 7, 0),
    ("uint", 5, 0),
];

/// 0x01020304, 1.0, -2.0, 25.0, rpm -1, 100 %, index 19; the last two bytes are 11|110010 and 0|10011|00.
const ESC_WIRE: [u8; 14] = [4, 3, 2, 1, 0x00, 0x3C, 0x00, 0xC0, 0x40, 0x4E, 0xFF, 0xFF, 0xF2, 0x4C];

fn esc_cells() -> Vec<Value> {
    let single = |value: f32| Single(value.to_bits());
    vec![
        Uint(0x0102_0304),
        single(1.0),
        single(-2.0),
        single(25.0),
        Int(-1),
        Uint(100),
        Uint(19),
    ]
}

#[test]
fn fields_lie_bit_by_bit_without_alignment() {
    let row = decode_one(&ESC_STATUS, 0, &ESC_WIRE);
    assert_eq!(
        row,
        Row {
            value: Struct(esc_cells()),
            left: 2,
            dirty: 0
        }
    );
}

#[test]
fn padding_behind_the_last_field_is_looked_at() {
    let mut wire = ESC_WIRE;
    wire[13] |= 1;
    let row = decode_one(&ESC_STATUS, 0, &wire);
    assert_eq!(
        row,
        Row {
            value: Struct(esc_cells()),
            left: 2,
            dirty: 1
        }
    );
}

#[test]
fn a_row_keeps_what_it_had() {
    let rows = decode(&ESC_STATUS, 0, &[&ESC_WIRE, &ESC_WIRE[..11], &[], &ESC_WIRE]);
    let mut short = esc_cells();
    short[4..].fill(Null);
    assert_eq!(
        rows[0],
        Row {
            value: Struct(esc_cells()),
            left: 2,
            dirty: 0
        }
    );
    assert_eq!(
        rows[1],
        Row {
            value: Struct(short),
            left: 88 - 110,
            dirty: 0
        }
    );
    assert_eq!(
        rows[2],
        Row {
            value: Struct(vec![Null; 7]),
            left: -110,
            dirty: 0
        }
    );
    assert_eq!(rows[3], rows[0]);
}

#[test]
fn integers_of_every_kind_of_width() {
    let plan = [
        ("struct", 4, 0),
        ("uint", 3, 0),
        ("int", 64, 0),
        ("uint", 9, 0),
        ("int", 4, 0),
    ];
    // 3 bits 0b101; then -2 as bytes FE FF FF FF FF FF FF FF; 9 bits: low byte 0x34, high bit 1; 4 bits 0b1000.
    let stream = "101".to_owned() + "11111110" + &"11111111".repeat(7) + "00110100" + "1" + "1000";
    let wire: Vec<u8> = stream
        .as_bytes()
        .chunks(8)
        .map(|bits| bits.iter().fold(0, |sum, b| sum << 1 | b & 1))
        .collect();
    let row = decode_one(&plan, 0, &wire);
    assert_eq!(
        row,
        Row {
            value: Struct(vec![Uint(5), Int(-2), Uint(0x134), Int(-8)]),
            left: 0,
            dirty: 0
        }
    );
}

#[test]
fn floats_and_bools() {
    let plan = [
        ("struct", 4, 0),
        ("bool", 1, 0),
        ("bool", 1, 0),
        ("void", 6, 0),
        ("float", 64, 0),
    ];
    let wire = [&[0b0100_0000][..], &(-0.1_f64).to_le_bytes()].concat();
    let row = decode_one(&plan, 0, &wire);
    assert_eq!(
        row.value,
        Struct(vec![Bool(false), Bool(true), Double((-0.1_f64).to_bits())])
    );
    let wire = [&1.5_f32.to_le_bytes()[..], &[0x80]].concat();
    let row = decode_one(&[("struct", 2, 0), ("float", 32, 0), ("bool", 1, 0)], 0, &wire);
    assert_eq!(row.value, Struct(vec![Single(1.5_f32.to_bits()), Bool(true)]));
}

#[test]
fn voids_have_no_column_but_are_looked_at() {
    let plan = [("struct", 3, 0), ("uint", 4, 0), ("void", 8, 0), ("uint", 4, 0)];
    let rows = decode(&plan, 0, &[&[0xA0, 0x0B], &[0xA0, 0x1B], &[0xA1]]);
    assert_eq!(
        rows[0],
        Row {
            value: Struct(vec![Uint(10), Uint(11)]),
            left: 0,
            dirty: 0
        }
    );
    assert_eq!(
        rows[1],
        Row {
            value: Struct(vec![Uint(10), Uint(11)]),
            left: 0,
            dirty: 1
        }
    );
    assert_eq!(
        rows[2],
        Row {
            value: Struct(vec![Uint(10), Null]),
            left: -8,
            dirty: 1
        }
    );
}

#[test]
fn an_empty_type_has_a_length_only() {
    assert_eq!(
        decode(&[("struct", 0, 0)], 0, &[&[], &[0, 1]]),
        [
            Row {
                value: Struct(vec![]),
                left: 0,
                dirty: 0
            },
            Row {
                value: Struct(vec![]),
                left: 16,
                dirty: 1
            },
        ]
    );
    assert_eq!(decode(&ESC_STATUS, 0, &[]), []);
}

/// Tag of 2 bits: nothing, int62, bytes.
const UNION: [(&str, u32, u32); 6] = [
    ("struct", 1, 0),
    ("union", 3, 2),
    ("struct", 0, 0),
    ("int", 62, 0),
    ("list", 8, 4),
    ("uint", 8, 0),
];

#[test]
fn only_the_active_member_of_a_union_is_there() {
    let number = [0b0100_0000, 0x40, 0, 0, 0, 0, 0, 0b0000_0000];
    let bytes = [0b1001_0000, 0b1000_0000];
    let rows = decode(&UNION, 0, &[&[0], &number, &bytes, &[0b1111_1111, 9]]);
    let union = |members: [Value; 3]| Struct(vec![Struct(members.to_vec())]);
    assert_eq!(
        rows[0],
        Row {
            value: union([Struct(vec![]), Null, Null]),
            left: 6,
            dirty: 0
        }
    );
    assert_eq!(
        rows[1],
        Row {
            value: union([Null, Int(1), Null]),
            left: 0,
            dirty: 0
        }
    );
    // The member at the tail of the type loses its length field, too.
    assert_eq!(
        rows[2],
        Row {
            value: union([Null, Null, Value::List(vec![Uint(0x42)])]),
            left: 6,
            dirty: 0
        }
    );
    assert_eq!(
        rows[3],
        Row {
            value: union([Null, Null, Null]),
            left: 14,
            dirty: 3
        }
    );
    assert_eq!(
        decode_one(&UNION, 0, &[]),
        Row {
            value: Struct(vec![Null]),
            left: -2,
            dirty: 0
        }
    );
}

#[test]
fn behind_a_tag_without_member_nothing_has_a_place() {
    let plan = [
        ("struct", 3, 0),
        ("union", 3, 2),
        ("bool", 1, 0),
        ("bool", 1, 0),
        ("bool", 1, 0),
        ("uint", 5, 0),
        ("uint", 8, 0),
    ];
    let row = decode_one(&plan, 0, &[0xC0, 0]);
    assert_eq!(
        row,
        Row {
            value: Struct(vec![Struct(vec![Null; 3]), Null, Null]),
            left: 14,
            dirty: 2
        }
    );
}

#[test]
fn a_union_can_be_the_whole_type() {
    let plan = [("union", 2, 1), ("uint", 7, 0), ("bool", 1, 0)];
    let rows = decode(&plan, 1, &[&[0x85], &[0x05], &[]]);
    assert_eq!(
        rows[0],
        Row {
            value: Struct(vec![Null, Bool(false)]),
            left: 6,
            dirty: 1
        }
    );
    assert_eq!(
        rows[1],
        Row {
            value: Struct(vec![Uint(5), Null]),
            left: 0,
            dirty: 0
        }
    );
    assert_eq!(
        rows[2],
        Row {
            value: Null,
            left: -2,
            dirty: 0
        }
    );
}
