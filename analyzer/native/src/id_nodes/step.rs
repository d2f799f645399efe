//! A step of a transfer ID that is not 1, what explains it, and how it is told.
#![forbid(unsafe_code)]

/// IDs are counted by this.
pub const ID: u8 = 31;
const SECOND: i64 = 1_000_000_000;
/// After this any transfer ID may follow (4.1.3).
pub const QUIET: i64 = 2 * SECOND;
/// A transfer can come out 2.0 s after its start; then nothing follows within `QUIET` any more.
pub const LATE: i64 = 5 * SECOND;
/// Steps held back, or to 0, among which others of the same session are looked for.
pub const NEAR: usize = 64;
/// Bit of a session that is one of requests.
pub const SERVICE: i64 = 0x80;

/// The breach that it is, as far as nothing explains it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub enum Rule {
    Gap,
    Copied,
    Repeated,
    Restarted,
}

/// One step, in nanoseconds.
///
/// `place` is the session: the identifier, and above 32 bits the bus; `since` is the time of the transfer before, `gap`
/// the time since then. `late` is one after more than `QUIET`, `early` one soon after the start of the capture, `astray`
/// one whose missing IDs came without a start. `row` is that of the transfer in its batch.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Step {
    pub rule: Rule,
    pub late: bool,
    pub early: bool,
    pub astray: bool,
    pub t: i64,
    pub since: i64,
    pub gap: i64,
    pub code: i64,
    pub place: i64,
    pub id: u8,
    pub before: u8,
    pub row: u32,
    pub frames: Box<[u64]>,
}

impl Step {
    /// Whether it is no request.
    pub fn of_message(&self) -> bool {
        self.place & SERVICE == 0
    }

    /// How far it counts on.
    pub fn skips(&self) -> u8 {
        self.id.wrapping_sub(self.before) & ID
    }

    /// Whether the counter may have begun anew.
    pub fn is_zero(&self) -> bool {
        self.rule == Rule::Restarted || (self.rule == Rule::Repeated && self.id == 0)
    }
}

/// What explains steps of a node, and numbers of it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Explains {
    /// One counter for so many types.
    Types(usize),
    /// Counters of several senders of a type, at these IDs.
    ByTurns(i64, Vec<u8>),
    /// One sender's counter of a type, its ID, and the ID that is always in between.
    GoesOn(i64, u8, Option<u8>),
    /// A counter that wraps from the second ID to the first.
    Wraps(u8, u8),
}

/// That with a time and frames that show it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Cause {
    pub explains: Explains,
    pub t: i64,
    pub frames: Vec<u64>,
}

impl Cause {
    /// Whether several devices send as one node.
    pub fn is_several(&self) -> bool {
        matches!(self.explains, Explains::ByTurns(..) | Explains::GoesOn(..))
    }

    /// Several devices explain every breach of a node, a shared counter those of its messages that are no copies.
    pub fn explains(&self, one: &Step) -> bool {
        match self.explains {
            Explains::ByTurns(..) | Explains::GoesOn(..) => true,
            Explains::Wraps(_, before) => one.rule == Rule::Restarted && one.before == before,
            Explains::Types(_) => one.of_message() && one.rule != Rule::Copied,
        }
    }
}

/// A step that nothing explains.
///
/// One that only changed places with others is told with the frames `behind`; `noted` says that it proves little.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Told {
    pub step: Step,
    pub moved: Option<Moved>,
}

#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Moved {
    pub behind: Box<[u64]>,
    pub noted: bool,
}

impl Told {
    pub fn plain(step: Step) -> Self {
        Told { step, moved: None }
    }
}
