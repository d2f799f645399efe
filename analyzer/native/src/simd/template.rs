//! What the next plain log line is expected to start with: `(1436509052.`, six or nine digits, `) vcan0 `.
#![forbid(unsafe_code)]

use super::ROOM;

/// Bytes of `(1436509052.`
pub(super) const HEAD: usize = 12;
/// Interfaces that the fast path knows; further ones go through the readable path.
const SHAPES: usize = 8;
/// Shortest and longest `) vcan0 ` that it knows.
pub(super) const MIN_WIDTH: usize = 4;
pub(super) const MAX_WIDTH: usize = 24;
/// Seconds whose nanoseconds always fit.
const MAX_SECOND: i64 = i64::MAX / 1_000_000_000 - 1;

/// The text between time stamp and identifier for one interface.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Shape {
    pub(super) text: [u8; 32],
    /// Bytes of `text` that count; 0 for an unused slot.
    pub(super) width: usize,
    pub(super) bus: u8,
}

#[derive(Clone, Debug, Default)]
pub struct Template {
    pub(super) head: [u8; 16],
    pub(super) second_ns: i64,
    shapes: [Shape; SHAPES],
    learned: usize,
    /// The shape to try first, by [`slot`].
    first_try: [u8; 16],
}

impl Template {
    /// Adds an interface; each name once. Names that could be read otherwise, in colours say or with a `#`, are left out.
    pub fn learn(&mut self, name: &[u8], bus: u8) {
        let width = name.len() + 3;
        if self.learned == SHAPES || width > MAX_WIDTH || !name.iter().all(|b| b.is_ascii_graphic() && *b != b'#') {
            return;
        }
        let mut shape = Shape {
            width,
            bus,
            ..Shape::default()
        };
        shape.text[..2].copy_from_slice(b") ");
        shape.text[2..width - 1].copy_from_slice(name);
        shape.text[width - 1] = b' ';
        self.first_try[slot(width, name[name.len() - 1])] = self.learned as u8;
        self.shapes[self.learned] = shape;
        self.learned += 1;
    }

    /// Bytes of the first shape.
    pub(super) fn likely_width(&self) -> usize {
        self.shapes[0].width.max(MIN_WIDTH)
    }

    /// The likely shape of a text of `width` bytes whose name ends with `last`.
    #[inline]
    pub(super) fn guess(&self, width: usize, last: u8) -> &Shape {
        &self.shapes[usize::from(self.first_try[slot(width, last)]) % SHAPES]
    }

    /// Any shape that `text` starts with.
    #[cold]
    #[inline(never)]
    pub(super) fn find(&self, text: &[u8], width: usize) -> Option<&Shape> {
        let mut shapes = self.shapes[..self.learned].iter();
        shapes.find(|shape| shape.width == width && text.starts_with(&shape.text[..width]))
    }

    /// Takes the ten digits of the second from a line; `false` when it has none or they are too many nanoseconds.
    #[cold]
    #[inline(never)]
    pub(super) fn next_second(&mut self, line: &[u8; ROOM]) -> bool {
        let [b'(', digits @ .., b'.'] = &line[..HEAD] else {
            return false;
        };
        if !digits.iter().all(u8::is_ascii_digit) {
            return false;
        }
        let second = digits.iter().fold(0, |second, b| second * 10 + i64::from(b - b'0'));
        if second > MAX_SECOND {
            return false;
        }
        self.head[..HEAD].copy_from_slice(&line[..HEAD]);
        self.second_ns = second * 1_000_000_000;
        true
    }
}

fn slot(width: usize, last: u8) -> usize {
    (usize::from(last) + 5 * width) % 16
}
