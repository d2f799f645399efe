//! A first frame with a wrong transfer ID: by the CRC the frames behind it belong to it, and say which ID was meant.
#![forbid(unsafe_code)]

use super::index::Frames;
use super::{ended, wire, Known, Part, CRC_BYTES};

/// Frames of the bus before and behind one that are looked through.
const NEAR: u64 = 512;

/// The transfer ID of the frames behind a first frame, if it is another one and they fit.
pub fn meant(frames: Frames<'_>, number: u64, known: &Known) -> Option<u8> {
    let first = frames.part(number)?;
    if !first.start() || first.end() {
        return None;
    }
    let mut behind = vec![];
    let range = number + 1..number + 1 + NEAR;
    frames.take(frames.session(number)?, &range, usize::MAX, false, &mut behind);
    let size = behind.iter().position(Part::end)? + 1;
    let mut order = vec![first];
    order.extend_from_slice(&behind[..size]);
    let id = behind[0].id();
    let alternate = order.windows(2).all(|two| two[0].toggle() != two[1].toggle());
    let same = order[1..].iter().all(|part| !part.start() && part.id() == id);
    (alternate && same && id != first.id() && fits(&order, known)).then_some(id)
}

/// Whether the bytes of a transfer begin with the right CRC.
fn fits(order: &[Part<'_>], known: &Known) -> bool {
    let length: usize = order.iter().map(|part| part.body.len()).sum();
    let wire = wire(order);
    length >= CRC_BYTES && known.starts.iter().any(|&start| ended(start, order) == wire)
}

/// The same of the last first frame before another one.
pub fn meant_before(frames: Frames<'_>, number: u64, known: &Known) -> Option<u8> {
    let mut before = vec![];
    let range = number.saturating_sub(NEAR)..number;
    frames.take(frames.session(number)?, &range, usize::MAX, true, &mut before);
    let first = before.iter().rfind(|part| part.start())?;
    meant(frames, first.number, known)
}
