//! Whose traffic a session is turns out: what it held back is handed on, or is foreign. See [`crate::trust`].
#![forbid(unsafe_code)]

use super::{Early, Reassembler, Standing, Trial, MAX_HELD, NOBODY, REMOTE_FRAME, SPEAKERS};
use crate::slot::Frame;
use crate::transfers::Sink as _;
use crate::trust::{Judgement, Kept};
use crate::verdict::{frame_anomaly, Outcome, Verdict};
use crate::wire::Kind;

impl Reassembler {
    /// End of capture: what is still open becomes evidence too. No frame may follow: nothing is known of any session.
    pub fn finish(&mut self) {
        // What turns out to be anonymous after all is heard before the last word on the anonymous.
        for nameless in [true, false] {
            for at in 0..self.sessions.len() {
                if self.sessions[at].id().is_nameless() == nameless {
                    self.close(at);
                    // Noise leaves ten thousands of them: what is made of the first frames of each is large.
                    self.sessions[at].standing = Standing::Foreign;
                }
            }
        }
    }

    fn close(&mut self, at: usize) {
        let speaks = self.speakers[self.speaker(at)];
        self.rouse(at);
        match &mut self.sessions[at].standing {
            Standing::Trusted(session) => session.finish(self.now, &mut self.staged),
            Standing::Foreign | Standing::Early(_) => {}
            Standing::Probation(trial) => {
                let Trial { probation, session } = &mut **trial;
                session.finish(self.now, &mut probation.transfers);
                let judgement = probation.last_word(session, speaks);
                let note = probation.note_of_refusal();
                let last = probation.held.last().map(|held| held.frame);
                let kept = std::mem::take(&mut probation.kept);
                self.settle(at, judgement);
                if judgement == Judgement::Foreign {
                    if let (Some(frame), 1.., true) = (last, note, kept.is_empty()) {
                        self.report(frame, Outcome::with(Verdict::Foreign, note));
                    }
                    self.give_back(at, &kept);
                }
            }
        }
    }

    /// A frame of a session that has not proven itself.
    #[cold]
    pub(super) fn probe(&mut self, at: usize, frame: &Frame<'_>, remote: bool) -> Outcome {
        let speaks = self.speakers[self.speaker(at)];
        let early = self.rouse(at);
        let standing = &mut self.sessions[at].standing;
        let Standing::Probation(trial) = standing else {
            return Outcome::FOREIGN;
        };
        let (outcome, reported) = trial.hear(frame, remote);
        let Trial { probation, session } = &mut **trial;
        let mut judgement = probation.judge(session, speaks);
        self.held += 1;
        let full = self.held > MAX_HELD && judgement == Judgement::Wait;
        if full {
            judgement = Judgement::Foreign;
        }
        if judgement == Judgement::Wait {
            if let Some(early) = early.and_then(|early| early.and(frame, remote)) {
                if let Standing::Probation(trial) = std::mem::replace(standing, Standing::Early(early)) {
                    self.spare(trial);
                }
            }
            return Outcome {
                verdict: reported,
                anomaly: if reported == outcome.verdict {
                    outcome.anomaly
                } else {
                    0
                },
            };
        }
        // The frame at hand is reported by the caller, all others are settled.
        probation.held.pop();
        self.held -= 1;
        let note = probation.note_of_refusal() | (u16::from(full) * frame_anomaly::LIMIT);
        let kept = std::mem::take(&mut probation.kept);
        self.settle(at, judgement);
        if judgement == Judgement::Believe {
            return outcome;
        }
        kept.split_last()
            .map_or(Outcome::with(Verdict::Foreign, note), |(last, before)| {
                self.give_back(at, before);
                self.hear_again(at, last)
            })
    }

    /// Ends a probation: hands on what was held back, or forgets it.
    fn settle(&mut self, at: usize, judgement: Judgement) {
        let believed = judgement == Judgement::Believe;
        let speaker = self.speaker(at);
        let standing = &mut self.sessions[at].standing;
        let Standing::Probation(mut trial) = std::mem::replace(standing, Standing::Foreign) else {
            return;
        };
        let Trial { probation, session } = &mut *trial;
        if !believed && session.is_known() {
            // It may still turn up where another protocol used its identifier before.
            *standing = Standing::Early(Early::new(Some(probation.doubt())));
        }
        self.held -= probation.held.len();
        for held in &probation.held {
            let outcome = if believed { held.outcome } else { Outcome::FOREIGN };
            self.correct(held.frame, held.reported, outcome);
        }
        if !believed {
            self.spare(trial);
            return;
        }
        self.speakers[speaker] = true;
        if let (Some(asked), false) = (&mut self.asked, probation.transfers.is_empty()) {
            session.asked = asked(session.id);
        }
        for row in probation.transfers.rows() {
            self.staged.push(&row);
        }
        self.sessions[at].standing = Standing::Trusted(Box::new(trial.session));
    }

    pub(super) fn correct(&mut self, frame: u64, reported: Verdict, outcome: Outcome) {
        if reported == outcome.verdict {
            return;
        }
        self.counts[reported as usize] -= 1;
        self.counts[outcome.verdict as usize] += 1;
        self.report(frame, outcome);
    }

    /// The last word on a frame: in its row, or if that is gone, among the settled.
    pub(super) fn report(&mut self, frame: u64, outcome: Outcome) {
        let results = &mut self.results;
        if let Some(row) = frame.checked_sub(results.first_frame) {
            results.verdict[row as usize] = outcome.verdict as u8;
            results.anomaly[row as usize] |= outcome.anomaly;
        } else {
            results.settled.frame.push(frame);
            results.settled.verdict.push(outcome.verdict as u8);
            results.settled.anomaly.push(outcome.anomaly);
        }
    }

    /// Place of the session's source node in `speakers`; of an anonymous one that of nobody.
    fn speaker(&self, at: usize) -> usize {
        let place = &self.sessions[at];
        let id = place.id();
        let node = match id.kind {
            Kind::Anonymous => NOBODY,
            _ if id.src == 0 => id.dst,
            _ => id.src,
        };
        usize::from(place.bus) * SPEAKERS + usize::from(node)
    }
}

impl Trial {
    /// Takes one more frame; what became of it, and the verdict to report for now.
    pub(super) fn hear(&mut self, frame: &Frame<'_>, remote: bool) -> (Outcome, Verdict) {
        let Trial { probation, session } = self;
        let outcome = if remote {
            REMOTE_FRAME
        } else {
            session.accept(frame, &mut probation.transfers)
        };
        let tail = if remote { None } else { frame.data.last().copied() };
        let nameless = session.id.is_nameless();
        if nameless {
            probation.kept.push(Kept::of(frame, remote));
        }
        let reported = probation.note(frame.number, outcome, tail, session.is_known() && !nameless);
        (outcome, reported)
    }
}
