//! The options at the end of a block: code, length, value, filled up to 4 bytes.
#![forbid(unsafe_code)]

use crate::binary::Order;

/// What somebody wrote, an option of every block.
const COMMENT: u16 = 1;
/// Bytes of comments that are kept.
const MAX_COMMENT: usize = 4096;

/// Code and value of each option up to the end mark, the end, or one that is cut.
pub struct Options<'a> {
    rest: &'a [u8],
    order: Order,
}

impl<'a> Options<'a> {
    pub fn new(rest: &'a [u8], order: Order) -> Options<'a> {
        Options { rest, order }
    }

    /// All comments, one below the other.
    pub fn comments(self) -> Option<String> {
        let comments = self.filter(|(code, value)| *code == COMMENT && !value.is_empty());
        let texts: Vec<_> = comments.map(|(_, value)| String::from_utf8_lossy(value)).collect();
        let mut whole = texts.join("\n");
        whole.truncate(whole.floor_char_boundary(MAX_COMMENT));
        (!whole.is_empty()).then_some(whole)
    }
}

impl<'a> Iterator for Options<'a> {
    type Item = (u16, &'a [u8]);

    fn next(&mut self) -> Option<(u16, &'a [u8])> {
        let (head, rest) = self.rest.split_at_checked(4)?;
        let (code, length) = (self.order.u16(head, 0), usize::from(self.order.u16(head, 2)));
        let value = rest.get(..length).filter(|_| code != 0)?;
        self.rest = rest.get(length.next_multiple_of(4)..).unwrap_or_default();
        Some((code, value))
    }
}
