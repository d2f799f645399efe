//! The drop counter of a socket: 32 bits that begin with 0 when the socket is made, and wrap around.
#![forbid(unsafe_code)]

/// How far the counter has been told.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Losses {
    seen: u32,
    /// Frames told as lost so far.
    pub total: u64,
}

impl Losses {
    /// What `counter` has on top of all that was told; nothing if it is an older reading.
    pub fn beyond(&self, counter: u32) -> u32 {
        let more = counter.wrapping_sub(self.seen);
        if more > u32::MAX / 2 {
            0
        } else {
            more
        }
    }

    /// The same, told from now on.
    pub fn tell(&mut self, counter: u32) -> u32 {
        let more = self.beyond(counter);
        self.seen = self.seen.wrapping_add(more);
        self.total += u64::from(more);
        more
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_loss_is_told_once() {
        let mut losses = Losses::default();
        assert_eq!([0, 3, 3, 5].map(|counter| losses.tell(counter)), [0, 3, 0, 2]);
        assert_eq!((losses.beyond(9), losses.beyond(5), losses.total), (4, 0, 5));
    }

    #[test]
    fn the_counter_wraps() {
        let mut losses = Losses {
            seen: u32::MAX - 1,
            total: 1 << 32,
        };
        assert_eq!([u32::MAX, 2, 2].map(|counter| losses.tell(counter)), [1, 3, 0]);
        assert_eq!(losses.total, (1 << 32) + 4);
    }

    #[test]
    fn an_older_reading_says_nothing_new() {
        let mut losses = Losses::default();
        losses.tell(7);
        assert_eq!((losses.tell(6), losses.tell(8)), (0, 1));
    }
}
