//! How the tail bytes of one session follow each other, whatever its transfers are worth.
//!
//! A sender with a systematic fault (toggles that never change or begin with 1, starts or ends that are never marked,
//! first or last frames that are never sent) forms no legal transfer at all, yet it still counts: every frame carries
//! the transfer ID of the frame before, or the next one. Frames in a row with one transfer ID are a *group*. What
//! tells groups from the counters of other protocols is how the three flags above the transfer ID go along:
//! * in groups of several frames the flags change within each group and start again with the next one. In a counter,
//!   however slow, they change only when it carries into them;
//! * in groups of one frame, or of frames with the same flags, they stay the same while the transfer ID goes through
//!   all its 32 values and on. Counters of 8, 7 or 6 bits carry into the flags there, and those of 4 bits or less
//!   never come so far. Only a counter of exactly 5 bits looks the same, so a start or an end must be marked.
//!
//! A sender that counts its transfer ID up with every frame has groups of one frame of different forms: see [`Chain`].
#![forbid(unsafe_code)]

use crate::chain::Chain;
use crate::wire::Tail;

/// The flags of a tail byte: start, end, toggle.
const FLAGS: u8 = 0xE0;
const START: u8 = 0x80;
const END: u8 = 0x40;
const START_AND_TOGGLE: u8 = 0xA0;

// As in `trust`, the numbers were chosen for the faulty senders and the counters of `tests/reassembly`; the remarks say
// at which values tried instead one of these tests fails.

/// Groups of one form in a row that are a proof, from a node that is proven otherwise. Too few, and bytes of another
/// protocol are believed by chance; too many, and a node that repeats its fault a few times is foreign. 2 to 6 make no
/// difference to the tests, with 8 short captures of faulty senders are lost.
const GROUPS: usize = 4;
/// The same from any other node, of which nothing but these groups speaks. With 4 as few as from a proven one would do;
/// 6 to 16 make no difference to the tests.
const GROUPS_ALONE: usize = 8;
/// Groups that all have the same flags: clearly more than there are transfer IDs (32), so that counters of 6 bits and
/// more have carried into the flags by then. Up to 31 such counters are believed; 33 to 128 make no difference to the
/// tests, and the more there are, the later a sender of single frames with a fault is believed.
const ROUND: usize = 40;
/// Of so many frames one may be out of turn while a proof is waited for. Too large, and what the recorder lost ends the
/// waiting (16 does); too small, and noise is held back for as long as a legal session: 2 and 4 do so without a test
/// that minds.
const OUT_OF_TURN: usize = 8;
/// At the end of a capture so many single frames that each count up by one may be enough. With 3, frames that count by
/// chance are believed; with 5, captures of four transfers show nothing.
const COUNTED: usize = 4;
/// And so many frames of whole transfers that each count up by one: two transfers of three frames. 3 and 4 pass the
/// tests, too, but a single transfer would do then; with 8 a capture of two transfers shows nothing.
const CHAINED: usize = 6;

/// What the groups of one faulty sender have in common.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Form {
    /// Only the first frame is marked as a start, or only the last as an end; the length may vary.
    Framed { first: u8, ends: bool },
    /// The same frames each time, whose flags are not all alike.
    Repeated { flags: u64 },
    /// So many frames, all with the same flags.
    Uniform { flags: u8, frames: usize },
}

#[derive(Clone, Copy, Debug, Default)]
struct Group {
    frames: usize,
    first: u8,
    last: u8,
    /// The flags of all frames, one after the other, mixed into one number.
    flags: u64,
    changing: bool,
    /// No frame but the first is a start, no frame but the last is an end.
    in_order: bool,
}

impl Group {
    fn begin(flags: u8) -> Self {
        Group {
            frames: 1,
            first: flags,
            last: flags,
            flags: u64::from(flags),
            changing: false,
            in_order: true,
        }
    }

    fn append(&mut self, flags: u8) {
        self.frames += 1;
        self.changing |= flags != self.last;
        self.in_order &= flags & START == 0 && self.last & END == 0;
        self.flags = self.flags.rotate_left(5).wrapping_mul(0x9E37_79B9_7F4A_7C15) ^ u64::from(flags);
        self.last = flags;
    }

    fn form(&self) -> Form {
        let (starts, ends) = (self.first & START != 0, self.last & END != 0);
        if !self.changing {
            Form::Uniform {
                flags: self.first,
                frames: self.frames,
            }
        } else if self.in_order && (starts || ends) {
            Form::Framed {
                first: self.first,
                ends,
            }
        } else {
            Form::Repeated { flags: self.flags }
        }
    }
}

/// What is known of the tail bytes so far, in bounded room.
#[derive(Clone, Debug, Default)]
pub struct Cadence {
    last: Option<u8>,
    /// The last change of the last byte was to one more.
    rose: bool,
    /// Of a counter of more than 5 bits, which rose and then carried into the flags: the most bits that changed.
    carried: u8,
    group: Group,
    chain: Chain,
    /// The form of the last groups that came to an end, and how many in a row had it.
    form: Option<Form>,
    run: usize,
    frames: usize,
    rises: usize,
    breaks: usize,
    /// Framed groups, and all others but the first, which the capture may have cut.
    framed: usize,
    others: usize,
}

impl Cadence {
    /// Begins anew behind one that `carried` so much: what once was a wide counter remains one.
    pub fn anew(carried: u8) -> Self {
        Cadence {
            carried,
            ..Cadence::default()
        }
    }

    pub fn carried(&self) -> u8 {
        self.carried
    }

    pub fn note(&mut self, tail: u8) {
        self.frames += 1;
        let flags = tail & FLAGS;
        let Some(last) = self.last.replace(tail) else {
            self.chain.note(Tail(tail), false);
            self.group = Group::begin(flags);
            return;
        };
        if tail != last {
            let carries = matches!(tail ^ last, 0x3F | 0x7F | 0xFF) && tail & !FLAGS == 0;
            if self.rose && carries {
                self.carried = self.carried.max(tail ^ last);
            }
            self.rose = tail == last.wrapping_add(1);
        }
        let step = Tail(tail).transfer_id().wrapping_sub(Tail(last).transfer_id()) & 31;
        self.chain.note(Tail(tail), step == 1);
        match step {
            0 => self.group.append(flags),
            1 => {
                self.close();
                self.rises += 1;
                self.group = Group::begin(flags);
            }
            _ => {
                self.breaks += 1;
                (self.form, self.run) = (None, 0);
                self.group = Group::begin(flags);
            }
        }
    }

    fn close(&mut self) {
        let form = self.group.form();
        self.run = if self.form == Some(form) { self.run + 1 } else { 1 };
        self.form = Some(form);
        let framed = matches!(form, Form::Framed { .. });
        self.framed += usize::from(framed);
        self.others += usize::from(!framed && self.rises > 0);
    }

    /// The last bytes are a counter of more than 5 bits.
    pub fn is_wide_counter(&self) -> bool {
        self.carried > 0
    }

    /// And one that carries on into the marks of start and end, where no transfer ID comes that overflows.
    pub fn carries_into_marks(&self) -> bool {
        self.carried & (START | END) != 0
    }

    /// Whether it is worth while to wait for a proof.
    pub fn promising(&self) -> bool {
        let in_turn = self.breaks * OUT_OF_TURN <= self.frames;
        let begun = self.group.changing && self.group.in_order;
        in_turn && (self.rises > 0 || begun) && !self.is_wide_counter()
    }

    /// Whether only a sender of transfers leaves such tail bytes. Where toggles begin with 1, as in Cyphal, where
    /// starts and ends are out of order, and where every frame counts, the sender must be known as a node that speaks
    /// DroneCAN.
    pub fn proves(&self, source_is_known: bool) -> bool {
        if source_is_known && self.chain.whole() >= GROUPS && !self.is_wide_counter() {
            return true;
        }
        let Some(form) = self.form else {
            return false;
        };
        let (first, marked, needed) = match form {
            Form::Framed { first, .. } if source_is_known => (first, true, GROUPS),
            Form::Framed { first, .. } => (first, true, GROUPS_ALONE),
            Form::Repeated { .. } => (0, false, GROUPS),
            Form::Uniform { flags, .. } if flags & (START | END) != 0 => (flags, true, ROUND),
            // The counter of another protocol may come from the address of a node.
            Form::Uniform { .. } => return false,
        };
        let own = marked && first & START_AND_TOGGLE != START_AND_TOGGLE;
        self.run >= needed && (source_is_known || own) && !self.is_wide_counter()
    }

    /// At the end of a capture, of a node that speaks DroneCAN: whether all that came has the form of transfers, or of
    /// frames that each count up by one.
    pub fn suits(&self) -> bool {
        if self.breaks > 0 || self.is_wide_counter() {
            return false;
        }
        let last = self.group.form();
        let whole = matches!(last, Form::Framed { first, ends: true } if first & START != 0);
        let framed = if self.rises == 0 { whole } else { self.framed > 0 };
        let single = matches!(last, Form::Uniform { flags, frames: 1 } if flags & (START | END) != 0);
        let counted = single && self.form == Some(last) && self.run == self.rises;
        let chained = self.chain.whole() > 0 && self.chain.unbroken() >= CHAINED;
        chained || (framed && self.others == 0) || (counted && self.frames == self.run + 1 && self.frames >= COUNTED)
    }
}
