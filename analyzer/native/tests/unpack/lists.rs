//! Arrays and lists in the three layouts, computed by hand.

use crate::table::{decode, decode_one, tokens, Row, Value};
use _native::bits::spans;
use _native::plan::Plan;
use _native::unpack::{unpack, Rows};
use Value::{Bool, Int, List, Null, Struct, Uint};

const RAW_COMMAND: [(&str, u32, u32); 3] = [("struct", 1, 0), ("list", 20, 5), ("int", 14, 0)];
/// The worked example of section 4.4.1: four times 1000.
const FOUR_TIMES_1000: [u8; 7] = [0xE8, 0x0F, 0xA0, 0x3E, 0x80, 0xFA, 0x03];
const BYTES: [(&str, u32, u32); 4] = [("struct", 2, 0), ("uint", 8, 0), ("list", 5, 3), ("uint", 8, 0)];

fn row(cells: impl Into<Vec<Value>>, left: i32, dirty: u8) -> Row {
    Row {
        value: Struct(cells.into()),
        left,
        dirty,
    }
}

fn uints(values: &[u64]) -> Value {
    List(values.iter().map(|&v| Uint(v)).collect())
}

#[test]
fn throttle_example_of_the_document() {
    assert_eq!(
        decode_one(&RAW_COMMAND, 0, &FOUR_TIMES_1000),
        row([List(vec![Int(1000); 4])], 0, 0)
    );
}

#[test]
fn a_tail_list_fills_the_row_and_leaves_what_is_less_than_an_element() {
    let one = decode(
        &RAW_COMMAND,
        0,
        &[&FOUR_TIMES_1000[..2], &[], &[0xFF, 0xFC], &[0, 0x21, 0], &[7]],
    );
    assert_eq!(one[0], row([List(vec![Int(0x3E8)])], 2, 1));
    assert_eq!(one[1], row([List(vec![])], 0, 0));
    assert_eq!(one[2], row([List(vec![Int(-1)])], 2, 0));
    assert_eq!(one[3], row([List(vec![Int(0x0800)])], 10, 1));
    assert_eq!(one[4], row([List(vec![])], 8, 1));
}

#[test]
fn what_a_tail_list_cannot_hold_is_left() {
    let zeros = decode_one(&RAW_COMMAND, 0, &[0; 37]);
    assert_eq!(zeros, row([List(vec![Int(0); 20])], 37 * 8 - 280, 0));
    assert_eq!(
        decode_one(&BYTES, 0, &[1, 2, 3, 4, 5, 6, 7]),
        row([Uint(1), uints(&[2, 3, 4, 5, 6])], 8, 1)
    );
}

#[test]
fn a_tail_list_behind_missing_fields_is_null() {
    let rows = decode(&BYTES, 0, &[&[], &[9], &[9, 8]]);
    assert_eq!(
        rows,
        [
            row([Null, Null], -8, 0),
            row([Uint(9), List(vec![])], 0, 0),
            row([Uint(9), uints(&[8])], 0, 0)
        ]
    );
}

#[test]
fn layouts_differ_in_the_length_of_the_tail_list() {
    // A length of 3 bits, 0b010: the bytes that follow are shifted by 3.
    let dsdl = [9, 0b0100_0000, 0b0010_0000, 0b0100_0000];
    assert_eq!(decode_one(&BYTES, 1, &dsdl), row([Uint(9), uints(&[1, 2])], 5, 0));
    assert_eq!(
        decode_one(&BYTES, 2, &[9, 2, 1, 2]),
        row([Uint(9), uints(&[1, 2])], 0, 0)
    );
    assert_eq!(
        decode_one(&BYTES, 0, &[9, 2, 1, 2]),
        row([Uint(9), uints(&[2, 1, 2])], 0, 0)
    );
}

#[test]
fn each_row_has_its_own_layout() {
    let plan = Plan::parse(&tokens(&BYTES)).unwrap();
    let arena = [9, 2, 1, 2];
    let offsets = spans(&[0, 4], Some(&[0, 0, 7]));
    let out = unpack(
        &plan,
        Rows {
            spans: &offsets,
            layouts: &[2],
        },
        &arena,
    );
    assert_eq!(out.left, [0, 0, -8]);
    let flat = out.root.flatten();
    assert_eq!(flat.iter().map(|f| f.len).collect::<Vec<_>>(), [3, 3, 3, 5]);
    assert_eq!(flat[0].buffer, None);
    assert_eq!(
        (flat[1].buffer.as_deref(), flat[1].validity.as_deref()),
        (Some(&[9, 9, 0][..]), Some(&[3][..]))
    );
    assert_eq!(
        flat[2].buffer.as_deref().unwrap(),
        [0, 0, 0, 0, 2, 0, 0, 0, 5, 0, 0, 0, 5, 0, 0, 0]
    );
    assert_eq!(flat[3].buffer.as_deref(), Some(&[1, 2, 2, 1, 2][..]));
}

#[test]
fn a_length_above_the_data_counts_what_is_missing() {
    assert_eq!(
        decode_one(&BYTES, 2, &[9, 4, 1, 2]),
        row([Uint(9), uints(&[1, 2])], -16, 0)
    );
    assert_eq!(decode_one(&BYTES, 2, &[9]), row([Uint(9), Null], -8, 0));
    assert_eq!(decode_one(&BYTES, 1, &[9]), row([Uint(9), Null], -3, 0));
}

#[test]
fn a_length_above_the_maximum_keeps_the_maximum_and_ends_the_reading() {
    assert_eq!(
        decode_one(&BYTES, 2, &[9, 6, 1, 2, 3, 4, 5, 6]),
        row([Uint(9), uints(&[1, 2, 3, 4, 5])], 8, 1)
    );
    // Exactly the maximum is there: then two of seven are missing.
    assert_eq!(
        decode_one(&BYTES, 2, &[9, 7, 1, 2, 3, 4, 5]),
        row([Uint(9), uints(&[1, 2, 3, 4, 5])], -16, 0)
    );
    let plan = [("struct", 2, 0), ("list", 2, 8), ("uint", 8, 0), ("uint", 8, 0)];
    assert_eq!(
        decode_one(&plan, 0, &[3, 1, 2, 3, 0]),
        row([uints(&[1, 2]), Null], 16, 1)
    );
}

#[test]
fn small_elements_keep_their_length_at_the_tail() {
    let plan = [("struct", 1, 0), ("list", 7, 3), ("bool", 1, 0)];
    for layout in 0..3 {
        let bits = List(vec![Bool(true), Bool(false), Bool(true)]);
        assert_eq!(
            decode_one(&plan, layout, &[0b0111_0100]),
            row([bits], 2, 0),
            "layout {layout}"
        );
    }
}

#[test]
fn the_tail_is_that_of_the_last_field_of_the_last_struct() {
    let inner = [
        ("struct", 2, 0),
        ("list", 3, 8),
        ("uint", 8, 0),
        ("list", 3, 8),
        ("uint", 8, 0),
    ];
    let plan = [&[("struct", 2, 0)], &inner[..], &inner[..]].concat();
    // Two lists of the first struct, the first of the second: with length. The last: without.
    let pair = |a: &[u64], b: &[u64]| Struct(vec![uints(a), uints(b)]);
    let wire = [1, 10, 0, 2, 20, 21, 30];
    assert_eq!(
        decode_one(&plan, 0, &wire),
        row([pair(&[10], &[]), pair(&[20, 21], &[30])], 0, 0)
    );
    let wire = [1, 10, 0, 2, 20, 21, 1, 30];
    assert_eq!(
        decode_one(&plan, 1, &wire),
        row([pair(&[10], &[]), pair(&[20, 21], &[30])], 0, 0)
    );
}

#[test]
fn lists_inside_a_tail_list_keep_their_length() {
    let plan = [
        ("struct", 1, 0),
        ("list", 3, 2),
        ("struct", 2, 0),
        ("uint", 8, 0),
        ("list", 3, 8),
        ("uint", 8, 0),
    ];
    let item = |number, list: &[u64]| Struct(vec![Uint(number), uints(list)]);
    // The third element says 3 and has 1: it is none, its 3 bytes are left.
    let wire = [1, 0, 2, 2, 20, 21, 3, 3, 30];
    assert_eq!(
        decode_one(&plan, 0, &wire),
        row([List(vec![item(1, &[]), item(2, &[20, 21])])], 24, 1)
    );
    // The whole byte is for the outer length only.
    let mut short = plan;
    short[4] = ("list", 3, 2);
    let wire = [1, 7, 0b0101_0000, 0b1000_0000];
    assert_eq!(decode_one(&short, 2, &wire), row([List(vec![item(7, &[0x42])])], 6, 0));
    // Two elements, all of it shifted by the 2 bits of the outer length.
    let shifted = [0b1000_0000, 0b0100_0000, 0, 0b1000_0000, 0b0100_0101, 0];
    assert_eq!(
        decode_one(&plan, 1, &shifted),
        row([List(vec![item(1, &[]), item(2, &[20])])], 6, 0)
    );
}

#[test]
fn an_element_that_is_none_still_tells_of_its_tag() {
    let union = [("union", 3, 2), ("bool", 1, 0), ("bool", 1, 0), ("bool", 1, 0)];
    let plan = [
        &[("struct", 1, 0), ("list", 3, 2), ("struct", 2, 0)],
        &union[..],
        &[("uint", 8, 0)],
    ]
    .concat();
    // Elements of 11 bits, the second with tag 3.
    let item = Struct(vec![Struct(vec![Null, Bool(true), Null]), Uint(1)]);
    let wire = [0b0110_0000, 0b0011_1000, 0];
    assert_eq!(decode_one(&plan, 0, &wire), row([List(vec![item])], 2 + 11, 3));
}

#[test]
fn an_element_of_less_than_a_byte_passes_the_tail_on() {
    // Elements of 4 bits and a list: below 8 bits, so the outer length stays and the last inner one goes.
    let plan = [
        ("struct", 1, 0),
        ("list", 3, 8),
        ("struct", 2, 0),
        ("uint", 4, 0),
        ("list", 3, 4),
        ("uint", 8, 0),
    ];
    let item = |number, list: &[u64]| Struct(vec![Uint(number), uints(list)]);
    let wire = [2, 0x11, 0xAA, 0x2B, 0xBC, 0xC0];
    assert_eq!(
        decode_one(&plan, 0, &wire),
        row([List(vec![item(1, &[0xAA]), item(2, &[0xBB, 0xCC])])], 4, 0)
    );
    let wire = [2, 0x11, 0xAA, 0x22, 0xBB, 0xCC];
    assert_eq!(
        decode_one(&plan, 1, &wire),
        row([List(vec![item(1, &[0xAA]), item(2, &[0xBB, 0xCC])])], 0, 0)
    );
}

#[test]
fn arrays_keep_whole_elements_or_are_null() {
    let plan = [("struct", 2, 0), ("array", 3, 0), ("uint", 16, 0), ("uint", 8, 0)];
    let rows = decode(&plan, 0, &[&[1, 0, 2, 0, 3, 0, 9], &[1, 0, 2, 0, 3], &[1]]);
    assert_eq!(
        rows,
        [
            row([uints(&[1, 2, 3]), Uint(9)], 0, 0),
            row([uints(&[1, 2]), Null], -16, 0),
            row([Null, Null], -48, 0)
        ]
    );
}

#[test]
fn the_longest_bounds_cost_no_more_than_the_data() {
    let plan = [
        ("struct", 2, 0),
        ("array", u32::MAX, 0),
        ("array", u32::MAX, 0),
        ("uint", 64, 0),
        ("bool", 1, 0),
    ];
    let one = decode_one(&plan, 0, &[1, 0, 0, 0, 0, 0, 0, 0, 5]);
    // A part of the first inner array is no whole element.
    assert_eq!(one, row([Null, Null], -i32::MAX, 0));
    let plan = [("struct", 1, 0), ("list", u32::MAX, 32), ("bool", 1, 0)];
    assert_eq!(decode_one(&plan, 1, &[0xFF, 0xFF, 0xFF, 0xFF, 0x80]).left, -i32::MAX);
}
