//! What an error frame says, in words. Bit meanings: `linux/can/error.h`.
#![forbid(unsafe_code)]

use std::fmt::Write;

const COUNTERS: u32 = 0x200;

const CLASSES: [&str; 10] = [
    "transmit timeout",
    "lost arbitration",
    "controller",
    "protocol",
    "transceiver",
    "no acknowledge",
    "bus off",
    "bus error",
    "restarted",
    "counters",
];
/// Data byte 1 of class "controller".
const CONTROLLER: [&str; 7] = [
    "receive overflow",
    "transmit overflow",
    "receive warning",
    "transmit warning",
    "receive passive",
    "transmit passive",
    "active again",
];
/// Data byte 2 of class "protocol".
const PROTOCOL: [&str; 8] = [
    "bit",
    "form",
    "stuff",
    "dominant bit",
    "recessive bit",
    "overload",
    "active",
    "on transmit",
];

/// The classes in words with their details, the data in hex, and the transmit and receive error counters if it has them.
pub fn describe(class: u32, data: &[u8]) -> (String, Option<(u8, u8)>) {
    let byte = |at: usize| data.get(at).copied().unwrap_or(0);
    let counters = (class & COUNTERS != 0 && data.len() >= 8).then(|| (byte(6), byte(7)));
    let mut words: Vec<String> = vec![];
    for (bit, name) in CLASSES.iter().enumerate().filter(|(bit, _)| class >> bit & 1 != 0) {
        let detail = match bit {
            1 if byte(0) != 0 => format!("bit {}", byte(0)),
            2 => names(byte(1), &CONTROLLER),
            3 => names(byte(2), &PROTOCOL),
            9 => counters
                .map(|(tx, rx)| format!("transmit {tx}, receive {rx}"))
                .unwrap_or_default(),
            _ => String::new(),
        };
        words.push(if detail.is_empty() {
            (*name).to_owned()
        } else {
            format!("{name} ({detail})")
        });
    }
    let unnamed = class >> CLASSES.len() << CLASSES.len();
    if unnamed != 0 || words.is_empty() {
        words.push(format!("class {unnamed:X}"));
    }
    let mut text = words.join(", ");
    if !data.is_empty() {
        text.push_str("; data");
    }
    for byte in data {
        let _ = write!(text, " {byte:02X}");
    }
    (text, counters)
}

fn names(bits: u8, names: &[&str]) -> String {
    let set: Vec<&str> = names
        .iter()
        .enumerate()
        .filter(|(bit, _)| bits >> bit & 1 != 0)
        .map(|(_, name)| *name)
        .collect();
    set.join(", ")
}

#[cfg(test)]
mod tests {
    use super::describe;

    #[test]
    fn classes_read_as_words() {
        let (text, counters) = describe(0x204, &[0, 0x0C, 0, 0, 0, 0, 96, 135]);
        assert_eq!(
            text,
            "controller (receive warning, transmit warning), counters (transmit 96, receive 135); \
             data 00 0C 00 00 00 00 60 87"
        );
        assert_eq!(counters, Some((96, 135)));
        assert_eq!(
            describe(0x88, &[0, 0, 4, 25, 0, 0, 7, 7]).0,
            "protocol (stuff), bus error; data 00 00 04 19 00 00 07 07"
        );
        assert_eq!(describe(0x88, &[0, 0, 4, 25, 0, 0, 7, 7]).1, None);
        assert_eq!(describe(0x42, &[11]).0, "lost arbitration (bit 11), bus off; data 0B");
        assert_eq!(
            describe(0x200, &[0; 7]),
            ("counters; data 00 00 00 00 00 00 00".to_owned(), None)
        );
        assert_eq!(describe(0, &[]).0, "class 0");
        assert_eq!(
            describe(0x1000_0121, &[]).0,
            "transmit timeout, no acknowledge, restarted, class 10000000"
        );
    }
}
