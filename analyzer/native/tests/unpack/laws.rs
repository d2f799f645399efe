//! Laws over random plans and payloads.

use crate::oracle;
use crate::random::Random;
use crate::table::{rows, Row, Value};
use _native::bits::Span;
use _native::plan::{Plan, Token};
use _native::unpack::{unpack, Rows};

const PLANS: usize = 4000;

/// Rows of any length in any order, some of them twice, with and without room behind the last.
fn arena(random: &mut Random) -> (Vec<Span>, Vec<u8>, Vec<u8>) {
    let long = random.below(3) == 0;
    let (mut spans, mut arena) = (vec![], vec![]);
    for _ in 0..random.below(12) {
        let start = arena.len();
        let len = if long { 64 + random.below(8) } else { random.below(40) };
        arena.extend(random.bytes(len));
        let span = Span {
            start,
            end: arena.len(),
        };
        let to = random.below(spans.len() as u32 + 1) as usize;
        spans.insert(to, span);
        if random.below(6) == 0 {
            spans.push(span);
        }
    }
    let uniform = random.below(4);
    let layouts = spans
        .iter()
        .map(|_| if uniform == 3 { random.below(4) } else { uniform } as u8)
        .collect();
    let room = 16 * random.below(2);
    arena.extend(random.bytes(room));
    (spans, layouts, arena)
}

#[test]
fn every_row_is_what_reading_bit_by_bit_gives() {
    let mut random = Random(0x7A11_B17E);
    let (mut whole, mut short, mut over, mut nulls, mut flags) = (0, 0, 0, 0, [0; 4]);
    for _ in 0..PLANS {
        let tokens = random.plan();
        let (spans, layouts, arena) = arena(&mut random);
        let tree = oracle::tree(&mut tokens.iter().cloned());
        let read = |(span, &layout): (&Span, &u8)| {
            // An unknown layout code is read as that of the type.
            oracle::read(&tree, if layout > 2 { 1 } else { layout }, &arena[span.start..span.end])
        };
        let expected: Vec<Row> = spans.iter().zip(&layouts).map(read).collect();
        for row in &expected {
            match row.left {
                0 => whole += 1,
                1.. => over += 1,
                _ => short += 1,
            }
            flags[usize::from(row.dirty)] += 1;
            nulls += usize::from(matches!(&row.value, Value::Struct(cells) if cells.contains(&Value::Null)));
        }
        assert_eq!(
            rows(&tokens, &spans, &layouts, &arena),
            expected,
            "{tokens:?} {layouts:?} {spans:?} {arena:02X?}"
        );
    }
    // The generator must reach all of it.
    for seen in [whole, short, over, nulls, flags[0], flags[1], flags[2] + flags[3]] {
        assert!(seen > 30, "{whole} {short} {over} {nulls} {flags:?}");
    }
}

/// Numbers that are wrong in every way, kinds that do not fit together, plans cut off.
fn damaged(random: &mut Random) -> Vec<Token> {
    const ODD: [u32; 10] = [0, 1, 7, 63, 64, 65, 255, 65_536, u32::MAX - 1, u32::MAX];
    const WORDS: [&str; 9] = [
        "struct", "union", "uint", "int", "float", "bool", "void", "array", "list",
    ];
    let mut tokens = random.plan();
    for _ in 0..=random.below(3) {
        let at = random.below(tokens.len() as u32) as usize;
        let odd = ODD[random.below(10) as usize];
        match random.below(5) {
            0 => tokens[at].0 = WORDS[random.below(9) as usize].into(),
            1 | 2 => tokens[at].1 = odd,
            3 => tokens[at].2 = odd,
            _ => tokens.truncate(at.max(1)),
        }
    }
    tokens
}

#[test]
fn no_plan_and_no_payload_makes_it_panic() {
    let mut random = Random(42);
    let (mut good, mut bad) = (0, 0);
    for _ in 0..PLANS {
        let tokens = damaged(&mut random);
        let Ok(plan) = Plan::parse(&tokens) else {
            bad += 1;
            continue;
        };
        good += 1;
        let (mut spans, layouts, arena) = arena(&mut random);
        // Spans that reach behind the arena, and that end before they start.
        for span in &mut spans {
            match random.below(8) {
                0 => span.end += 100,
                1 => std::mem::swap(&mut span.start, &mut span.end),
                2 => {
                    *span = Span {
                        start: usize::MAX,
                        end: usize::MAX,
                    }
                }
                _ => {}
            }
        }
        let layouts = &layouts[..layouts.len() / 2];
        let out = unpack(&plan, Rows { spans: &spans, layouts }, &arena);
        assert_eq!(
            (out.root.len(), out.left.len(), out.dirty.len()),
            (spans.len(), spans.len(), spans.len())
        );
    }
    assert!(good > PLANS / 20 && bad > PLANS / 20, "{good} {bad}");
}
