//! Occurrences of a rule by what they are of, and which of these follow each other without a pause.
#![forbid(unsafe_code)]

/// All that keeps findings of a rule apart; `noted`: lost frames may explain it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct About {
    pub bus: i64,
    pub node: i64,
    pub type_: i64,
    pub noted: bool,
    pub doubtful: bool,
    pub key: i64,
}

/// Time and frame.
pub type Place = (i64, i64);

/// What ends a piece, in ns: a longer pause, and a time that can be divided by `piece`, unless that is 0.
#[derive(Clone, Copy, Debug)]
pub struct Apart {
    pub pause: i64,
    pub piece: i64,
}

impl Apart {
    fn begins(self, before: i64, t: i64) -> bool {
        let other = self.piece > 0 && before.div_euclid(self.piece) != t.div_euclid(self.piece);
        other || t.wrapping_sub(before) > self.pause
    }
}

/// Rows that belong to one run: the places of the first and the last, and where they begin and end in the order.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Piece {
    pub first: Place,
    pub last: Place,
    pub begin: usize,
    pub end: usize,
}

/// Rows of occurrences by group: those of one group stand together in the order, by place.
#[derive(Debug)]
pub struct Groups {
    place: Vec<Place>,
    order: Vec<u32>,
    spans: Vec<(About, usize, usize)>,
    apart: Apart,
}

impl Groups {
    /// One row for each pair; they come in the order of what they are about.
    pub fn of(about: &[About], place: Vec<Place>, apart: Apart) -> Self {
        let mut order: Vec<u32> = (0..about.len().min(place.len()) as u32).collect();
        order.sort_by_key(|&row| about[row as usize]);
        let mut spans: Vec<(About, usize, usize)> = vec![];
        for (at, &row) in order.iter().enumerate() {
            let mine = about[row as usize];
            match spans.last_mut() {
                Some((same, _, end)) if *same == mine => *end += 1,
                _ => spans.push((mine, at, at + 1)),
            }
        }
        for &(_, begin, end) in &spans {
            by_place(&place, &mut order[begin..end]);
        }
        Groups {
            place,
            order,
            spans,
            apart,
        }
    }

    /// What each group is about, and its first row.
    pub fn each(&self) -> impl Iterator<Item = (About, u32)> + '_ {
        self.spans.iter().map(|&(about, begin, _)| (about, self.order[begin]))
    }

    /// What a group is about, and its first row; none if there is no such group.
    pub fn group(&self, group: usize) -> Option<(About, u32)> {
        let span = self.spans.get(group);
        span.map(|&(about, begin, _)| (about, self.order[begin]))
    }

    /// The pieces of a group; none if there is no such group.
    pub fn pieces(&self, group: usize) -> Vec<Piece> {
        let span = self.spans.get(group);
        span.map_or_else(Vec::new, |&(_, begin, end)| self.cut(begin, end))
    }

    /// The pieces of some groups as if they were one; their rows stand in the order, too, from then on.
    pub fn together(&mut self, groups: &[usize]) -> Vec<Piece> {
        let begin = self.order.len();
        for &(_, first, end) in groups.iter().filter_map(|&at| self.spans.get(at)) {
            self.order.extend_from_within(first..end);
        }
        by_place(&self.place, &mut self.order[begin..]);
        self.cut(begin, self.order.len())
    }

    /// Rows at some places in the order.
    pub fn rows(&self, begin: usize, end: usize) -> &[u32] {
        self.order.get(begin..end).unwrap_or_default()
    }

    fn cut(&self, begin: usize, end: usize) -> Vec<Piece> {
        let place = |at: usize| self.place[self.order[at] as usize];
        let mut found: Vec<Piece> = vec![];
        for at in begin..end {
            let here = place(at);
            match found.last_mut() {
                Some(piece) if !self.apart.begins(piece.last.0, here.0) => {
                    piece.last = here;
                    piece.end = at + 1;
                }
                _ => found.push(Piece {
                    first: here,
                    last: here,
                    begin: at,
                    end: at + 1,
                }),
            }
        }
        found
    }
}

/// Puts rows by place; those at one place stay as they are.
fn by_place(place: &[Place], rows: &mut [u32]) {
    let of = |&row: &u32| place[row as usize];
    if !rows.is_sorted_by_key(of) {
        rows.sort_by_key(of);
    }
}

#[cfg(test)]
pub mod tests {
    use super::{About, Apart, Groups, Piece, Place};

    const APART: Apart = Apart { pause: 10, piece: 0 };

    /// Of a type of a node on the first bus.
    pub fn of(node: i64, key: i64) -> About {
        About {
            bus: 0,
            node,
            type_: 7,
            noted: false,
            doubtful: false,
            key,
        }
    }

    fn rows(groups: &Groups, pieces: &[Piece]) -> Vec<Vec<u32>> {
        let each = pieces.iter().map(|one| groups.rows(one.begin, one.end).to_vec());
        each.collect()
    }

    fn told(groups: &Groups) -> Vec<(i64, i64, u32, Vec<Vec<u32>>)> {
        let each = groups.each().enumerate();
        let told = each.map(|(at, (about, row))| (about.node, about.key, row, rows(groups, &groups.pieces(at))));
        told.collect()
    }

    #[test]
    fn rows_of_a_group_come_by_place_and_a_pause_ends_a_piece() {
        let about = [of(5, 1), of(3, 2), of(5, 1), of(3, 1), of(5, 1)];
        let place = vec![(30, 1), (0, 2), (20, 9), (0, 4), (9, 7)];
        let groups = Groups::of(&about, place, APART);
        assert_eq!(
            told(&groups),
            vec![
                (3, 1, 3, vec![vec![3]]),
                (3, 2, 1, vec![vec![1]]),
                (5, 1, 4, vec![vec![4], vec![2, 0]]),
            ]
        );
        let pieces = groups.pieces(2);
        assert_eq!((pieces[1].first, pieces[1].last), ((20, 9), (30, 1)));
    }

    #[test]
    fn several_groups_together_are_in_one_order() {
        let about = [of(5, 1), of(3, 2), of(5, 1), of(4, 1)];
        let mut groups = Groups::of(&about, vec![(30, 1), (0, 2), (20, 9), (20, 9)], APART);
        let pieces = groups.together(&[2, 0, 9]);
        assert_eq!(rows(&groups, &pieces), vec![vec![1], vec![2, 0]]);
        let pieces = groups.together(&[1, 2]);
        assert_eq!(rows(&groups, &pieces), vec![vec![3, 2, 0]]); // at one place the first group comes first
        assert_eq!((told(&groups).len(), groups.pieces(3)), (3, vec![]));
    }

    #[test]
    fn a_piece_ends_where_its_time_does() {
        let begins = |apart: Apart, t: &[i64]| -> Vec<usize> {
            let place: Vec<Place> = t.iter().map(|&t| (t, 0)).collect();
            let groups = Groups::of(&vec![of(1, 1); t.len()], place, apart);
            groups.pieces(0).iter().map(|one| one.begin).collect()
        };
        let piece = Apart { pause: 10, piece: 10 };
        assert_eq!(begins(piece, &[-11, -10, -1, 0, 9, 10]), vec![0, 1, 3, 5]);
        assert_eq!(begins(APART, &[-11, -10, -1, 0, 9, 10]), vec![0]);
        assert_eq!(begins(APART, &[0, 10, 21]), vec![0, 2]);
        assert_eq!(begins(APART, &[i64::MIN, i64::MAX]), vec![0]); // no time is near any other one
    }
}
