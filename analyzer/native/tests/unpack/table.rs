//! Flat buffers back to values, with nothing but the plan's tokens: what a reader of the buffers must do.

use _native::bits::{spans, Span};
use _native::plan::{Plan, Token};
use _native::unpack::column::Flat;
use _native::unpack::{unpack, Rows};

#[derive(Clone, Debug, PartialEq)]
pub enum Value {
    Null,
    Bool(bool),
    Uint(u64),
    Int(i64),
    /// Bits of a float32.
    Single(u32),
    /// Bits of a float64.
    Double(u64),
    List(Vec<Value>),
    Struct(Vec<Value>),
}

#[derive(Clone, Debug, PartialEq)]
pub struct Row {
    pub value: Value,
    pub left: i32,
    pub dirty: u8,
}

pub fn tokens(list: &[(&str, u32, u32)]) -> Vec<Token> {
    list.iter()
        .map(|&(word, number, extra)| (word.into(), number, extra))
        .collect()
}

/// One payload a row, one after the other.
pub fn decode(plan: &[(&str, u32, u32)], layout: u8, payloads: &[&[u8]]) -> Vec<Row> {
    let mut offsets = vec![0];
    let mut arena = vec![];
    for payload in payloads {
        arena.extend_from_slice(payload);
        offsets.push(i32::try_from(arena.len()).unwrap());
    }
    rows(
        &tokens(plan),
        &spans(&offsets, None),
        &vec![layout; payloads.len()],
        &arena,
    )
}

pub fn decode_one(plan: &[(&str, u32, u32)], layout: u8, payload: &[u8]) -> Row {
    decode(plan, layout, &[payload]).remove(0)
}

pub fn rows(tokens: &[Token], spans: &[Span], layouts: &[u8], arena: &[u8]) -> Vec<Row> {
    let plan = Plan::parse(tokens).unwrap();
    let out = unpack(&plan, Rows { spans, layouts }, arena);
    assert_eq!(
        (out.left.len(), out.dirty.len(), out.root.len()),
        (spans.len(), spans.len(), spans.len())
    );
    let flat = out.root.flatten();
    let (mut tokens, mut buffers) = (tokens.iter(), flat.iter());
    let values = column(&mut tokens, &mut buffers).unwrap_or_default();
    assert!(buffers.next().is_none(), "a buffer too many");
    let about = out.left.iter().zip(&out.dirty);
    values
        .into_iter()
        .zip(about)
        .map(|(value, (&left, &dirty))| Row { value, left, dirty })
        .collect()
}

/// The cells of the next node; none for a void.
fn column<'a>(
    tokens: &mut impl Iterator<Item = &'a Token>,
    buffers: &mut impl Iterator<Item = &'a Flat>,
) -> Option<Vec<Value>> {
    let (word, number, _) = tokens.next().unwrap();
    if word == "void" {
        return None;
    }
    let flat = buffers.next().unwrap();
    let cells: Vec<Value> = match word.as_str() {
        "struct" | "union" => {
            assert!(flat.buffer.is_none());
            let children: Vec<_> = (0..*number).filter_map(|_| column(tokens, buffers)).collect();
            assert!(children.iter().all(|c| c.len() == flat.len));
            (0..flat.len)
                .map(|row| Value::Struct(children.iter().map(|c| c[row].clone()).collect()))
                .collect()
        }
        "array" | "list" => {
            let child = column(tokens, buffers).unwrap();
            let offsets: Vec<usize> = chunks(flat, 4).map(|o| usize::try_from(o).unwrap()).collect();
            assert_eq!(
                (offsets.len(), offsets[0], offsets[flat.len]),
                (flat.len + 1, 0, child.len())
            );
            offsets
                .windows(2)
                .map(|ends| Value::List(child[ends[0]..ends[1]].to_vec()))
                .collect()
        }
        "bool" => {
            let bits = flat.buffer.as_ref().unwrap();
            assert_eq!(bits.len(), flat.len.div_ceil(8));
            (0..flat.len).map(|row| Value::Bool(bit(bits, row))).collect()
        }
        "float" if *number == 64 => chunks(flat, 8).map(Value::Double).collect(),
        "float" => chunks(flat, 4)
            .map(|raw| Value::Single(u32::try_from(raw).unwrap()))
            .collect(),
        _ => {
            let width = [1, 2, 4, 8].into_iter().find(|w| number.div_ceil(8) <= *w).unwrap();
            let unused = 64 - 8 * width;
            let int = |raw: u64| Value::Int((raw << unused).cast_signed() >> unused);
            chunks(flat, width as usize)
                .map(|raw| if word == "int" { int(raw) } else { Value::Uint(raw) })
                .collect()
        }
    };
    assert_eq!(cells.len(), flat.len);
    let Some(validity) = &flat.validity else {
        return Some(cells);
    };
    assert_eq!(validity.len(), flat.len.div_ceil(8));
    assert!((0..flat.len).any(|row| !bit(validity, row)), "validity without a null");
    Some(
        cells
            .into_iter()
            .enumerate()
            .map(|(row, cell)| if bit(validity, row) { cell } else { Value::Null })
            .collect(),
    )
}

fn bit(bitmap: &[u8], at: usize) -> bool {
    bitmap[at / 8] >> (at % 8) & 1 == 1
}

fn chunks(flat: &Flat, width: usize) -> impl Iterator<Item = u64> + '_ {
    let cells = flat.buffer.as_ref().unwrap().chunks(width);
    cells.map(|cell| cell.iter().rev().fold(0, |sum, &byte| sum << 8 | u64::from(byte)))
}
