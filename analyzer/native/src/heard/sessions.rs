//! Transfers of message types as they begin, by session.
#![forbid(unsafe_code)]

use std::collections::HashMap;

use super::by_session::Sent;
use crate::seeded::Seeded;
use crate::session_code::is_service;
use crate::wire::Tail;

/// Transfers as they begin, one session after the other: how many of each, and of all their sessions the places.
#[derive(Debug, Default, PartialEq, Eq)]
pub struct Begun {
    pub codes: Vec<i64>,
    pub place: Vec<i64>,
    pub size: Vec<i64>,
    pub t: Vec<i64>,
    pub number: Vec<i64>,
    pub lost: Vec<i64>,
}

/// Of the last frame of a session: whether a transfer goes on behind it, its ID, and how many were left out.
#[derive(Clone, Copy, Debug, Default)]
struct Session {
    goes_on: bool,
    id: Option<u8>,
    lost: i64,
    proved: bool,
}

/// Follows the frames of each message type of a node, of the first `most` of these.
#[derive(Clone, Debug)]
pub struct Sessions {
    places: HashMap<i64, usize, Seeded>,
    known: Vec<Session>,
    most: usize,
    unproved: usize,
}

impl Sessions {
    pub fn new(most: usize) -> Self {
        Sessions {
            places: HashMap::default(),
            known: vec![],
            most,
            unproved: 0,
        }
    }

    /// Takes the frames of a bus; None if the columns do not fit together.
    pub fn feed(&mut self, sent: &Sent<'_>) -> Option<Begun> {
        if !sent.fits() {
            return None;
        }
        let mut begun = Begun::default();
        let mut new = self.admitted(sent).into_iter().peekable();
        for (k, &code) in sent.codes.iter().enumerate() {
            let place = match self.places.get(&code) {
                Some(&place) => place,
                None if new.next_if_eq(&k).is_some() => self.add(code),
                None => continue,
            };
            let (one, before) = (&mut self.known[place], begun.t.len());
            let mut begins = !one.goes_on;
            for at in sent.places(k) {
                let (row, tail) = (sent.row[at], Tail(sent.tail[at]));
                if begins || tail.start() {
                    let id = tail.transfer_id();
                    let left_out = |last| i64::from(Tail(id.wrapping_sub(last)).transfer_id().max(1) - 1);
                    one.lost += one.id.map_or(0, left_out);
                    one.id = Some(id);
                    begun.t.push(sent.t[row as usize]);
                    begun.number.push(sent.number + row);
                    begun.lost.push(one.lost);
                }
                begins = tail.end();
            }
            one.goes_on = !begins;
            if begun.t.len() > before {
                begun.codes.push(code);
                begun.place.push(place as i64);
                begun.size.push((begun.t.len() - before) as i64);
            }
        }
        Some(begun)
    }

    /// Sessions that are new and for which there is room: those that were heard first, whatever their nodes and types,
    /// in order.
    fn admitted(&self, sent: &Sent<'_>) -> Vec<usize> {
        let room = self.most - self.known.len();
        if room == 0 {
            return vec![];
        }
        let unknown = |&k: &usize| !is_service(sent.codes[k]) && !self.places.contains_key(&sent.codes[k]);
        let mut new: Vec<usize> = (0..sent.codes.len()).filter(unknown).collect();
        if new.len() > room {
            new.sort_unstable_by_key(|&k| sent.heard(k));
            new.truncate(room);
            new.sort_unstable();
        }
        new
    }

    fn add(&mut self, code: i64) -> usize {
        let place = self.known.len();
        self.places.insert(code, place);
        self.known.push(Session::default());
        self.unproved += 1;
        place
    }

    /// Takes the sessions of transfers and the codes of their types: the place and the type of each session that had none,
    /// in the order of sessions, by its first transfer.
    pub fn prove(&mut self, transfers: impl Iterator<Item = (i64, i64)>) -> Vec<(i64, i64)> {
        if self.unproved == 0 {
            return vec![];
        }
        let mut found = vec![];
        for (code, kind) in transfers {
            let Some(&place) = self.places.get(&code) else {
                continue;
            };
            let one = &mut self.known[place];
            if !one.proved {
                one.proved = true;
                self.unproved -= 1;
                found.push((code, place as i64, kind));
            }
        }
        found.sort_unstable();
        found.into_iter().map(|(_, place, kind)| (place, kind)).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::{Sent, Sessions};
    use crate::session_code::of_service;

    const ONE: u8 = 0xC0; // a transfer of one frame, but for its ID

    /// Frames of sessions, each behind the other; rows count up.
    fn feed(sessions: &mut Sessions, some: &[(i64, &[u8])]) -> (Vec<i64>, Vec<i64>, Vec<i64>, Vec<i64>) {
        let tail: Vec<u8> = some.iter().flat_map(|one| one.1).copied().collect();
        let row: Vec<i64> = (0..tail.len() as i64).collect();
        let mut first = vec![0];
        first.extend(some.iter().scan(0, |end, one| {
            *end += one.1.len() as i64;
            Some(*end)
        }));
        let codes: Vec<i64> = some.iter().map(|one| one.0).collect();
        let place: Vec<i64> = row.iter().rev().copied().collect(); // the last one was heard first
        let t: Vec<i64> = row.iter().map(|row| 10 * row).collect();
        let (row, tail, first, codes) = (&row[..], &tail[..], &first[..], &codes[..]);
        let sent = Sent {
            row,
            tail,
            place: &place,
            first,
            codes,
            t: &t,
            number: 100,
        };
        let begun = sessions.feed(&sent).unwrap();
        assert_eq!(
            begun.t,
            begun.number.iter().map(|one| 10 * (one - 100)).collect::<Vec<_>>()
        );
        (begun.place, begun.size, begun.number, begun.lost)
    }

    #[test]
    fn transfers_begin_at_starts_and_behind_ends() {
        let mut sessions = Sessions::new(8);
        let (place, size, number, lost) = feed(
            &mut sessions,
            &[(5, &[ONE, ONE | 1, 0x80 | 4, 0x20 | 4]), (3, &[0x05, 0x40 | 5, 0x06])],
        );
        assert_eq!((place, size), (vec![0, 1], vec![3, 2]));
        assert_eq!((number, lost), (vec![100, 101, 102, 104, 106], vec![0, 0, 2, 0, 0]));
        let (place, size, number, lost) = feed(&mut sessions, &[(3, &[0x46]), (5, &[0x44, 0x47]), (7, &[ONE])]);
        assert_eq!((place, size), (vec![0, 2], vec![1, 1]), "those of 3 go on");
        assert_eq!((number, lost), (vec![102, 103], vec![4, 0]));
    }

    #[test]
    fn those_heard_first_find_room() {
        let mut sessions = Sessions::new(2);
        assert_eq!(feed(&mut sessions, &[(1, &[ONE])]).0, [0]);
        assert_eq!(
            feed(
                &mut sessions,
                &[
                    (1, &[ONE]),
                    (2, &[ONE]),
                    (3, &[ONE]),
                    (of_service(0, 1, 1, true, 2), &[ONE])
                ]
            )
            .0,
            [0, 1]
        );
        assert_eq!(sessions.prove([(2, 7), (3, 8)].into_iter()), [(1, 8)]);
    }

    #[test]
    fn sessions_are_proved_by_their_first_transfer() {
        let mut sessions = Sessions::new(8);
        feed(&mut sessions, &[(1, &[ONE]), (2, &[ONE])]);
        assert_eq!(
            sessions.prove([(2, 9), (1, 6), (1, 5), (3, 1)].into_iter()),
            [(0, 6), (1, 9)]
        );
        assert!(sessions.prove([(2, 4)].into_iter()).is_empty());
    }

    #[test]
    fn columns_have_to_fit() {
        let sent = Sent {
            row: &[0],
            tail: &[],
            place: &[0],
            first: &[0],
            codes: &[],
            t: &[0],
            number: 0,
        };
        assert!(Sessions::new(1).feed(&sent).is_none());
        let beyond = Sent {
            row: &[1],
            tail: &[ONE],
            place: &[0],
            first: &[0, 1],
            codes: &[0],
            t: &[0],
            number: 0,
        };
        assert!(Sessions::new(1).feed(&beyond).is_none());
    }
}
