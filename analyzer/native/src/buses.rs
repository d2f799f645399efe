//! Interface names as a capture writes them, numbered in order of appearance.
#![forbid(unsafe_code)]

use crate::line::escape;

/// Interfaces that a capture may have; their index is one byte.
pub const MAX_BUSES: usize = 255;
/// Bytes of a name that are kept.
const MAX_NAME: usize = 64;

/// Names by index, unprintable bytes escaped.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Buses(Vec<String>);

impl Buses {
    /// The index of a name, and whether it is new; `None` when there are too many.
    pub fn index(&mut self, name: &[u8]) -> Option<(u8, bool)> {
        if let Some(at) = self.0.iter().position(|bus| bus.as_bytes() == name) {
            return Some((at as u8, false));
        }
        let text = escape(&name[..name.len().min(MAX_NAME)], usize::MAX);
        if let Some(at) = self.0.iter().position(|bus| *bus == text) {
            return Some((at as u8, false));
        }
        if self.0.len() == MAX_BUSES {
            return None;
        }
        self.0.push(text);
        Some((self.0.len() as u8 - 1, true))
    }

    /// Names that were indexed before.
    pub fn of(names: Vec<String>) -> Self {
        Buses(names)
    }

    pub fn names(&self) -> &[String] {
        &self.0
    }
}
