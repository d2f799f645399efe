//! Sessions of which few frames have come, as noise opens them by the ten thousands, at first or since they were
//! foreign: the frames are all that is kept of them. What else there is to know follows from these, and is made of them
//! again whenever a further one comes.
#![forbid(unsafe_code)]

use super::{Reassembler, Standing, Trial};
use crate::frames::MAX_CLASSIC;
use crate::session::Session;
use crate::slot::{elapsed, Frame, TIMEOUT_NS};
use crate::trust::{Doubt, Probation};
use crate::wire::Id;

/// Sessions of more frames are kept as what was made of them. Too few, and noise takes the room of senders; too many,
/// and what is made again takes its time.
const MOST: usize = 8;

/// The first frames of a session.
pub(super) struct Early {
    frames: Vec<EarlyFrame>,
    /// It was foreign before them.
    doubt: Option<Doubt>,
    /// All that these began has timed out.
    expired: bool,
}

/// A frame in as little room as it needs.
struct EarlyFrame {
    number: u64,
    t: i64,
    id: u32,
    data: [u8; MAX_CLASSIC],
    size: u8,
    fd: bool,
    remote: bool,
    /// What so many frames from the first on began timed out before the next frame came.
    expired: u8,
}

impl EarlyFrame {
    /// None when there is no room for its data.
    fn of(frame: &Frame<'_>, remote: bool) -> Option<Self> {
        let mut data = [0; MAX_CLASSIC];
        data.get_mut(..frame.data.len())?.copy_from_slice(frame.data);
        Some(EarlyFrame {
            number: frame.number,
            t: frame.t,
            id: frame.id,
            data,
            size: frame.data.len() as u8,
            fd: frame.fd,
            remote,
            expired: 0,
        })
    }

    fn frame(&self) -> Frame<'_> {
        Frame {
            number: self.number,
            t: self.t,
            id: self.id,
            fd: self.fd,
            data: &self.data[..usize::from(self.size)],
        }
    }
}

impl Early {
    /// Of no frame yet.
    pub(super) fn new(doubt: Option<Doubt>) -> Self {
        Early {
            frames: vec![],
            doubt,
            expired: false,
        }
    }

    /// With one frame more; none where it is to be kept as what was made of it.
    pub(super) fn and(mut self, frame: &Frame<'_>, remote: bool) -> Option<Early> {
        // Of times that go backwards, not the first frames but any would have timed out.
        let ordered = self.frames.last().is_none_or(|last| last.t <= frame.t);
        if self.frames.len() >= MOST || !ordered {
            return None;
        }
        self.frames.reserve_exact(1);
        self.frames.push(EarlyFrame::of(frame, remote)?);
        self.expired = false;
        Some(self)
    }

    pub(super) fn oldest(&self) -> Option<u64> {
        self.frames.iter().map(|frame| frame.number).min()
    }

    /// Notes that the capture has come to the time `now`.
    pub(super) fn expire(&mut self, now: i64) {
        if self.expired {
            return;
        }
        let old = |frame: &EarlyFrame| elapsed(frame.t, now) > TIMEOUT_NS;
        let count = self.frames.iter().rposition(old).map_or(0, |last| last + 1);
        self.expired = count == self.frames.len();
        if let Some(last) = self.frames.last_mut() {
            last.expired = last.expired.max(count as u8);
        }
    }

    /// Makes of the frames what was made of them when they came: no proof.
    fn hear_in(&self, trial: &mut Trial) {
        for one in &self.frames {
            trial.hear(&one.frame(), one.remote);
            trial.probation.wait();
            if let Some(first) = usize::from(one.expired).checked_sub(1) {
                let now = self.frames[first].t.saturating_add(TIMEOUT_NS + 1);
                trial.session.expire(now, &mut trial.probation.transfers);
            }
        }
    }
}

impl Reassembler {
    /// Makes what follows from the first frames of a session, if these are all that is kept; returns them.
    pub(super) fn rouse(&mut self, at: usize) -> Option<Early> {
        let place = &mut self.sessions[at];
        let (bus, bits) = (place.bus, place.bits);
        let Standing::Early(early) = &mut place.standing else {
            return None;
        };
        let early = std::mem::replace(early, Early::new(None));
        let id = Id::of_session(bits);
        let known = self.known(id);
        let mut trial = if let Some(mut spare) = self.spare.take() {
            spare.session.renew(id, bus, known);
            spare
        } else {
            let (probation, session) = (Probation::default(), Session::new(id, bus, known));
            Box::new(Trial { probation, session })
        };
        trial.probation.renew(early.doubt);
        early.hear_in(&mut trial);
        self.sessions[at].standing = Standing::Probation(trial);
        Some(early)
    }

    /// Keeps the room of a trial that is over; not that of many frames, for whose trial it is next may last.
    pub(super) fn spare(&mut self, trial: Box<Trial>) {
        if trial.probation.held.len() <= MOST {
            self.spare = Some(trial);
        }
    }
}
