//! The laws of the core on any input: nothing panics, every line, frame and byte is accounted for, and tables do not
//! depend on how the text was cut. The first byte says what the others are: text, or a script that makes valid traffic
//! and damages it (so that the fuzzer gets past the first checks), or a layout with payloads.
//!
//! `cargo +nightly fuzz run law corpus/law seeds/law`
#![no_main]

#[path = "../../tests/common/capture.rs"]
mod capture;
mod input;
mod layouts;
#[path = "../../tests/common/log.rs"]
mod log;
mod made;
mod packets;
mod script;
#[path = "../../tests/common/sender.rs"]
mod sender;
#[path = "../../tests/common/tables.rs"]
mod tables;
#[path = "../../tests/common/wreck.rs"]
mod wreck;

use _native::bits::spans;
use libfuzzer_sys::fuzz_target;

use input::Input;
use tables::Tables;

fuzz_target!(|data: &[u8]| {
    let mut input = Input(data);
    match input.byte() % 4 {
        0 => {
            let cuts = input.take(4);
            check(input.0, cuts);
        }
        3 => layouts::check_any(&mut input),
        _ => {
            let cuts = input.take(4);
            check(&script::text(&mut input), cuts);
        }
    }
});

/// A byte of `cuts` gives the size of a chunk and whether the tables are taken behind it; they are used in turn.
fn check(text: &[u8], cuts: &[u8]) {
    let whole = Tables::of(std::iter::once((text, false)));
    whole.check();
    let mut rest = text;
    let mut cuts = cuts.iter().chain(&[77]).cycle();
    let chunks = std::iter::from_fn(|| {
        let cut = usize::from(*cuts.next()?);
        let (chunk, behind) = rest.split_at(rest.len().min(1 + (cut >> 1) * (cut >> 1) / 4));
        rest = behind;
        (!chunk.is_empty()).then_some((chunk, cut % 2 == 1))
    });
    assert_eq!(Tables::of(chunks), whole);
    let rows = &whole.capture.transfers;
    let spans = spans(&rows.payload_offset, None);
    layouts::check_fixed(&spans, &rows.fd, &rows.payload);
    packets::check(&spans, &rows.payload);
}
