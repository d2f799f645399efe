//! The laws of the readers of binary formats on any input: nothing panics, every record is accounted for, and rows do
//! not depend on how the bytes were cut. The first two bytes are the sizes of chunks, all others the capture, which
//! each reader gets.
//!
//! `cargo +nightly fuzz run formats corpus/formats seeds/formats`
#![no_main]

#[path = "../../tests/common/readers.rs"]
mod readers;

use libfuzzer_sys::fuzz_target;

fuzz_target!(|data: &[u8]| {
    let [first, second, bytes @ ..] = data else { return };
    let sizes = [usize::from(*first), usize::from(*second)];
    for form in readers::FORMS {
        readers::check(form, bytes, &sizes);
    }
});
