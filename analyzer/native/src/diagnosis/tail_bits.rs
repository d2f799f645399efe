//! Frames that stand in a row though their tail bytes tear them apart: wrong start, end or ID bits of the sender.
#![forbid(unsafe_code)]

use super::proofs::Proof;
use super::{alternate, Expected, Form, Part, ID};

/// The transfer that frames make without a start, end or ID bit that tears them apart; None if the CRC is wrong.
///
/// `parts` are frames of a broken transfer, or what is left of one, `near` all frames of its session around it, in order.
pub fn in_a_row<'a>(parts: &[Part<'a>], near: &[Part<'a>], expected: &Expected<'_>) -> Option<Proof<'a>> {
    let first = parts.first()?;
    if expected.fits_nothing() {
        return None;
    }
    let own: Vec<Part<'a>> = near.iter().filter(|part| part.id() == first.id()).copied().collect();
    let at = own.iter().position(|part| part.number == first.number)?;
    ends(&own, at, expected)
        .or_else(|| starts(&own, at, expected))
        .or_else(|| other_id(parts, near, expected))
}

/// From a start to before the next one, with ends in between.
fn ends<'a>(own: &[Part<'a>], at: usize, expected: &Expected<'_>) -> Option<Proof<'a>> {
    let first = (0..=at).rfind(|&k| own[k].start()).unwrap_or(0);
    let behind = (first + 1..own.len()).find(|&k| own[k].start()).unwrap_or(own.len());
    let order = &own[first..behind];
    let wrong = order[..order.len() - 1].iter().filter(|part| part.end());
    proof(order, wrong, (Form::EndBit, Form::EveryEnd), expected)
}

/// From behind an end to the next one, with starts in between.
fn starts<'a>(own: &[Part<'a>], at: usize, expected: &Expected<'_>) -> Option<Proof<'a>> {
    let first = (1..=at).rfind(|&k| own[k - 1].end()).unwrap_or(0);
    let last = (at..own.len()).find(|&k| own[k].end()).unwrap_or(own.len() - 1);
    let order = &own[first..=last];
    let wrong = order[1..].iter().filter(|part| part.start());
    proof(order, wrong, (Form::StartBit, Form::EveryStart), expected)
}

/// One wrong bit, or the same in every frame.
fn proof<'a, 'o>(
    order: &'o [Part<'a>],
    mut wrong: impl Iterator<Item = &'o Part<'a>>,
    (one, every): (Form, Form),
    expected: &Expected<'_>,
) -> Option<Proof<'a>>
where
    'a: 'o,
{
    let first = wrong.next()?;
    let count = 1 + wrong.count();
    if !order[0].start() || !alternate(order) || !expected.fits(order) {
        return None;
    }
    if count == 1 {
        return Some(Proof::new(one, &[first.number], order.to_vec()));
    }
    (count == order.len() - 1).then(|| Proof::new(every, &[], order.to_vec()))
}

/// A first frame, and behind it the rest of a transfer with another ID, or with one more in each frame.
fn other_id<'a>(parts: &[Part<'a>], near: &[Part<'a>], expected: &Expected<'_>) -> Option<Proof<'a>> {
    let at = near.iter().position(|part| part.number == parts[0].number)?;
    let first = (0..=at).rfind(|&k| near[k].start()).unwrap_or(0);
    let end = (first + 1..near.len()).find(|&k| near[k].end() || near[k].start())?;
    let order = &near[first..=end];
    let begins = order[0].start() && !order[1..].iter().any(Part::start);
    if !begins || order[0].end() || !alternate(order) || !expected.fits(order) {
        return None;
    }
    let ids: Vec<u8> = order.iter().map(Part::id).collect();
    if ids.len() > 2 && ids.windows(2).all(|two| two[1] == (two[0] + 1) & ID) {
        return Some(Proof::new(Form::EveryId, &[], order.to_vec()));
    }
    let apart = if parts[0].start() {
        parts.len() == 1
    } else {
        !parts.iter().any(|part| part.is(&order[0]))
    };
    if !apart || ids[0] == ids[1] || ids[1..].iter().any(|&id| id != ids[1]) {
        return None;
    }
    // Of two nobody knows which.
    let which = [order[0].number, order[1].number];
    let which = if order.len() == 2 { &which[..] } else { &which[..1] };
    Some(Proof::new(Form::OtherId, which, order.to_vec()))
}
