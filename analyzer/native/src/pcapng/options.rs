//! The options at the end of a block: code, length, value, filled up to 4 bytes.
#![forbid(unsafe_code)]

use crate::binary::Order;

/// Code and value of each option up to the end mark, the end, or one that is cut.
pub struct Options<'a> {
    rest: &'a [u8],
    order: Order,
}

impl<'a> Options<'a> {
    pub fn new(rest: &'a [u8], order: Order) -> Options<'a> {
        Options { rest, order }
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
