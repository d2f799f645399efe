"""Runs of occurrences: those that follow each other without a pause are one.

Where another finding may explain a part of them, they are kept in pieces of some seconds until it is known which.
"""

from __future__ import annotations

from bisect import bisect_left, insort
from typing import TYPE_CHECKING, NamedTuple

from dissectors.frame_text import FrameText
from dissectors.kit import SECOND
from dissectors.records import dataclass, field

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Sequence

    from analyzer.decode.places import Places
    from analyzer.rules.catalogue import Page
    from analyzer.rules.found.episodes import Episode

    Close = Callable[["OccurrenceRun", tuple[int, int]], bool]

PAUSE = 10 * SECOND  # a run ends when this time passes without an occurrence
PIECE = 10 * SECOND
_PAST = 60 * SECOND  # after so long no cause is found any more
MOST_EXAMPLES = 20
RICH = 500  # runs that are told with all their examples, the first ones in the capture; the others have one
MOST_RUNS = 100  # of one rule, node, type and key; later ones belong to the last


class Shown(NamedTuple):
    """One occurrence to show, ordered by place. `frames` are its evidence, numbers from 0."""

    t: int
    frame: int
    text: str
    cause: str
    frames: tuple[int, ...]
    lines: tuple[str, ...]

    def placed(self, places: Places) -> Shown:
        """Return it with the places in the capture of frames that were picked from there; in its text, too."""
        text = self.text.moved(places.of) if isinstance(self.text, FrameText) else self.text
        return self._replace(frame=places.of(self.frame), text=text, frames=tuple(map(places.of, self.frames)))


@dataclass(slots=True)
class OccurrenceRun:
    """Occurrences of one key without a pause of 10 s. Places are (t, frame). `text` is what is said of an episode.

    `most` is how many examples it may have; one that goes on with another adds none to these.
    """

    first: tuple[int, int]
    last: tuple[int, int]
    count: int
    examples: list[Shown] = field(default_factory=list)
    episode: Episode | None = None
    text: str = ""
    most: int = MOST_EXAMPLES

    def copy(self, examples: int = MOST_EXAMPLES) -> OccurrenceRun:
        """Return one that grows apart from this, with so many of its examples."""
        episode = None if self.episode is None else self.episode.copy()
        shown = self.examples[:examples]
        return OccurrenceRun(self.first, self.last, self.count, shown, episode, self.text, self.most)

    def placed(self, places: Places) -> OccurrenceRun:
        """Return it with the places in the capture of frames that were picked from there."""
        found = self.copy()
        found.first, found.last = ((t, places.of(frame)) for t, frame in (self.first, self.last))
        found.examples = [one.placed(places) for one in self.examples]
        return found

    def take(self, other: OccurrenceRun) -> None:
        """Join another run of the same key."""
        if self.episode is not None and other.episode is not None:
            earlier, after = sorted((self, other), key=lambda run: run.first)
            between = after.first[0] - earlier.last[0]
            self.episode.take(other.episode, between, later=self.first <= other.first)
        self.first, self.last = min(self.first, other.first), max(self.last, other.last)
        self.count += other.count
        self.most = min(self.most + other.most, MOST_EXAMPLES)
        for example in other.examples:
            insort(self.examples, example)
        del self.examples[self.most :]


def merge(runs: list[OccurrenceRun], run: OccurrenceRun, close: Close) -> None:
    """Put a run among others, in order of time; those that are close become one."""
    if not runs:
        runs.append(run)
        return
    behind = runs[-1].first < run.first  # as nearly always
    at = len(runs) if behind else bisect_left(runs, run.first, key=lambda one: one.first)
    runs.insert(at, run)
    if at and close(runs[at - 1], run.first):
        runs[at - 1].take(run)
        del runs[at]
        at -= 1
    while at + 1 < len(runs) and close(runs[at], runs[at + 1].first):
        runs[at].take(runs.pop(at + 1))
    if len(runs) > MOST_RUNS:
        last = runs.pop()
        runs[-1].take(last)


def absorb(runs: list[OccurrenceRun], run: OccurrenceRun) -> None:
    """Put a run into the last of others that begins before it, or into the first, whatever the pause between."""
    at = max(bisect_left(runs, run.first, key=lambda one: one.first) - 1, 0)
    runs[at].take(run)
    while at + 1 < len(runs) and runs[at + 1].first <= runs[at].last:
        runs[at].take(runs.pop(at + 1))


def without_pause(one: OccurrenceRun, first: tuple[int, int]) -> bool:
    """Return whether a run and another, which begins at a place after its own first, are one."""
    return first[0] - one.last[0] <= PAUSE


def same_piece(one: OccurrenceRun, first: tuple[int, int]) -> bool:
    """Return whether a run and another, which begins at a place after its own first, are one piece."""
    return first[0] // PIECE <= one.last[0] // PIECE


def closeness(page: Page) -> Close:
    """Return what makes one run of two of a rule: nothing but a pause, unless a part of them may be explained."""
    return same_piece if page.explained else without_pause


def joined(pieces: Sequence[OccurrenceRun], causes: Iterable[OccurrenceRun]) -> list[OccurrenceRun]:
    """Return pieces of which those long past are put together that follow each other and have a cause, or have none."""
    past, causes = pieces[-1].last[0] - _PAST, list(causes)
    found: list[tuple[OccurrenceRun, bool]] = []
    for piece in pieces:
        explained = any(meets(cause, piece) for cause in causes)
        before = found[-1] if found else None
        if before and piece.last[0] < past and before[1] == explained and without_pause(before[0], piece.first):
            before[0].take(piece)
        else:
            found.append((piece, explained))
    return [piece for piece, _ in found]


def is_full(run: OccurrenceRun, place: tuple[int, int]) -> bool:
    """Return whether a run has all the examples it may have, and these before a place."""
    return len(run.examples) == run.most and run.examples[-1][:2] < place


def meets(one: OccurrenceRun, other: OccurrenceRun) -> bool:
    """Return whether two runs are at the same time, or nearly."""
    return max(one.first[0], other.first[0]) - min(one.last[0], other.last[0]) <= PAUSE
