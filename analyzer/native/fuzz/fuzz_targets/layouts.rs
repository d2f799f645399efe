//! The laws of unpacking: columns agree with each other, and rows read together are the rows read one by one.

use _native::bits::Span;
use _native::plan::{Kind, Node, Plan, Token};
use _native::unpack::column::{Column, Data};
use _native::unpack::{unpack, Rows, PREFIX, TAIL};

use crate::input::Input;
use crate::made;

const MAX_TOKENS: usize = 40;
const MAX_ROWS: usize = 64;
const WORDS: [&str; 9] = [
    "uint", "int", "float", "bool", "void", "array", "list", "struct", "union",
];

/// Layouts with everything that makes a place depend on the data: tail arrays, unions, arrays in arrays.
const FIXED: [&[(&str, u32, u32)]; 6] = [
    &[
        ("struct", 4, 0),
        ("uint", 32, 0),
        ("float", 16, 0),
        ("int", 18, 0),
        ("uint", 5, 0),
    ],
    &[("struct", 1, 0), ("list", 20, 5), ("int", 14, 0)],
    &[
        ("struct", 3, 0),
        ("bool", 1, 0),
        ("void", 7, 0),
        ("list", 255, 8),
        ("uint", 8, 0),
    ],
    &[
        ("struct", 2, 0),
        ("union", 3, 2),
        ("struct", 0, 0),
        ("float", 64, 0),
        ("array", 3, 0),
        ("uint", 11, 0),
        ("list", 9, 4),
        ("struct", 2, 0),
        ("uint", 3, 0),
        ("list", 7, 3),
        ("uint", 16, 0),
    ],
    &[
        ("union", 2, 1),
        ("list", 100, 7),
        ("bool", 1, 0),
        ("struct", 1, 0),
        ("list", 300, 9),
        ("int", 33, 0),
    ],
    &[
        ("struct", 2, 0),
        ("array", 2, 0),
        ("list", 3, 2),
        ("uint", 64, 0),
        ("list", 4, 3),
        ("array", 2, 0),
        ("bool", 1, 0),
    ],
];

/// Some layouts over the rows, of which `prefixed` says which have length fields.
pub fn check_fixed(spans: &[Span], prefixed: &[u8], payload: &[u8]) {
    for tokens in FIXED {
        let tokens: Vec<Token> = tokens.iter().map(|(word, a, b)| ((*word).to_owned(), *a, *b)).collect();
        let plan = Plan::parse(&tokens).expect("a layout that is right");
        check(&plan, spans, prefixed, payload);
    }
}

/// A layout from the input, if it is one, over rows from the input.
pub fn check_any(input: &mut Input<'_>) {
    let tokens = usize::from(input.byte()) % MAX_TOKENS;
    let tokens: Vec<Token> = (0..tokens).map(|_| token(input)).collect();
    let (mut spans, mut layouts, mut at) = (vec![], vec![], 0);
    for _ in 0..usize::from(input.byte()) % MAX_ROWS {
        let row = input.byte();
        let end = at + usize::from(row >> 2);
        spans.push(Span { start: at, end });
        layouts.push(row % 4);
        at = end;
    }
    if let Ok(plan) = Plan::parse(&tokens) {
        check(&plan, &spans, &layouts, input.0);
        check(&plan, &spans, &[], input.0);
    }
}

/// One byte picks the word and a small number, more bits give large ones.
fn token(input: &mut Input<'_>) -> Token {
    let (byte, number) = (input.byte(), u32::from(input.byte()));
    let word = WORDS[usize::from(byte) % WORDS.len()];
    let number = if number == 255 {
        u32::MAX >> (input.byte() % 32)
    } else {
        number
    };
    let extra = match word {
        "list" => 32 - number.leading_zeros() + u32::from(byte >> 7),
        "union" => 32 - number.saturating_sub(1).leading_zeros(),
        _ => 0,
    };
    (word.to_owned(), if word == "bool" { 1 } else { number }, extra)
}

fn check(plan: &Plan, spans: &[Span], layouts: &[u8], payload: &[u8]) {
    let together = unpack(plan, Rows { spans, layouts }, payload);
    assert_eq!((together.left.len(), together.dirty.len()), (spans.len(), spans.len()));
    assert_column(&plan.root, &together.root, spans.len());
    for (span, left) in spans.iter().zip(&together.left) {
        let end = span.end.min(payload.len());
        let bits = 8 * (end - span.start.min(end)) as u64;
        assert!(i64::from(*left) <= bits as i64);
        if plan.root.fixed && plan.root.min_bits < 1 << 30 {
            assert_eq!(i64::from(*left), bits as i64 - plan.root.min_bits as i64);
        }
    }
    // A row without bits and with length fields closes every short way.
    let odd = Span { start: 0, end: 0 };
    let mut codes: Vec<u8> = (0..spans.len())
        .map(|row| layouts.get(row).copied().unwrap_or(TAIL))
        .collect();
    codes.push(PREFIX);
    let (spans, rows) = ([spans, &[odd]].concat(), spans.len());
    let one_by_one = Rows {
        spans: &spans,
        layouts: &codes,
    };
    let mut apart = unpack(plan, one_by_one, payload);
    apart.root.truncate(rows);
    assert_eq!(apart.left[..rows], together.left);
    assert_eq!(apart.dirty[..rows], together.dirty);
    assert_eq!(apart.root.flatten(), together.root.flatten());
    made::check(plan, &spans[..rows], layouts, payload);
}

/// The column and those below it hold as many cells as their parents say.
fn assert_column(node: &Node, column: &Column, len: usize) {
    match (&node.kind, &column.data) {
        (Kind::Void { .. }, Data::Void) => assert_eq!(column.len(), 0),
        (Kind::Bool, Data::Bool(_)) => assert_eq!(column.len(), len),
        (Kind::Scalar { .. }, Data::Scalar { width, values }) => {
            assert_eq!((column.len(), values.len()), (len, len * width));
        }
        (Kind::Array { element, count: max } | Kind::List { element, max, .. }, Data::List { offsets, child }) => {
            assert_eq!((column.len(), offsets.len(), offsets[0]), (len, len + 1, 0));
            assert!(offsets
                .windows(2)
                .all(|ends| ends[0] <= ends[1] && ends[1].abs_diff(ends[0]) <= *max));
            assert_column(element, child, offsets[len].unsigned_abs() as usize);
        }
        (Kind::Struct(nodes) | Kind::Union { members: nodes, .. }, Data::Struct(children)) => {
            assert_eq!((column.len(), children.len()), (len, nodes.len()));
            nodes
                .iter()
                .zip(children)
                .for_each(|(node, child)| assert_column(node, child, len));
        }
        _ => panic!("a column that is not of its node"),
    }
}
