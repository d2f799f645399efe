//! What would have to be different for the CRC of a broken transfer to be right.
#![forbid(unsafe_code)]

use super::{alternate, ends_right, numbers, tails_right, Cause, Expected, Form, Part, END, START};

/// Frames whose every order is tried.
const FEW: usize = 6;
/// Frames above which none is.
const MANY: usize = 256;
/// Frames above which no bit of a tail byte is turned.
const FLIPPED: usize = 24;

/// A cause, and the frames as they were meant: their CRC is right.
#[derive(Clone, Debug)]
pub struct Proof<'a> {
    pub cause: Cause,
    pub order: Vec<Part<'a>>,
}

impl<'a> Proof<'a> {
    pub fn new(form: Form, numbers: &[u64], order: Vec<Part<'a>>) -> Self {
        let cause = Cause::new(form, numbers);
        Proof { cause, order }
    }

    pub fn holds(&self, part: &Part<'_>) -> bool {
        self.order.iter().any(|one| one.is(part))
    }
}

/// What must be different for the CRC to be right; None if nothing is found.
///
/// `parts` are the frames of a broken transfer, or what is left of one, as they came, and `around` frames near it, of its
/// session but of no whole transfer, which may belong here.
pub fn proven<'a>(parts: &[Part<'a>], around: &[Part<'a>], expected: &Expected<'_>) -> Option<Proof<'a>> {
    let (first, last) = (parts.first()?, parts.last()?);
    if expected.fits_nothing() {
        return None;
    }
    let mut pool = [parts, around].concat();
    pool.sort_by_key(|part| part.number);
    let id = first.id();
    let own = pool
        .iter()
        .filter(|part| (first.number..=last.number).contains(&part.number) && part.id() == id);
    for order in [parts.to_vec(), own.copied().collect()] {
        if !alternate(&order) && ends_right(&order) && expected.fits(&order) {
            let either = is_swappable(&order);
            return Some(Proof::new(
                if either { Form::Either } else { Form::WrongBit },
                &[],
                order,
            ));
        }
    }
    one_bit_turned(&pool, id, expected).or_else(|| {
        let came = |order: &[Part<'_>]| order.len() == parts.len() && order.iter().zip(parts).all(|(a, b)| a.is(b));
        in_some_order(&pool, &mut |order| {
            let fits = !came(order) && expected.fits(order);
            let cause = if fits { difference(order, &pool, id) } else { None };
            cause.map(|cause| Proof {
                cause,
                order: order.to_vec(),
            })
        })
    })
}

/// Whether two equal neighbours have each the toggle that the other one should have.
fn is_swappable(order: &[Part<'_>]) -> bool {
    let wrong: Vec<usize> = (0..order.len())
        .filter(|&k| order[k].toggle() != (k & 1 == 1))
        .collect();
    matches!(wrong[..], [one, other] if other - one == 1 && order[one].body == order[other].body)
}

/// One frame whose start or end bit is wrong: with the other one the transfer is whole.
fn one_bit_turned<'a>(pool: &[Part<'a>], id: u8, expected: &Expected<'_>) -> Option<Proof<'a>> {
    if pool.len() > FLIPPED {
        return None;
    }
    let own: Vec<Part<'a>> = pool.iter().filter(|part| part.id() == id).copied().collect();
    for k in 0..own.len() {
        for (bit, form) in [(END, Form::EndBit), (START, Form::StartBit)] {
            let mut right = own.clone();
            right[k].tail ^= bit;
            for first in (0..=k).filter(|&at| right[at].start()) {
                let end = (first..right.len()).find(|&at| right[at].end()).unwrap_or(first);
                let order = &right[first..=end];
                let alone = k <= end && order.len() > 1 && right.get(end + 1).is_none_or(Part::start);
                if alone && tails_right(order) && expected.fits(order) {
                    return Some(Proof::new(form, &[own[k].number], order.to_vec()));
                }
            }
        }
    }
    None
}

/// What separates the order that is right from the one that came.
fn difference(order: &[Part<'_>], pool: &[Part<'_>], id: u8) -> Option<Cause> {
    if let Some(strange) = order.iter().find(|part| part.id() != id) {
        return Some(Cause::new(Form::OtherId, &[strange.number]));
    }
    if order.windows(2).any(|two| two[1].number < two[0].number) {
        return Some(Cause::new(Form::Swapped, &numbers(order)));
    }
    let left = |part: &&Part<'_>| part.id() == id && !order.iter().any(|one| one.is(part));
    let rest: Vec<Part<'_>> = pool.iter().filter(left).copied().collect();
    let again = rest.iter().all(|part| order.iter().any(|one| one.like(part)));
    let form = if again { Form::Repeated } else { Form::OtherSender };
    (!rest.is_empty()).then(|| Cause::new(form, &numbers(&rest)))
}

type Try<'t, 'a> = &'t mut dyn FnMut(&[Part<'a>]) -> Option<Proof<'a>>;

/// Tries sequences of frames with right tails that might be what was sent, the likely ones first, until one is taken.
fn in_some_order<'a>(pool: &[Part<'a>], take: Try<'_, 'a>) -> Option<Proof<'a>> {
    match pool.len() {
        count if count > MANY => None,
        count if count > FEW => in_near_order(pool, take),
        _ => in_any_order(pool, &mut vec![], take),
    }
}

/// Every way from a start to an end whose toggles alternate.
fn in_any_order<'a>(pool: &[Part<'a>], begun: &mut Vec<Part<'a>>, take: Try<'_, 'a>) -> Option<Proof<'a>> {
    for part in pool {
        let at = begun.len();
        let fits = part.start() == (at == 0) && part.toggle() == (at & 1 == 1);
        if !fits || begun.iter().any(|one| one.is(part)) {
            continue;
        }
        begun.push(*part);
        let found = match (part.end(), at) {
            (false, _) => in_any_order(pool, begun, take),
            (true, 0) => None,
            (true, _) => take(begun),
        };
        begun.pop();
        if found.is_some() {
            return found;
        }
    }
    None
}

/// The frames as they came, two close ones swapped, one left out, every second left out, all turned around.
fn in_near_order<'a>(pool: &[Part<'a>], take: Try<'_, 'a>) -> Option<Proof<'a>> {
    let mut try_one = |order: &[Part<'a>]| if tails_right(order) { take(order) } else { None };
    let count = pool.len();
    let mut order = pool.to_vec();
    if let Some(found) = try_one(&order) {
        return Some(found);
    }
    for apart in [1, 2] {
        for k in 0..count.saturating_sub(apart) {
            order.swap(k, k + apart);
            let found = try_one(&order);
            order.swap(k, k + apart);
            if found.is_some() {
                return found;
            }
        }
    }
    for (k, part) in pool.iter().enumerate() {
        order.remove(k);
        let found = try_one(&order);
        order.insert(k, *part);
        if found.is_some() {
            return found;
        }
    }
    let every_second = |from: usize| pool.iter().skip(from).step_by(2).copied();
    let with_first = |from: usize| pool.iter().take(1).copied().chain(every_second(from));
    let some: [Vec<Part<'a>>; 5] = [
        every_second(0).collect(),
        every_second(1).collect(),
        with_first(2).collect(),
        with_first(1).collect(),
        pool.iter().rev().copied().collect(),
    ];
    some.iter().find_map(|order| try_one(order)).or_else(|| {
        (1..count).find_map(|k| {
            order.rotate_left(1);
            debug_assert!(order[0].is(&pool[k]));
            try_one(&order)
        })
    })
}
