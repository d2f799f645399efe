//! The sum that accounts for every line or record.
#![forbid(unsafe_code)]

/// What became of the lines or records so far: `lines` is the sum of all the others but `dropped`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Counts {
    pub lines: u64,
    pub frames: u64,
    pub error_frames: u64,
    /// Lines that state a drop count.
    pub drops: u64,
    pub comments: u64,
    pub blank: u64,
    pub unreadable: u64,
    /// Sound records that have nothing to do with CAN.
    pub other: u64,
    /// Frames that another capture of the same bus holds too.
    pub repeated: u64,
    /// Frames that the drop counts report as lost.
    pub dropped: u64,
}

impl Counts {
    /// Adds what became of further records.
    pub fn add(&mut self, more: &Counts) {
        self.lines += more.lines;
        self.frames += more.frames;
        self.error_frames += more.error_frames;
        self.drops += more.drops;
        self.comments += more.comments;
        self.blank += more.blank;
        self.unreadable += more.unreadable;
        self.other += more.other;
        self.repeated += more.repeated;
        self.dropped += more.dropped;
    }

    /// What came on top of `earlier` counts of the same capture.
    #[must_use]
    pub fn since(&self, earlier: &Counts) -> Counts {
        Counts {
            lines: self.lines - earlier.lines,
            frames: self.frames - earlier.frames,
            error_frames: self.error_frames - earlier.error_frames,
            drops: self.drops - earlier.drops,
            comments: self.comments - earlier.comments,
            blank: self.blank - earlier.blank,
            unreadable: self.unreadable - earlier.unreadable,
            other: self.other - earlier.other,
            repeated: self.repeated - earlier.repeated,
            dropped: self.dropped - earlier.dropped,
        }
    }
}
