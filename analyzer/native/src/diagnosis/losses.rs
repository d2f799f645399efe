//! The frames of a transfer that are missing, as far as toggles, the type's length and the sender's habit tell.
#![forbid(unsafe_code)]

use super::{Cause, Expected, Form, Part};

/// What is missing of a broken transfer, or of what is left of one; None if nothing shows that anything is.
///
/// `parts` are its frames, as they came; no order of them has the right CRC.
pub fn missing(parts: &[Part<'_>], expected: &Expected<'_>) -> Option<Cause> {
    alone(parts, expected).or_else(|| gone(parts, expected))
}

fn gone(parts: &[Part<'_>], expected: &Expected<'_>) -> Option<Cause> {
    let (first, last, came) = (parts.first()?, parts.last()?, parts.len());
    let breaks = parts.windows(2).filter(|two| stands_still(two)).count();
    let total = total(parts, breaks, expected);
    let gone = total.map(|total| total.checked_sub(came));
    if let (Some(total), Some(None)) = (total, gone) {
        return Some(Cause::new(Form::TooMany, &[came as u64, total as u64]));
    }
    let gone = gone.flatten();
    if !first.start() {
        return Some(without_start(parts, breaks, gone));
    }
    if breaks > 0 {
        return Some(with_breaks(parts, breaks, gone, expected));
    }
    if !last.end() {
        return Some(without_end(came, gone, expected));
    }
    let gone = gone.filter(|&gone| gone > 0)? as u64;
    Some(Cause::new(Form::SeveralOf, &[gone, came as u64 + gone]))
}

/// Whether two frames one behind the other have the same toggle.
fn stands_still(two: &[Part<'_>]) -> bool {
    two[0].toggle() == two[1].toggle()
}

/// The start or end bit of a transfer in one frame, which has no CRC: nothing but its length tells.
fn alone(parts: &[Part<'_>], expected: &Expected<'_>) -> Option<Cause> {
    let [part] = parts else { return None };
    if part.toggle() || part.start() == part.end() {
        return None;
    }
    let length = part.body.len();
    let by_length = match expected.known.size {
        Some(size) => expected.frames() == Some(1) && length == size,
        None => expected.singles.contains(&length) && expected.lengths.is_empty(),
    };
    let form = if part.start() { Form::EndBit } else { Form::StartBit };
    by_length.then(|| Cause::new(form, &[part.number]))
}

/// How many frames it had, if but one number is possible.
fn total(parts: &[Part<'_>], breaks: usize, expected: &Expected<'_>) -> Option<usize> {
    if let Some(fixed) = expected.frames() {
        return Some(fixed);
    }
    let (first, last, came) = (parts.first()?, parts.last()?, parts.len());
    let (start, end, size) = (first.start(), last.end(), last.body.len());
    if start && end && breaks == 0 && expected.lengths.contains(&(came, size)) {
        return None; // it is as long as others are
    }
    let odd = usize::from(end && !start && first.toggle());
    let may = |&&(frames, length): &&(usize, usize)| {
        if end && length != size {
            return false;
        }
        if start && end {
            return frames >= came + breaks && (frames - came - breaks).is_multiple_of(2);
        }
        frames >= came + breaks.max(1) && (!end || start || (frames - came) % 2 == odd || breaks > 0)
    };
    let mut totals = expected.lengths.iter().filter(may).map(|&(frames, _)| frames);
    let one = totals.next()?;
    totals.all(|other| other == one).then_some(one)
}

/// The place, from 1, of the first frame with the toggle of the one before it; of the last if there is none.
fn break_at(parts: &[Part<'_>]) -> u64 {
    let at = parts.windows(2).position(stands_still).map(|at| at + 1);
    at.unwrap_or(parts.len() - 1) as u64 + 1
}

/// Toggles that do not alternate: between two equal ones an odd number of frames is missing.
fn with_breaks(parts: &[Part<'_>], breaks: usize, gone: Option<usize>, expected: &Expected<'_>) -> Cause {
    let place = break_at(parts);
    let Some(gone) = gone else {
        return match (expected.fits_nothing(), breaks) {
            (true, _) => Cause::new(Form::Unproven, &[]),
            (false, 1) => Cause::new(Form::OddFrom, &[place]),
            (false, _) => Cause::new(Form::SeveralAtLeast, &[breaks as u64, place]),
        };
    };
    let total = (parts.len() + gone) as u64;
    if gone < breaks {
        // Nothing is missing at its end, or nobody can tell.
        let ends = parts.last().is_some_and(Part::end);
        return if ends {
            Cause::new(Form::NoOrder, &[])
        } else {
            Cause::new(Form::SeveralFrom, &[place])
        };
    }
    if gone > 1 {
        Cause::new(Form::SeveralOfFrom, &[gone as u64, total, place])
    } else {
        Cause::new(Form::One, &[place, total])
    }
}

fn without_end(came: usize, gone: Option<usize>, expected: &Expected<'_>) -> Cause {
    let next = came as u64 + 1;
    match gone {
        None => Cause::new(Form::LastsFrom, &[next]),
        Some(0) if expected.fits_nothing() => Cause::new(Form::Unproven, &[]),
        Some(0) => Cause::new(Form::NoOrder, &[]),
        Some(1) => Cause::new(Form::Last, &[next]),
        Some(gone) => Cause::new(Form::Lasts, &[next, (came + gone) as u64]),
    }
}

fn without_start(parts: &[Part<'_>], breaks: usize, gone: Option<usize>) -> Cause {
    if breaks > 0 {
        return Cause::new(Form::SeveralFirstToo, &[]);
    }
    let ends = parts.last().is_some_and(Part::end);
    match gone.filter(|&gone| gone > 0 && ends) {
        None if parts[0].toggle() => Cause::new(Form::First, &[]),
        None => Cause::new(Form::Firsts, &[]),
        Some(1) => Cause::new(Form::FirstOf, &[1 + parts.len() as u64]),
        Some(gone) => Cause::new(Form::FirstsOf, &[gone as u64, (gone + parts.len()) as u64]),
    }
}
