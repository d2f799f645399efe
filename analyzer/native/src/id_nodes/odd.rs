//! Transfers whose ID does not follow: which of these steps are breaches, and what is known of each.
#![forbid(unsafe_code)]

use super::step::{Rule, Step, ID, QUIET, SERVICE};
use crate::frames::NO_TIME;
use crate::orphans::{Orphans, Place};
use crate::transfers::anomaly;
use crate::wire::Kind;

/// Bit of the identifier of a request.
const ASKS: i64 = 1 << 15;
/// Of several that a transfer has, the first says what it is.
const RULES: [(u32, Rule); 4] = [
    (anomaly::ID_GAP, Rule::Gap),
    (anomaly::DUPLICATE, Rule::Copied),
    (anomaly::ID_REPEATED, Rule::Repeated),
    (anomaly::ID_RESTARTED, Rule::Restarted),
];

/// A message or request and its step. `resumed` is since when frames have come without a gap, `lead` its first frame, `gap`
/// the time since the transfer before, 0 for none.
#[derive(Clone, Copy, Debug)]
pub struct Odd {
    pub anomaly: u32,
    pub kind: u8,
    pub bus: u8,
    pub src: u8,
    pub dst: u8,
    pub id: u8,
    pub step: u8,
    pub type_id: u16,
    pub t: i64,
    pub gap: i64,
    pub resumed: i64,
    pub code: i64,
    pub lead: i64,
    pub row: u32,
}

/// Whether the ID of a first frame is asked for, and that of the one before it in its session.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Asked {
    pub own: bool,
    pub before: bool,
}

/// The IDs that they should have, if they have others.
pub type Meant = (Option<u8>, Option<u8>);

impl Odd {
    fn session(&self) -> i64 {
        let (bus, src, type_id) = (i64::from(self.bus), i64::from(self.src), i64::from(self.type_id));
        let what = if self.kind == Kind::Message as u8 {
            type_id << 8
        } else {
            let to = if self.kind == Kind::Request as u8 { self.dst } else { 0 };
            type_id << 16 | ASKS | i64::from(to) << 8 | SERVICE
        };
        what | src | bus << 32
    }

    /// The step if it is a breach, without its frames; `start` is when its bus began.
    ///
    /// After a silence only a gap is one, and no copy without times. Where frames came astray, an ID that a first frame
    /// has wrong is put right: `meant` says how.
    ///
    /// # Errors
    /// What `meant` fails with.
    pub fn step<E>(
        &self,
        orphans: &Orphans,
        start: i64,
        meant: impl FnOnce(Asked) -> Result<Meant, E>,
    ) -> Result<Option<Step>, E> {
        let known = RULES.iter().find(|(bit, _)| self.anomaly & bit != 0);
        let (rule, late) = known.map_or((Rule::Gap, true), |&(_, rule)| (rule, false));
        let timed = self.t != NO_TIME;
        let since = if timed { self.t.wrapping_sub(self.gap) } else { self.t };
        if (!timed && rule == Rule::Copied) || (timed && since < self.resumed) {
            return Ok(None);
        }
        let session = self.session();
        let place = |since, number| Place { session, since, number };
        let asked = Asked {
            own: orphans.behind(&place(self.t, self.lead)),
            before: orphans.before(&place(since, self.lead + 1)),
        };
        let (mut id, mut before) = (self.id, self.id.wrapping_sub(self.step) & ID);
        if asked.own || asked.before {
            let (own, other) = meant(asked)?;
            let right = (own.unwrap_or(id), other.unwrap_or(before));
            if right.0 != right.1 {
                (id, before) = right;
            }
        }
        let expected = (before + 1) & ID;
        if id == expected || (late && (id == 0 || id == before)) {
            return Ok(None);
        }
        let lost = id.wrapping_sub(expected) & ID;
        Ok(Some(Step {
            rule,
            late,
            early: timed && self.t.wrapping_sub(start) < QUIET,
            astray: matches!(rule, Rule::Gap | Rule::Restarted)
                && orphans.cover(&place(since, self.lead), expected, lost),
            t: self.t,
            since,
            gap: self.gap,
            code: self.code,
            place: session,
            id,
            before,
            row: self.row,
            frames: Box::default(),
        }))
    }
}

#[cfg(test)]
mod tests {
    use std::convert::Infallible;

    use super::{anomaly, Asked, Kind, Meant, Odd, Orphans, Rule, Step, NO_TIME, QUIET};
    use crate::orphans::Frame;

    const ODD: Odd = Odd {
        anomaly: anomaly::ID_GAP,
        kind: Kind::Message as u8,
        bus: 1,
        src: 5,
        dst: 0,
        id: 9,
        step: 4,
        type_id: 1034,
        t: 10 * QUIET,
        gap: 1000,
        resumed: 0,
        code: 1034,
        lead: 700,
        row: 3,
    };

    fn step(odd: Odd, orphans: &Orphans, meant: Meant) -> Option<Step> {
        let answer = |_: Asked| Ok::<_, Infallible>(meant);
        odd.step(orphans, 0, answer).unwrap_or_default()
    }

    fn plain(odd: Odd) -> Option<Step> {
        step(odd, &Orphans::default(), (Some(1), Some(2)))
    }

    #[test]
    fn a_step_is_told_with_its_session_and_the_ids_around_it() {
        let found = plain(ODD).expect("a gap");
        assert_eq!((found.rule, found.id, found.before), (Rule::Gap, 9, 5));
        assert_eq!(found.place, 1 << 32 | 1034 << 8 | 5);
        assert_eq!(found.since, ODD.t - 1000);
        assert!(!found.late && !found.early && !found.astray);
        let (kind, dst) = (Kind::Request as u8, 7);
        let asked = plain(Odd { kind, dst, ..ODD }).expect("a gap");
        assert_eq!(asked.place, 1 << 32 | 1034 << 16 | 1 << 15 | 7 << 8 | 0x80 | 5);
        let t = QUIET - 1;
        assert!(plain(Odd { t, ..ODD }).is_some_and(|one| one.early));
    }

    #[test]
    fn silences_and_what_has_no_time_show_less() {
        let resumed = ODD.t;
        assert_eq!(plain(Odd { resumed, ..ODD }), None, "the one before came before a gap");
        let late = Odd { anomaly: 0, ..ODD };
        assert!(plain(late).is_some_and(|one| one.late));
        assert_eq!(plain(Odd { id: 0, ..late }), None);
        assert_eq!(plain(Odd { step: 0, ..late }), None);
        assert!(plain(Odd { step: 0, ..ODD }).is_some());
        assert_eq!(plain(Odd { step: 1, ..ODD }), None, "it follows");
        let copy = Odd {
            anomaly: anomaly::DUPLICATE | anomaly::ID_RESTARTED,
            ..ODD
        };
        assert!(plain(copy).is_some_and(|one| one.rule == Rule::Copied));
        assert_eq!(plain(Odd { t: NO_TIME, ..copy }), None);
        assert!(plain(Odd { t: NO_TIME, ..ODD }).is_some_and(|one| one.since == NO_TIME && !one.early));
    }

    #[test]
    fn frames_astray_say_which_ids_were_meant_or_missing() {
        let mut orphans = Orphans::default();
        for (k, id) in [6, 7, 8].into_iter().enumerate() {
            let (number, t) = (690 + k as i64, ODD.t - 500);
            orphans.add(1 << 32 | 1034 << 8 | 5, Frame { number, t, id });
        }
        let lost = step(ODD, &orphans, (None, None)).expect("a gap");
        assert!(lost.astray, "all of 6, 7, 8 came without a start");
        let right = step(ODD, &orphans, (Some(20), None)).expect("a gap");
        assert_eq!((right.id, right.before, right.astray), (20, 5, false));
        assert_eq!(
            step(ODD, &orphans, (None, Some(8))),
            None,
            "it follows the one that was meant"
        );
        let same = step(ODD, &orphans, (None, Some(9))).expect("a gap");
        assert_eq!(same.before, 5, "none is like the one before it");
    }
}
