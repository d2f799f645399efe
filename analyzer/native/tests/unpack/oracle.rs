//! The same reading, written to be obviously right: a queue of single bits, values as trees, copies instead of
//! taking back. It knows the tokens only, nothing of the plan.

use crate::table::{Row, Value};
use _native::plan::Token;

pub struct Tree {
    word: String,
    number: u64,
    extra: u64,
    below: Vec<Tree>,
}

pub fn tree(tokens: &mut impl Iterator<Item = Token>) -> Tree {
    let (word, number, extra) = tokens.next().unwrap();
    let children = match word.as_str() {
        "struct" | "union" => number,
        "array" | "list" => 1,
        _ => 0,
    };
    Tree {
        below: (0..children).map(|_| tree(tokens)).collect(),
        word,
        number: number.into(),
        extra: extra.into(),
    }
}

impl Tree {
    /// Shortest form; `bare` leaves the length fields out.
    fn shortest(&self, bare: bool) -> u64 {
        let parts = self.below.iter().map(|t| t.shortest(bare));
        match self.word.as_str() {
            "struct" => parts.sum(),
            "union" => self.extra + parts.min().unwrap(),
            "array" => self.number * parts.sum::<u64>(),
            "list" if bare => 0,
            "list" => self.extra,
            _ => self.number,
        }
    }

    fn null(&self) -> Option<Value> {
        (self.word != "void").then_some(Value::Null)
    }
}

#[derive(Clone)]
struct Queue {
    bits: Vec<bool>,
    missing: u64,
    /// What was there when reading was given up.
    given_up: Option<Vec<bool>>,
}

struct Oracle {
    queue: Queue,
    dirty: bool,
    bad_tag: bool,
}

/// One row. `layout` as in the contract of `unpack`.
pub fn read(tree: &Tree, layout: u8, payload: &[u8]) -> Row {
    let bits = payload
        .iter()
        .flat_map(|byte| (0..8).map(move |bit| byte >> (7 - bit) & 1 == 1))
        .collect();
    let queue = Queue {
        bits,
        missing: 0,
        given_up: None,
    };
    let mut oracle = Oracle {
        queue,
        dirty: false,
        bad_tag: false,
    };
    let value = oracle.value(tree, layout, layout != 1).unwrap();
    let rest = oracle.queue.given_up.as_ref().unwrap_or(&oracle.queue.bits);
    oracle.dirty |= rest.contains(&true);
    Row {
        left: i32::try_from(rest.len()).unwrap() - i32::try_from(oracle.counted_missing()).unwrap(),
        value,
        dirty: u8::from(oracle.dirty) | u8::from(oracle.bad_tag) << 1,
    }
}

impl Oracle {
    fn counted_missing(&self) -> u64 {
        if self.queue.given_up.is_some() {
            0
        } else {
            self.queue.missing
        }
    }

    fn bits(&mut self, count: u64) -> Vec<bool> {
        let there = self.queue.bits.len().min(usize::try_from(count).unwrap());
        self.queue.missing += count - there as u64;
        self.queue.bits.drain(..there).collect()
    }

    /// Whole bytes from the lowest up, then what is over.
    fn number(&mut self, count: u64) -> Option<u64> {
        let bits = self.bits(count);
        if bits.len() as u64 != count || self.queue.missing > 0 {
            return None;
        }
        let byte = |bits: &[bool]| bits.iter().fold(0, |sum, &bit| sum * 2 + u64::from(bit));
        Some(
            bits.chunks(8)
                .enumerate()
                .map(|(index, bits)| byte(bits) << (8 * index))
                .sum(),
        )
    }

    fn give_up(&mut self) {
        if self.queue.given_up.is_none() && !self.queue.bits.is_empty() {
            self.queue.given_up = Some(std::mem::take(&mut self.queue.bits));
        }
    }

    /// `tail`: the layout still has something to say about a list that ends here.
    fn value(&mut self, tree: &Tree, layout: u8, tail: bool) -> Option<Value> {
        let bits = tree.number;
        Some(match tree.word.as_str() {
            "void" => {
                self.dirty |= self.bits(bits).contains(&true);
                return None;
            }
            "struct" => {
                let last = tree.below.len();
                let fields = tree.below.iter().zip(1..);
                Value::Struct(
                    fields
                        .filter_map(|(f, at)| self.value(f, layout, tail && at == last))
                        .collect(),
                )
            }
            "union" => {
                let Some(tag) = self.number(tree.extra) else {
                    self.bits(tree.shortest(false) - tree.extra);
                    return Some(Value::Null);
                };
                let mut members: Vec<_> = tree.below.iter().filter_map(Tree::null).collect();
                let active = usize::try_from(tag).unwrap();
                if let Some(member) = tree.below.get(active) {
                    members[active] = self.value(member, layout, tail)?;
                } else {
                    self.bad_tag = true;
                    self.give_up();
                }
                Value::Struct(members)
            }
            "array" => {
                let items = self.items(&tree.below[0], bits, bits, layout, tail);
                if items.is_empty() {
                    Value::Null
                } else {
                    Value::List(items)
                }
            }
            "list" => self.list(tree, layout, tail),
            "bool" => self.number(1).map_or(Value::Null, |raw| Value::Bool(raw == 1)),
            "uint" => self.number(bits).map_or(Value::Null, Value::Uint),
            "int" => self.number(bits).map_or(Value::Null, |raw| {
                let negative = raw >> (bits - 1) == 1;
                let value = i128::from(raw) - if negative { 1 << bits } else { 0 };
                Value::Int(i64::try_from(value).unwrap())
            }),
            _ => self.number(bits).map_or(Value::Null, |raw| match bits {
                16 => Value::Single(half(u16::try_from(raw).unwrap())),
                32 => Value::Single(u32::try_from(raw).unwrap()),
                _ => Value::Double(raw),
            }),
        })
    }

    fn list(&mut self, tree: &Tree, layout: u8, tail: bool) -> Value {
        let element = &tree.below[0];
        if !(tail && element.shortest(true) >= 8) {
            let Some(count) = self.number(tree.extra) else {
                return Value::Null;
            };
            return Value::List(self.items(element, count, tree.number, layout, tail));
        }
        if layout == 2 {
            let Some(count) = self.number(8) else {
                return Value::Null;
            };
            return Value::List(self.items(element, count, tree.number, layout, false));
        }
        if self.queue.missing > 0 || self.queue.given_up.is_some() {
            return Value::Null;
        }
        let mut items = vec![];
        while (items.len() as u64) < tree.number && self.queue.bits.len() as u64 >= element.shortest(false) {
            let before = self.queue.clone();
            let item = self.value(element, layout, false).unwrap();
            if self.queue.missing > 0 {
                self.queue = before;
                return Value::List(items);
            }
            items.push(item);
        }
        Value::List(items)
    }

    fn items(&mut self, element: &Tree, count: u64, max: u64, layout: u8, tail: bool) -> Vec<Value> {
        let mut items = vec![];
        for index in 1..=count {
            if items.len() as u64 == max && !self.queue.bits.is_empty() {
                self.give_up();
                break;
            }
            if (self.queue.bits.len() as u64) < element.shortest(false) {
                self.bits(element.shortest(false) * (count + 1 - index));
                break;
            }
            let item = self.value(element, layout, tail && index == count).unwrap();
            if self.queue.missing > 0 {
                self.bits(element.shortest(false) * (count - index));
                break;
            }
            items.push(item);
        }
        items
    }
}

/// float16 by its definition, in float64, where it is exact.
pub fn half(raw: u16) -> u32 {
    let sign = if raw >> 15 == 1 { -1.0 } else { 1.0 };
    let exponent = i32::from(raw >> 10 & 31);
    let mantissa = f64::from(raw & 1023);
    if exponent == 31 && mantissa > 0.0 {
        return u32::from(raw >> 15) << 31 | 255 << 23 | u32::from(raw & 1023) << 13;
    }
    let value = match exponent {
        31 => f64::INFINITY,
        0 => mantissa * 2_f64.powi(-24),
        _ => (1024.0 + mantissa) * 2_f64.powi(exponent - 25),
    };
    #[expect(clippy::cast_possible_truncation, reason = "every float16 is a float32")]
    let single = (sign * value) as f32;
    single.to_bits()
}
