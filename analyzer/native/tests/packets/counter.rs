//! Frame counts of packets.

use crate::{families, one_row, packet, QUERY, SCI};
use _native::packets::{Carrier, Counter};

#[test]
fn steps_are_counted_by_unit_and_by_id_below_it() {
    let mut counter = Counter::default();
    let carrier = |bus, src, type_id| Carrier { bus, src, type_id };
    let esc = carrier(0, 10, 1039);
    assert_eq!(counter.step(esc, 0xA1, 0x15, 254), (None, None));
    assert_eq!(counter.step(esc, 0xA1, 0x15, 255), (Some(1), Some(1)));
    assert_eq!(counter.step(esc, 0xA1, 0x1E, 0), (Some(1), None));
    assert_eq!(counter.step(esc, 0xA1, 0x15, 1), (Some(1), Some(2)));
    assert_eq!(counter.step(esc, 0xA1, 0x15, 0), (Some(255), Some(255)));
    for other in [carrier(1, 10, 1039), carrier(0, 11, 1039), carrier(0, 10, 1038)] {
        assert_eq!(counter.step(other, 0xA1, 0x15, 7), (None, None));
    }
    assert_eq!(counter.step(esc, 0xA2, 0x15, 7), (None, None));
}

#[test]
fn steps_of_found_packets_go_on_from_batch_to_batch() {
    let carriers = [Carrier {
        bus: 0,
        src: 10,
        type_id: 1038,
    }];
    let mut counter = Counter::default();
    let mut batch = |data: &[u8], carriers: &[Carrier]| {
        let steps = counter.steps(&families(), &one_row(SCI, data), carriers, data);
        assert!(steps.step.len() == steps.step_valid.len() && steps.step_id.len() == steps.step_id_valid.len());
        (steps.step, steps.step_valid, steps.step_id, steps.step_id_valid)
    };
    let zero = packet([0xEC, 0x96], 0x08, 6, 0xA1, 7, 6);
    let data = [&QUERY[..], &[0], &zero].concat();
    assert_eq!(
        batch(&data, &carriers),
        (vec![0, 0, 1], vec![0, 0, 1], vec![0; 3], vec![0; 3])
    );
    // One without count or unit is not counted, nor is one whose carrier nobody knows.
    assert_eq!(batch(&zero[..4], &carriers).1, [0]);
    assert_eq!(batch(&zero, &[]).1, [0]);
    let mut later = QUERY;
    later[3] = 9;
    assert_eq!(batch(&later, &carriers), (vec![3], vec![1], vec![4], vec![1]));
}

#[test]
fn a_full_counter_keeps_what_it_has() {
    let mut counter = Counter::default();
    let carrier = |index: usize| Carrier {
        bus: 0,
        src: (index & 0xFF) as u8,
        type_id: (index >> 8) as u16,
    };
    // Each carrier takes two keys.
    for index in 0..Counter::MAX_KEYS {
        assert_eq!(counter.step(carrier(index), 1, 1, 10), (None, None));
    }
    assert_eq!(counter.step(carrier(0), 1, 1, 12), (Some(2), Some(2)));
    let last = Counter::MAX_KEYS / 2 - 1;
    assert_eq!(counter.step(carrier(last), 1, 1, 13), (Some(3), Some(3)));
    assert_eq!(counter.step(carrier(last + 1), 1, 1, 14), (None, None));
}
