//! Transfers that changed places: nothing is missing.
#![forbid(unsafe_code)]

use std::collections::VecDeque;

use super::step::{Moved, Step, Told, ID, NEAR};

/// Transfers that changed places with each other.
pub const MOST_MOVED: u8 = 8;

/// Takes the oldest step out of those held, with the two behind it that transfers in another order cause.
pub fn oldest(held: &mut VecDeque<Step>) -> Option<Told> {
    let first = held.pop_front()?;
    let near = held.iter().take(NEAR).enumerate();
    let mut after = near.filter(|(_, one)| one.place == first.place).map(|(at, _)| at);
    let (second, third) = (after.next(), after.next());
    if let (Some(second), Some(third)) = (second, third) {
        if changed([&first, &held[second], &held[third]]) {
            let late = first.late || held[second].late || held[third].late;
            let noted = first.early || late;
            held.remove(third);
            let behind = held.remove(second).map(|one| one.frames).unwrap_or_default();
            let moved = Some(Moved { behind, noted });
            return Some(Told { step: first, moved });
        }
    }
    Some(Told::plain(first))
}

/// Whether three steps of a session, the next ones that are not 1 each, only swap two neighbouring groups.
///
/// Of 5, 7, 6, 8 they are (5, 7), (7, 6), (6, 8): nothing is missing.
fn changed([one, two, three]: [&Step; 3]) -> bool {
    let moved = two.before.wrapping_sub(one.before) & ID;
    (2..=MOST_MOVED).contains(&moved)
        && two.id == (one.before + 1) & ID
        && three.before == one.id.wrapping_sub(1) & ID
        && three.id == (two.before + 1) & ID
}
