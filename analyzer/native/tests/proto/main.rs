//! Protocol Buffers messages and the MCAP records around them, against bytes worked out by hand from the two formats.
#![forbid(unsafe_code)]

mod records;

use _native::proto::{encode, Cells, Field, Mismatch};

fn field(number: u32, cells: Cells<'_>) -> Field<'_> {
    Field {
        number,
        valid: None,
        cells,
    }
}

/// The messages of some columns.
fn messages(fields: &[Field<'_>], rows: usize) -> Vec<Vec<u8>> {
    let (data, ends) = encode(fields, rows).expect("columns that fit");
    let mut start = 0;
    ends.iter()
        .map(|&end| {
            let message = data[start..end as usize].to_vec();
            start = end as usize;
            message
        })
        .collect()
}

fn fails(fields: &[Field<'_>], rows: usize) -> String {
    encode(fields, rows).expect_err("columns that do not fit").to_string()
}

#[test]
fn unsigned_numbers_are_varints_and_zero_is_written() {
    let rows = messages(&[field(1, Cells::U16(&[0, 127, 128, 300]))], 4);
    assert_eq!(rows, [vec![8, 0], vec![8, 0x7F], vec![8, 0x80, 1], vec![8, 0xAC, 2]]);
    let largest = messages(&[field(1, Cells::U64(&[u64::MAX]))], 1);
    assert_eq!(largest[0], [8, 255, 255, 255, 255, 255, 255, 255, 255, 255, 1]);
}

#[test]
fn signed_numbers_are_zigzag() {
    let rows = messages(&[field(2, Cells::I8(&[0, -1, 1, -128]))], 4);
    assert_eq!(rows, [vec![16, 0], vec![16, 1], vec![16, 2], vec![16, 255, 1]]);
    let least = messages(&[field(2, Cells::I64(&[i64::MIN]))], 1);
    assert_eq!(least[0], [16, 255, 255, 255, 255, 255, 255, 255, 255, 255, 1]);
}

#[test]
fn every_width_gives_the_same() {
    let all = [Cells::U8(&[5]), Cells::U16(&[5]), Cells::U32(&[5]), Cells::U64(&[5])];
    assert!(all
        .into_iter()
        .all(|cells| messages(&[field(1, cells)], 1)[0] == [8, 5]));
    let all = [
        Cells::I8(&[-3]),
        Cells::I16(&[-3]),
        Cells::I32(&[-3]),
        Cells::I64(&[-3]),
    ];
    assert!(all
        .into_iter()
        .all(|cells| messages(&[field(1, cells)], 1)[0] == [8, 5]));
}

#[test]
fn floats_and_flags() {
    let rows = messages(&[field(3, Cells::F32(&[1.0, f32::NAN]))], 2);
    assert_eq!(rows[0], [29, 0, 0, 0x80, 0x3F]);
    assert_eq!(rows[1][1..], f32::NAN.to_le_bytes());
    assert_eq!(
        messages(&[field(3, Cells::F64(&[1.0]))], 1)[0],
        [25, 0, 0, 0, 0, 0, 0, 0xF0, 0x3F]
    );
    assert_eq!(messages(&[field(4, Cells::Bool(&[0b10]))], 2), [[32, 0], [32, 1]]);
}

#[test]
fn a_null_cell_is_not_there() {
    let some = Field {
        number: 1,
        valid: Some(&[0b101]),
        cells: Cells::U8(&[7, 8, 9]),
    };
    assert_eq!(messages(&[some], 3), [vec![8, 7], vec![], vec![8, 9]]);
}

#[test]
fn text_and_lists() {
    let text = field(16, Cells::Bytes(&[0, 2, 2], b"hi"));
    assert_eq!(messages(&[text], 2), [vec![0x82, 1, 2, b'h', b'i'], vec![0x82, 1, 0]]);
    let packed = field(1, Cells::List(&[0, 2, 2, 3], Box::new(Cells::I16(&[-1, 1, 2]))));
    assert_eq!(messages(&[packed], 3), [vec![10, 2, 1, 2], vec![], vec![10, 1, 4]]);
    let texts = Cells::Bytes(&[0, 1, 3], b"abc");
    let repeated = field(1, Cells::List(&[0, 2], Box::new(texts)));
    assert_eq!(messages(&[repeated], 1)[0], [10, 1, b'a', 10, 2, b'b', b'c']);
}

#[test]
fn messages_in_messages() {
    let inner = || {
        Cells::Message(vec![
            field(1, Cells::U8(&[1, 2])),
            Field {
                number: 2,
                valid: Some(&[0b10]),
                cells: Cells::Message(vec![]),
            },
        ])
    };
    let rows = messages(&[field(1, inner())], 2);
    assert_eq!(rows, [vec![10, 2, 8, 1], vec![10, 4, 8, 2, 18, 0]]);
    let repeated = field(1, Cells::List(&[0, 2], Box::new(inner())));
    assert_eq!(messages(&[repeated], 1)[0], [10, 2, 8, 1, 10, 4, 8, 2, 18, 0]);
}

#[test]
fn a_long_body_gets_a_long_length() {
    for (count, length) in [(127, vec![127]), (128, vec![0x80, 1]), (20_000, vec![0xA0, 0x9C, 1])] {
        let cells = vec![1_u8; count];
        let offsets = [0, count as i32];
        let list = field(1, Cells::List(&offsets, Box::new(Cells::U8(&cells))));
        let mut expected = vec![10];
        expected.extend(length);
        expected.extend(&cells);
        assert_eq!(messages(&[list], 1)[0], expected);
    }
}

#[test]
fn columns_that_do_not_fit() {
    assert_eq!(fails(&[field(1, Cells::U8(&[1]))], 2), "a column is too short");
    assert_eq!(fails(&[field(1, Cells::Bool(&[1]))], 9), "a column is too short");
    assert_eq!(fails(&[field(0, Cells::U8(&[1]))], 1), "no such field number");
    assert_eq!(fails(&[field(1 << 29, Cells::U8(&[1]))], 1), "no such field number");
    assert_eq!(
        fails(&[field(1, Cells::Bytes(&[0, 3], b"ab"))], 1),
        "offsets go too far"
    );
    assert_eq!(
        fails(&[field(1, Cells::Bytes(&[2, 1], b"ab"))], 1),
        "offsets go backwards"
    );
    assert_eq!(
        fails(&[field(1, Cells::Bytes(&[-1, 1], b"ab"))], 1),
        "offsets go backwards"
    );
    assert_eq!(fails(&[field(1, Cells::Bytes(&[0], b"ab"))], 1), "offsets are missing");
    let short = Cells::List(&[0, 2], Box::new(Cells::U8(&[1])));
    assert_eq!(fails(&[field(1, short)], 1), "a column is too short");
    let nested = Cells::List(&[0, 0], Box::new(Cells::List(&[0], Box::new(Cells::U8(&[])))));
    assert_eq!(fails(&[field(1, nested)], 1), "a list cannot hold lists");
    let null = Field {
        number: 1,
        valid: Some(&[]),
        cells: Cells::U8(&[1]),
    };
    assert_eq!(fails(&[null], 1), "a bitmap is too short");
    let inner = Cells::Message(vec![field(1, Cells::U8(&[]))]);
    assert_eq!(fails(&[field(1, inner)], 1), "a column is too short");
}

#[test]
fn no_rows_and_no_columns() {
    assert_eq!(encode(&[], 0), Ok::<_, Mismatch>((vec![], vec![])));
    assert_eq!(messages(&[], 2), [vec![], Vec::<u8>::new()]);
    assert_eq!(messages(&[field(1, Cells::U8(&[]))], 0), Vec::<Vec<u8>>::new());
}
