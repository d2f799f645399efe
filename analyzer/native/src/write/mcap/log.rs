//! Comments as messages of a log, `rcl_interfaces/msg/Log`, which viewers show as text.
#![forbid(unsafe_code)]

use super::{align, string, DATA};

const INFORMATION: u8 = 20;
const NAME: &[u8] = b"tailbyte";

/// Continues what a message record begins with: level and name.
pub(super) fn start(mut record: Vec<u8>) -> Vec<u8> {
    record.push(INFORMATION);
    string(NAME, &mut record, DATA);
    align(&mut record, DATA);
    record
}

/// Appends the text behind that; the place in source code is empty: two names and a line number.
pub(super) fn write(text: &str, out: &mut Vec<u8>) {
    let from = out.len();
    for text in [text, "", ""] {
        string(text.as_bytes(), out, from);
    }
    align(out, from);
    out.extend([0; 4]);
}
