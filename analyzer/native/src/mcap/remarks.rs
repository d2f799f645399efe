//! Messages that are no frames, in channels of our own writer: comments, and counts of lost frames.
#![forbid(unsafe_code)]

use super::{ros, Channel, Kind, Read, Wire};
use crate::candump::REMARK;
use crate::line::{escape, Reason};
use crate::reader::Rows;

impl Channel {
    /// Adds the event of a message. The last 4 bytes of the data of a drop count are the number of frames.
    ///
    /// # Errors
    /// The reason why it is none.
    pub(super) fn remark(&mut self, data: &[u8], log_time: u64, rows: &mut Rows) -> Result<(), Reason> {
        if matches!(self.layout.0, Read::Comments) {
            let (stamp, text) = ros::log(data)?;
            let (t, _) = self.time(stamp, log_time)?;
            rows.comment(t, &escape(text, REMARK));
            return Ok(());
        }
        let message = ros::read(Wire::Cdr, Kind::CanMsgs, data)?;
        let frames = message.can.data.last_chunk().ok_or("no number of lost frames")?;
        let frames = u32::from_le_bytes(*frames);
        let (t, _) = self.time(message.stamp, log_time)?;
        let bus = self.names.bus(message.name, rows)?;
        rows.drops(t, Some(bus), frames, &format!("{frames} frames dropped"));
        Ok(())
    }
}
