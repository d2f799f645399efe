"""Rests of transfers whose start is missing: their later frames together are one occurrence."""

from __future__ import annotations

from functools import partial
from itertools import pairwise
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from analyzer._native import Remainders
from analyzer.decode.sent import cells
from analyzer.rules.bus.keyed import KeyedRows
from analyzer.rules.diagnosis.budgets import KnownCauses, SearchBudget, alike, shapes_of
from analyzer.rules.diagnosis.causes import FIRST, FIRSTS, FORMS, LOST_SEVERAL, NOT_SEARCHED, NOTHING
from analyzer.rules.diagnosis.search import REMAINDER, FrameLists, ask
from analyzer.rules.recent import MOST_LINES
from analyzer.rules.transfers.lists import picked
from analyzer.rules.transfers.loose_frames import LooseFrames
from analyzer.tables import FD, TAIL_ID
from dissectors.kit import NO_TIME, SECOND, Occurrence, Occurrences, all_resumed
from dissectors.records import replace

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence

    from analyzer.rules.diagnosis.causes import Cause
    from dissectors.kit import Array, Severity, Values, View

# What a sender that was busy as the capture began explains.
_LOSSES = np.array([form.what in {FIRST, FIRSTS, LOST_SEVERAL, NOT_SEARCHED} for form in FORMS])
TIMEOUT = 2 * SECOND
MOST_OPEN = 4096
MOST_FRAMES = 64  # of one remainder that are named
MOST_EARLY = 4096  # remainders that may be excused, until the session shows whether it goes on like that
_WHAT_BITS = 8  # below a session
_HABIT = 3  # of them that no busy moment explains


class _Remainders(NamedTuple):
    """Remainders that were closed, a row each: where its `frames` begin and end that are named, and all bytes of it."""

    frames: LooseFrames
    offsets: Array
    received: Array

    @property
    def first(self) -> LooseFrames:
        """The first frame of each."""
        return self.frames.take(self.offsets[:-1])

    @property
    def sizes(self) -> Array:
        """How many frames of each are named."""
        return np.diff(self.offsets)

    @property
    def old(self) -> Array:
        """A mask of those with frames that may be gone."""
        found: Array = np.logical_or.reduceat(self.frames.kept, self.offsets[:-1])
        return found

    def numbers(self, k: int) -> list[int]:
        """Return the frames of one."""
        found: list[int] = self.frames.number[self.offsets.item(k) : self.offsets.item(k + 1)].tolist()
        return found

    def lines(self, view: View, rows: Array) -> list[tuple[str, ...]]:
        """Return the lines of some."""
        offsets, places = picked(self.offsets, rows)
        kept = self.frames.lines[places]
        new = (~self.frames.kept[places]).nonzero()[0]
        kept[new] = view.each_line(self.frames.number[places[new]])
        every = kept.tolist()
        return [tuple(filter(None, every[low:high])) for low, high in pairwise(offsets.tolist())]

    def lists(self, rows: Array) -> FrameLists:
        """Return the frames of some."""
        first, (offsets, places) = self.offsets[rows], picked(self.offsets, rows)
        fd = self.frames.flags[first] & FD != 0
        return FrameLists(self.frames.number[places], offsets, self.frames.code[first], fd)


class _Told(NamedTuple):
    """Remainders and their first frames, what is missing of each, and whether a busy sender explains it.

    What is missing is a place in `FORMS`, the cause makes it more exact.
    """

    of: _Remainders
    first: LooseFrames
    what: Array
    cause: Callable[[int], Cause]
    early: Array

    def values(self, k: int) -> Values:
        """Return what is said of one."""
        transfer_id, what = self.first.tail.item(k) & TAIL_ID, FORMS[self.what[k]].what
        return {"transfer_id": transfer_id, "cause": what, "detail": self.cause(k).detail}

    def severity(self, k: int) -> Severity | None:
        """Return what stands instead of the severity of the rule."""
        return "note" if self.early[k] else None

    def occurrence(self, view: View, k: int, lines: tuple[str, ...]) -> Occurrence:
        """Return one with its lines."""
        first = self.first
        t, node, code = (column.item(k) for column in (first.t, first.node, first.code))
        (bus, _), frames = first.whose(k), self.of.numbers(k)
        return Occurrence(
            "TRF-005", t, bus, None if node < 0 else node, view.type_name(code), tuple(frames), self.values(k),
            severity=self.severity(k), drops=True, lines=lines,
        )  # fmt: skip

    def occurrences(self, rows: Array, lines: Sequence[tuple[str, ...]] = ()) -> Iterator[Occurrences]:
        """Yield some together; `lines` are those of all if their frames may be gone."""
        _, first, which = np.unique(self.what[rows], return_index=True, return_inverse=True)
        key = np.argsort(np.argsort(first))[which]  # as they come
        early = self.early[rows]
        for noted in dict.fromkeys(early.tolist()):
            some = np.flatnonzero(early == noted)
            found = self._alike(rows[some], key[some])
            yield replace(found, lines=partial(_kept, lines, some)) if lines else found

    def _alike(self, rows: Array, key: Array) -> Occurrences:
        """Return some of one severity."""
        first = self.first.take(rows)
        node, code = first.node.astype(np.int64), first.code.astype(np.int64)
        return Occurrences(
            rule="TRF-005", t=first.t, bus=first.bus, node=node, type=code, frame=first.number,
            values=lambda k: self.values(rows.item(k)), frames=lambda k: self.of.numbers(rows.item(k)),
            key=key, key_values=lambda k: {"cause": FORMS[self.what[rows.item(k)]].what},
            severity=self.severity(rows.item(0)), drops=True, each_named=True,
        )  # fmt: skip


class MissingStart:
    """Puts orphans together, in the order of their numbers.

    Args:
        begun: time and first frame of each session's first transfer.
    """

    def __init__(self, begun: KeyedRows) -> None:
        self._begun = begun
        self._remainders = Remainders(MOST_OPEN, MOST_FRAMES, TIMEOUT)
        # Frames of those that are open, and which one each is of.
        self._open = LooseFrames.none()
        self._of = np.empty(0, np.int64)
        self._orphaned = KeyedRows({"t": NO_TIME}, MOST_OPEN)
        self._early_ones: dict[int, list[Occurrence]] = {}  # by session and what is missing
        self._excused = 0
        self._budget = SearchBudget()
        self._causes = KnownCauses()

    def feed(self, view: View) -> None:
        """Keep the frames of remainders that were open before this batch: they may be gone when these are told."""
        self._open.keep_lines(view, view.frames.first)

    def excused(self) -> Iterator[Occurrence]:
        """Yield those that were held back to the end."""
        for held in self._early_ones.values():
            yield from held

    def add(self, view: View, orphans: LooseFrames, together: list[Occurrences], *, last: bool) -> Iterator[Occurrence]:
        """Add more orphans; tell of remainders that can get no more `together`, and yield what was held back before.

        No more frames will come if these are the `last` ones.
        """
        self._orphaned.add(orphans.session, t=orphans.t)
        closed = self._closed(orphans, last=last)
        if len(closed.received):
            yield from self._told(view, closed, together)

    def _closed(self, orphans: LooseFrames, *, last: bool) -> _Remainders:
        """Return the remainders that can get no more frames, with these orphans, as they are closed."""
        tail, size = orphans.tail.astype(np.int64), orphans.size.astype(np.int64) - 1
        given = self._remainders.add(orphans.session, orphans.t, tail, size)
        of, serials, received = (cells(column, np.int64) for column in given)
        if last:
            rest = self._remainders.close()
            ends = zip((serials, received), (cells(column, np.int64) for column in rest), strict=True)
            serials, received = (np.concatenate(both) for both in ends)
        named = np.flatnonzero(of >= 0)
        frames = LooseFrames(*map(np.concatenate, zip(self._open, orphans.take(named), strict=True)))
        of = np.concatenate((self._of, of[named]))
        order = np.argsort(serials, kind="stable")
        at = np.minimum(np.searchsorted(serials[order], of), max(len(order) - 1, 0))
        rank = order[at] if len(order) else at
        over = serials[rank] == of if len(order) else np.zeros(len(of), bool)
        self._open, self._of = frames.take(~over), of[~over]
        rows = np.flatnonzero(over)
        rows = rows[np.argsort(rank[rows], kind="stable")]
        sizes = np.bincount(rank[rows], minlength=len(serials))
        return _Remainders(frames.take(rows), np.concatenate(((0,), np.cumsum(sizes))), received)

    def _told(self, view: View, closed: _Remainders, together: list[Occurrences]) -> Iterator[Occurrence]:
        told = self._searched(view, closed)
        what, early = told.what, told.early
        wanted = what != NOTHING
        if view.cut_in:
            wanted &= ~(early & self._first(told.first))
        held_back, goes_on = np.zeros(len(what), bool), np.zeros(len(what), bool)
        kinds = told.first.session << _WHAT_BITS | what
        rows, new = np.flatnonzero(wanted), {*kinds[early].tolist()}
        each = zip(rows.tolist(), kinds[rows].tolist(), strict=True)
        rows = np.array([k for k, kind in each if kind in new or kind in self._early_ones], np.int64)
        lines: dict[int, tuple[str, ...]] = {}
        for k, kind, is_early in zip(*(column.tolist() for column in (rows, kinds[rows], early[rows])), strict=True):
            if is_early and self._excused < MOST_EARLY:
                self._excused += 1
                if not lines:  # all of them at once
                    some = rows[early[rows]]
                    lines = dict(zip(some.tolist(), closed.lines(view, some), strict=True))
                self._early_ones.setdefault(kind, []).append(told.occurrence(view, k, lines[k]))
                held_back[k] = True
                continue
            goes_on[k] = kind in self._early_ones
            held = self._early_ones.pop(kind, ())
            self._excused -= len(held)
            # What goes on is no moment in which the sender was busy.
            yield from (replace(one, severity=None) for one in held) if len(held) >= _HABIT else held
        wanted &= ~held_back
        kept = closed.old | (closed.sizes > MOST_LINES) | goes_on
        together += told.occurrences(np.flatnonzero(wanted & ~kept))
        rows = np.flatnonzero(wanted & kept)
        together += told.occurrences(rows, closed.lines(view, rows))

    def _searched(self, view: View, closed: _Remainders) -> _Told:
        """Return what is missing of each; nothing of one whose frames belong to a transfer that says so itself."""
        first = closed.first
        senders, shapes = first.senders, shapes_of(closed.sizes, closed.received)
        searched = self._budget.take(senders)
        rows, others = np.flatnonzero(searched), np.flatnonzero(~searched)
        found = ask(view, REMAINDER, closed.lists(rows))
        there = np.flatnonzero(~found.gone)
        noted = rows[there]
        self._causes.note_all(senders[noted], shapes[noted], found.kinds[there])
        what = np.empty(len(senders), np.int64)
        what[rows], what[others] = found.kinds, self._causes.like_all(senders[others], shapes[others])
        at = np.full(len(senders), -1)
        at[rows] = np.arange(len(rows))

        def cause(k: int) -> Cause:
            return alike(FORMS[what[k]].what) if at.item(k) < 0 else found.cause(at.item(k))

        early = _LOSSES[what]
        early[early] = self._early(view, first.take(early))
        return _Told(closed, first, what, cause, early)

    def _first(self, frames: LooseFrames) -> Array:
        """Return which are the first that was heard of their session: of a window that is where the window begins."""
        begun = self._begun.find(frames.session)
        early = (begun < 0) | (frames.number < self._begun.get("lead", begun))
        orphaned = self._orphaned.find(frames.session)
        found: Array = early & (orphaned >= 0) & (self._orphaned.get("t", orphaned) == frames.t)
        return found

    def _early(self, view: View, frames: LooseFrames) -> Array:
        """Return whether a sender may have been busy as the session, the capture, or the part behind a gap began."""
        t, session = frames.t, frames.session
        begun, orphaned = self._begun.find(session), self._orphaned.find(session)
        began = self._begun.get("t", begun)
        lead = np.where(begun < 0, frames.number, self._begun.get("lead", begun))
        heard = np.where(orphaned < 0, t, self._orphaned.get("t", orphaned))
        heard = np.where(began != NO_TIME, np.minimum(heard, began), heard)
        started = t.copy()
        for bus, start in view.starts.items():
            started[frames.bus == bus] = start
        since = np.maximum(np.maximum(started, heard), all_resumed(view, t))
        return np.where(t == NO_TIME, frames.number <= lead, t - since <= TIMEOUT)


def _kept(lines: Sequence[tuple[str, ...]], rows: Array, k: int) -> tuple[str, ...]:
    row: int = rows.item(k)
    return lines[row]
