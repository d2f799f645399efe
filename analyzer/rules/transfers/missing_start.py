"""Rests of transfers whose start is missing: their later frames together are one occurrence."""

from __future__ import annotations

from itertools import pairwise
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from analyzer._native import Firsts, Remainders
from analyzer.decode.sent import cells
from analyzer.rules.diagnosis.budgets import KnownCauses, SearchBudget, alike, shapes_of
from analyzer.rules.diagnosis.causes import FIRST, FIRSTS, FORMS, LOST_SEVERAL, NOT_SEARCHED, NOTHING
from analyzer.rules.diagnosis.search import REMAINDER, FrameLists, ask
from analyzer.rules.recent import MOST_LINES
from analyzer.rules.transfers.lists import picked
from analyzer.rules.transfers.open_frames import OpenFrames
from analyzer.tables import FD, TAIL_ID
from dissectors.kit import NO_TIME, SECOND, Occurrence, Occurrences, all_resumed

if TYPE_CHECKING:
    from collections.abc import Callable, Generator, Iterator

    from analyzer.rules.diagnosis.causes import Cause
    from analyzer.rules.transfers.loose_frames import LooseFrames
    from dissectors.kit import Array, Severity, Values, View

# What a sender that was busy as the capture began explains.
_LOSSES = np.array([form.what in {FIRST, FIRSTS, LOST_SEVERAL, NOT_SEARCHED} for form in FORMS])
TIMEOUT = 2 * SECOND
MOST_OPEN = 4096
MOST_FRAMES = 64  # of one remainder that are named
MOST_EARLY = 4096  # remainders that may be excused, until the session shows whether it goes on like that
_WHAT_BITS = 8  # below a session
_HABIT = 3  # of them that no busy moment explains
_NEVER = (1 << 63) - 1  # the time and the number of what did not come


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
        found: Array = np.logical_or.reduceat(self.frames.kept != 0, self.offsets[:-1])
        return found

    def numbers(self, k: int) -> list[int]:
        """Return the frames of one."""
        found: list[int] = self.frames.number[self.offsets.item(k) : self.offsets.item(k + 1)].tolist()
        return found

    def lines(self, view: View, k: int) -> tuple[str, ...]:
        """Return the lines of one that are kept, and of its frames that are still there."""
        low, high, known = self.offsets.item(k), self.offsets.item(k + 1), self.frames.lines
        if high - low <= MOST_LINES and (known is None or not known[low:high].any()):  # mostly
            return view.lines(self.numbers(k))
        return tuple(filter(None, self.frames.look_up(view, np.arange(low, high))))

    def lists(self, rows: Array) -> FrameLists:
        """Return the frames of some."""
        first, (offsets, places) = self.offsets[rows], picked(self.offsets, rows)
        fd = self.frames.flags[first] & FD != 0
        return FrameLists(self.frames.number[places], offsets, self.frames.code[first], fd)


class _Excused(NamedTuple):
    """One that a busy sender may explain, until the session shows whether it goes on like that."""

    t: int
    bus: int
    node: int
    type: str
    frames: tuple[int, ...]
    tail: int
    what: str
    detail: str
    lines: tuple[str, ...]

    def occurrence(self, severity: Severity | None) -> Occurrence:
        """Return it as a breach."""
        t, bus, node, type_, frames, tail, what, detail, lines = self
        return Occurrence(
            "TRF-005", t, bus, None if node < 0 else node, type_, frames, _values(tail, what, detail),
            severity=severity, drops=True, lines=lines,
        )  # fmt: skip


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
        return _values(self.first.tail.item(k), FORMS[self.what.item(k)].what, self.cause(k).detail)

    def excused(self, view: View, rows: Array) -> Iterator[_Excused]:
        """Yield some, with their lines."""
        first, (offsets, places) = self.first.take(rows), picked(self.of.offsets, rows)
        numbers, lines = self.of.frames.number[places].tolist(), self.of.frames.look_up(view, places)
        columns = (first.t, first.bus, first.node, first.code, first.tail, self.what[rows])
        each = zip(*(column.tolist() for column in columns), map(self.cause, rows.tolist()), strict=True)
        for (low, high), (t, bus, node, code, tail, what, cause) in zip(pairwise(offsets.tolist()), each, strict=True):
            frames, kept = tuple(numbers[low:high]), tuple(filter(None, lines[low:high]))
            yield _Excused(t, bus, node, view.type_name(code), frames, tail, FORMS[what].what, cause.detail, kept)

    def occurrences(self, view: View, rows: Array, *, kept: bool) -> Iterator[Occurrences]:
        """Yield some together; the lines are `kept` of all if their frames may be gone."""
        if not len(rows):
            return
        _, first, which = np.unique(self.what[rows], return_index=True, return_inverse=True)
        key = np.argsort(np.argsort(first))[which]  # as they come
        early = self.early[rows]
        for noted in dict.fromkeys(early.tolist()):
            some = (early == noted).nonzero()[0]
            severity: Severity | None = "note" if noted else None
            yield self._alike(view, rows[some], key[some], severity, kept=kept)

    def _alike(self, view: View, rows: Array, key: Array, severity: Severity | None, *, kept: bool) -> Occurrences:
        """Return some of one severity."""
        first = self.first.take(rows)
        return Occurrences(
            rule="TRF-005", t=first.t, bus=first.bus, node=first.node, type=first.code, frame=first.number,
            values=lambda k: self.values(rows.item(k)), frames=lambda k: self.of.numbers(rows.item(k)),
            key=key, key_values=lambda k: {"cause": FORMS[self.what.item(rows.item(k))].what},
            severity=severity, drops=True, each_named=True,
            lines=(lambda k: self.of.lines(view, rows.item(k))) if kept else None,
        )  # fmt: skip


class MissingStart:
    """Puts orphans together, in the order of their numbers.

    Args:
        begun: time and first frame of each session's first transfer.
    """

    def __init__(self, begun: Firsts) -> None:
        self._begun = begun
        self._remainders = Remainders(MOST_OPEN, MOST_FRAMES, TIMEOUT)
        self._open = OpenFrames()
        self._orphaned = Firsts(MOST_OPEN)
        self._early_ones: dict[int, list[_Excused]] = {}  # by session and what is missing
        self._excused = 0
        self._budget = SearchBudget()
        self._causes = KnownCauses()

    def feed(self, view: View) -> None:
        """Keep the frames of remainders that were open before this batch: they may be gone when these are told."""
        self._open.keep_lines(view)

    def excused(self) -> Iterator[Occurrence]:
        """Yield those that were held back to the end."""
        for held in self._early_ones.values():
            yield from (one.occurrence("note") for one in held)

    def add(self, view: View, orphans: LooseFrames, together: list[Occurrences], *, last: bool) -> Iterator[Occurrence]:
        """Add more orphans; tell of remainders that can get no more `together`, and yield what was held back before.

        No more frames will come if these are the `last` ones.
        """
        if not len(orphans) and not last:
            return
        self._orphaned.add(orphans.session, orphans.t, orphans.number)
        closed = self._closed(orphans, last=last)
        if len(closed.received):
            yield from self._told(view, closed, together)

    def _closed(self, orphans: LooseFrames, *, last: bool) -> _Remainders:
        """Return the remainders that can get no more frames, with these orphans, as they are closed."""
        made = self._remainders.add(orphans.session, orphans.t, orphans.tail, orphans.size, last)
        slots, ended, offsets, received = (cells(column, np.int64) for column in made)
        named = (slots >= 0).nonzero()[0]
        self._open.put(slots[named], orphans if len(named) == len(slots) else orphans.take(named))
        return _Remainders(self._open.take(ended), offsets, received)

    def _told(self, view: View, closed: _Remainders, together: list[Occurrences]) -> Iterator[Occurrence]:
        told = self._searched(view, closed)
        what, early = told.what, told.early
        wanted = what != NOTHING
        if view.cut_in:
            wanted &= ~(early & self._first(told.first))
        old = closed.old | (closed.sizes > MOST_LINES)
        if early.any() or self._early_ones:
            old |= yield from self._going_on(view, told, wanted)
        for kept in (False, True):
            together += told.occurrences(view, (wanted & (old == kept)).nonzero()[0], kept=kept)

    def _going_on(self, view: View, told: _Told, wanted: Array) -> Generator[Occurrence, None, Array]:
        """Hold back those that are excused, which are `wanted` no more, and yield those whose sessions go on like that.

        Return a mask of those with which they do.
        """
        goes_on, rows = np.zeros(len(wanted), bool), wanted.nonzero()[0]
        kinds, early = told.first.session[rows] << _WHAT_BITS | told.what[rows], told.early[rows]
        held: list[int] = []
        steps: list[tuple[int, bool]] = []  # kinds, and whether one more of each is held back
        waiting: dict[int, int] = {}  # how many of each kind are held back then
        known = self._early_ones
        for k, kind, is_early in zip(rows.tolist(), kinds.tolist(), early.tolist(), strict=True):
            has_room = is_early and self._excused < MOST_EARLY
            if not has_room and kind not in waiting and kind not in known:
                continue  # mostly
            count = waiting[kind] if kind in waiting else len(known.get(kind, ()))
            if has_room:
                self._excused += 1
                waiting[kind] = count + 1
                held.append(k)
                steps.append((kind, True))
            elif count:
                self._excused -= count
                waiting[kind] = 0
                goes_on[k] = True
                steps.append((kind, False))
        wanted[held] = False
        excused = told.excused(view, np.array(held, np.int64))
        for kind, is_held in steps:
            if is_held:
                self._early_ones.setdefault(kind, []).append(next(excused))
                continue
            ended = self._early_ones.pop(kind)
            # What goes on is no moment in which the sender was busy.
            severity: Severity | None = None if len(ended) >= _HABIT else "note"
            yield from (one.occurrence(severity) for one in ended)
        return goes_on

    def _searched(self, view: View, closed: _Remainders) -> _Told:
        """Return what is missing of each; nothing of one whose frames belong to a transfer that says so itself."""
        first = closed.first
        senders, shapes = first.senders, shapes_of(closed.sizes, closed.received)
        searched = self._budget.take(senders)
        rows, others = searched.nonzero()[0], (~searched).nonzero()[0]
        found = ask(view, REMAINDER, closed.lists(rows))
        there = (~found.gone).nonzero()[0]
        noted = rows[there]
        self._causes.note_all(senders[noted], shapes[noted], found.kinds[there])
        what = np.empty(len(senders), np.int64)
        what[rows], what[others] = found.kinds, self._causes.like_all(senders[others], shapes[others])
        at = np.full(len(senders), -1)
        at[rows] = np.arange(len(rows))

        def cause(k: int) -> Cause:
            place = at.item(k)
            return alike(FORMS[what.item(k)].what) if place < 0 else found.cause(place)

        early = _LOSSES[what]
        early[early] = self._early(view, first.take(early))
        return _Told(closed, first, what, cause, early)

    def _first(self, frames: LooseFrames) -> Array:
        """Return which are the first that was heard of their session: of a window that is where the window begins."""
        _, lead = _found(self._begun, frames)
        orphaned, _ = _found(self._orphaned, frames)
        found: Array = (frames.number < lead) & (orphaned == frames.t)
        return found

    def _early(self, view: View, frames: LooseFrames) -> Array:
        """Return whether a sender may have been busy as the session, the capture, or the part behind a gap began."""
        if not len(frames):
            return np.zeros(0, bool)
        t, (began, lead), (heard, _) = frames.t, _found(self._begun, frames), _found(self._orphaned, frames)
        heard = np.where(heard == _NEVER, t, heard)
        heard = np.where(began != NO_TIME, np.minimum(heard, began), heard)
        started = t.copy()
        for bus, start in view.starts.items():
            started[frames.bus == bus] = start
        since = np.maximum(np.maximum(started, heard), all_resumed(view, t))
        return np.where(t == NO_TIME, frames.number <= lead, t - since <= TIMEOUT)


def _values(tail: int, what: str, detail: str) -> Values:
    return {"transfer_id": tail & TAIL_ID, "cause": what, "detail": detail}


def _found(firsts: Firsts, frames: LooseFrames) -> tuple[Array, Array]:
    """Return time and frame of what came first of sessions."""
    t, number = firsts.find(frames.session, _NEVER, _NEVER)
    return cells(t, np.int64), cells(number, np.int64)
