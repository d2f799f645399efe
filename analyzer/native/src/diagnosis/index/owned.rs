//! Columns that belong to a test.
#![forbid(unsafe_code)]

use super::{Columns, Hold};

#[derive(Debug, Default)]
pub struct Owned {
    pub t: Vec<i64>,
    pub bus: Vec<u8>,
    pub id: Vec<u32>,
    pub flags: Vec<u16>,
    pub offsets: Vec<i32>,
    pub data: Vec<u8>,
}

impl Hold for Owned {
    fn columns(&self) -> Columns<'_> {
        Columns {
            t: &self.t,
            bus: &self.bus,
            id: &self.id,
            flags: &self.flags,
            offsets: &self.offsets,
            data: &self.data,
        }
    }
}
