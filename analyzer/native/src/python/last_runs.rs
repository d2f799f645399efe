//! The last run of each key of findings, for Python.

use pyo3::prelude::*;

use super::runs::OccurrenceGroups;
use crate::last_runs::{Beyond, Joins, LastRun};
use crate::runs::{Apart, Piece, Place};

/// The places of the first and the last of some rows, and where these begin and end in the order.
type Told = (Place, Place, usize, usize);

/// Of a group that is left its place among all, the number of its key if that is known, and its pieces.
type LeftPieces = (usize, Option<usize>, Vec<Told>);

/// Counts what goes on with the last runs of keys.
#[pyclass]
#[derive(Clone)]
pub struct LastRuns(crate::last_runs::LastRuns);

#[pymethods]
impl LastRuns {
    /// `most_beyond`: so many that are alike and not kept apart are remembered.
    #[new]
    fn new(most_beyond: usize) -> Self {
        LastRuns(crate::last_runs::LastRuns::new(most_beyond))
    }

    /// Make room for the last run of one more key; return its number.
    fn add(&mut self) -> usize {
        self.0.add()
    }

    /// Occurrences that are `alike` belong to the key with a number if they are of this bus, node, type and key.
    fn know(&mut self, alike: u64, about: (i64, i64, i64, i64), number: usize) {
        self.0.know(alike, about, number);
    }

    /// Nothing that is `alike` will be kept apart of a bus, a node and a type.
    fn leave_out(&mut self, alike: u64, about: (i64, i64, i64)) {
        self.0.leave_out(alike, about);
    }

    /// The key and the first row of each group; `None` for those of which nothing is kept apart.
    #[allow(clippy::needless_pass_by_value)] // arguments from Python arrive by value
    fn keys(&self, groups: PyRef<'_, OccurrenceGroups>, alike: u64) -> Vec<Option<(i64, u32)>> {
        self.0.keys(&groups.0, alike)
    }

    /// The last run of a key is this one: its first and last place, and that of its last example if it has all of them.
    /// `None` if nothing is to be counted.
    fn tell(&mut self, number: usize, run: Option<(Place, Place, Option<Place>)>) {
        let run = run.map(|(first, last, full)| LastRun { first, last, full });
        self.0.tell(number, run);
    }

    /// How many occurrences the last run of a key has more than it had, and its last place; `None` if there are none.
    fn take(&mut self, number: usize) -> Option<(u64, Place)> {
        self.0.take(number)
    }

    /// The numbers of keys of which something was counted since the last call.
    fn take_changed(&mut self) -> Vec<usize> {
        self.0.take_changed()
    }

    /// How often something was counted.
    #[getter]
    fn counted(&self) -> u64 {
        self.0.counted()
    }

    /// Count what goes on with last runs, and return what is left: groups, each with the number of its key if that is
    /// known and its pieces; and the groups that are not kept apart: plain, doubtful, noted ones, and both.
    ///
    /// `keys` stand instead of those of the groups. `joins` are the times that end runs, as with `OccurrenceGroups`, and
    /// whether no time does; without, nothing is counted.
    #[allow(clippy::needless_pass_by_value)] // arguments from Python arrive by value
    fn count(
        &mut self,
        groups: PyRef<'_, OccurrenceGroups>,
        alike: u64,
        keys: Option<Vec<i64>>,
        joins: Option<((i64, i64), bool)>,
    ) -> (Vec<LeftPieces>, Beyond) {
        let (left, beyond) = self.0.count(&groups.0, alike, keys.as_deref(), joins.map(joins_of));
        let each = left.into_iter().map(|one| (one.group, one.known, told(&one.pieces)));
        (each.collect(), beyond)
    }

    /// Count what goes on with the last run of one key, of some groups as if they were one; return the pieces left.
    #[allow(clippy::needless_pass_by_value)] // arguments from Python arrive by value
    fn count_together(
        &mut self,
        mut groups: PyRefMut<'_, OccurrenceGroups>,
        some: Vec<usize>,
        number: usize,
        joins: Option<((i64, i64), bool)>,
    ) -> Vec<Told> {
        let pieces = groups.0.together(&some);
        told(&self.0.left(number, pieces, joins.map(joins_of)))
    }

    /// Another one that grows apart from this.
    fn __deepcopy__(&self, _memo: &Bound<'_, PyAny>) -> Self {
        self.clone()
    }
}

fn told(pieces: &[Piece]) -> Vec<Told> {
    let each = pieces.iter().map(|one| (one.first, one.last, one.begin, one.end));
    each.collect()
}

fn joins_of(((pause, piece), crowded): ((i64, i64), bool)) -> Joins {
    Joins {
        close: Apart { pause, piece },
        crowded,
    }
}
