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

#[cfg(test)]
mod tests {
    use super::super::index::{owned::Owned, Frames, Index};
    use super::super::{ended, Known, Part, END, START, TOGGLE};
    use super::{meant, meant_before, NEAR};

    const SESSION: u32 = 0x0004_0A0B;
    const FILLER: u32 = 0x0004_0C0D;

    /// Frames of a bus, from 0.
    #[derive(Default)]
    struct Bus(Owned);

    impl Bus {
        fn send(&mut self, id: u32, tail: u8, body: &[u8]) {
            let columns = &mut self.0;
            if columns.offsets.is_empty() {
                columns.offsets.push(0);
            }
            columns.t.push(columns.t.len() as i64);
            columns.bus.push(0);
            columns.id.push(id);
            columns.flags.push(1);
            columns.data.extend_from_slice(body);
            columns.data.push(tail);
            columns.offsets.push(columns.data.len() as i32);
        }

        /// A transfer of three frames with a right CRC, whose first frame says another ID.
        fn transfer(&mut self, first: u8, id: u8) {
            let bodies: [&[u8]; 3] = [&[0, 0, 1, 2, 3, 4, 5], &[6, 7, 8, 9, 10, 11, 12], &[13]];
            let tails = [START | first, TOGGLE | id, END | id];
            let part = |(&tail, body)| Part {
                number: 0,
                tail,
                body,
                t: 0,
            };
            let parts: Vec<Part<'_>> = tails.iter().zip(bodies).map(part).collect();
            let crc = ended(0xFFFF, &parts).to_le_bytes();
            self.send(SESSION, tails[0], &[&crc, &bodies[0][2..]].concat());
            self.send(SESSION, tails[1], bodies[1]);
            self.send(SESSION, tails[2], bodies[2]);
        }

        fn ask<T>(self, question: impl FnOnce(Frames<'_>, &Known) -> T) -> T {
            let index = Index::new(0, Box::new(self.0)).expect("columns fit");
            let known = Known {
                starts: vec![0, 0xFFFF],
                size: None,
            };
            question(Frames(&[&index]), &known)
        }
    }

    #[test]
    fn the_frames_behind_say_which_id_was_meant() {
        let mut bus = Bus::default();
        bus.transfer(9, 5);
        assert_eq!(bus.ask(|frames, known| meant(frames, 0, known)), Some(5));
    }

    #[test]
    fn a_transfer_with_one_id_meant_that_one() {
        let mut bus = Bus::default();
        bus.transfer(5, 5);
        assert_eq!(bus.ask(|frames, known| meant(frames, 0, known)), None);
    }

    #[test]
    fn nothing_is_meant_by_other_frames_or_another_crc() {
        let mut bus = Bus::default();
        bus.transfer(9, 5);
        assert_eq!(bus.ask(|frames, known| meant(frames, 1, known)), None, "no first frame");
        let mut bus = Bus::default();
        bus.transfer(9, 5);
        bus.0.data[3] ^= 1;
        assert_eq!(
            bus.ask(|frames, known| meant(frames, 0, known)),
            None,
            "the CRC does not fit"
        );
        let mut bus = Bus::default();
        bus.transfer(9, 5);
        assert_eq!(
            bus.ask(|frames, known| meant(frames, 99, known)),
            None,
            "it is not there"
        );
        let mut bus = Bus::default();
        bus.send(SESSION, START | 9, &[0; 7]);
        assert_eq!(
            bus.ask(|frames, known| meant(frames, 0, known)),
            None,
            "nothing ends it"
        );
        let mut bus = Bus::default();
        bus.send(SESSION, START | END | 9, &[0; 7]);
        assert_eq!(bus.ask(|frames, known| meant(frames, 0, known)), None, "it is whole");
    }

    #[test]
    fn the_first_frame_before_another_one_is_asked_about_as_far_as_it_is_near() {
        let asked = |between: u64| {
            let mut bus = Bus::default();
            bus.transfer(9, 5);
            for _ in 0..between {
                bus.send(FILLER, START | END, &[1]);
            }
            bus.send(SESSION, START | 0x0A, &[0; 7]);
            let number = bus.0.t.len() as u64 - 1;
            bus.ask(|frames, known| meant_before(frames, number, known))
        };
        assert_eq!(asked(0), Some(5));
        assert_eq!(asked(NEAR - 3), Some(5));
        assert_eq!(asked(NEAR - 2), None);
    }
}
