"""Rests of transfers whose start is missing: their later frames together are one occurrence."""

from __future__ import annotations

from functools import partial
from itertools import chain
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from analyzer.rules.diagnosis.budgets import KnownCauses, SearchBudget, alike, senders_of
from analyzer.rules.diagnosis.causes import FIRST, FIRSTS, FORMS, LOST_SEVERAL, NOT_SEARCHED
from analyzer.rules.diagnosis.search import REMAINDER, FrameLists, ask
from analyzer.rules.recent import MOST_LINES
from analyzer.tables import FD, TAIL_END, TAIL_ID
from dissectors.kit import NO_TIME, SECOND, Occurrence, Occurrences, all_resumed
from dissectors.records import dataclass, replace

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Mapping, Sequence

    from analyzer.rules.diagnosis.causes import Cause
    from analyzer.rules.transfers.loose_frames import LooseFrames
    from dissectors.kit import Array, Severity, Values, View

_LOSSES = {FIRST, FIRSTS, LOST_SEVERAL, NOT_SEARCHED}  # what a sender that was busy as the capture began explains
TIMEOUT = 2 * SECOND
MOST_OPEN = 4096
MOST_FRAMES = 64  # of one remainder that are named
MOST_EARLY = 4096  # remainders that may be excused, until the session shows whether it goes on like that
_HABIT = 3  # of them that no busy moment explains


@dataclass(slots=True)
class _Remainder:
    """Frames of one session and transfer ID; `first` are the cells of the first one."""

    transfer_id: int
    first: tuple[int, ...]
    latest: int
    received: int
    frames: list[int]
    lines: tuple[str, ...] = ()


class _Remainders(NamedTuple):
    """Remainders that were closed, in columns: what came of each, where its frames stand, cells of the first one."""

    transfer_id: Array
    received: Array
    lines: Sequence[tuple[str, ...]]
    offsets: Array
    numbers: Array
    number: Array
    session: Array
    t: Array
    bus: Array
    node: Array
    code: Array
    flags: Array

    @classmethod
    def of(cls, each: Sequence[_Remainder]) -> _Remainders:
        """Return them in columns."""
        transfer_id, received = np.array([(one.transfer_id, one.received) for one in each], np.int64).T
        sizes = np.fromiter((len(one.frames) for one in each), np.int64, len(each))
        numbers = np.fromiter(chain.from_iterable(one.frames for one in each), np.int64, int(sizes.sum()))
        cells = np.fromiter(chain.from_iterable(one.first for one in each), np.int64).reshape(len(each), -1).T.copy()
        lines = [one.lines for one in each]
        return cls(transfer_id, received, lines, np.concatenate(((0,), np.cumsum(sizes))), numbers, *cells)

    @property
    def sizes(self) -> Array:
        """How many frames of each are named."""
        return np.diff(self.offsets)

    def frames(self, k: int) -> list[int]:
        """Return the frames of one."""
        found: list[int] = self.numbers[self.offsets.item(k) : self.offsets.item(k + 1)].tolist()
        return found

    def first(self, k: int) -> tuple[int, int, int]:
        """Return number, session and time of the first frame of one."""
        return self.number.item(k), self.session.item(k), self.t.item(k)

    def lists(self, rows: Array) -> FrameLists:
        """Return the frames of some."""
        sizes = self.sizes[rows]
        offsets = np.concatenate(((0,), np.cumsum(sizes)))
        places = np.arange(offsets[-1]) + np.repeat(self.offsets[rows] - offsets[:-1], sizes)
        return FrameLists(self.numbers[places], offsets, self.code[rows], self.flags[rows] & FD != 0)


class _Told(NamedTuple):
    """The missing part of remainders, what makes it more exact, and whether a busy sender explains it."""

    of: _Remainders
    what: Sequence[str]
    cause: Callable[[int], Cause]
    early: Array

    def values(self, k: int) -> Values:
        """Return what is said of one."""
        return {
            "transfer_id": self.of.transfer_id.item(k), "cause": self.what[k], "detail": self.cause(k).detail,
        }  # fmt: skip

    def severity(self, k: int) -> Severity | None:
        """Return what stands instead of the severity of the rule."""
        return "note" if self.early[k] else None

    def occurrence(self, view: View, k: int) -> Occurrence:
        """Return one."""
        t, bus, node, code = (column.item(k) for column in (self.of.t, self.of.bus, self.of.node, self.of.code))
        frames, lines = self.of.frames(k), self.of.lines[k]
        return Occurrence(
            "TRF-005", t, bus, None if node < 0 else node, view.type_name(code), tuple(frames), self.values(k),
            severity=self.severity(k), drops=True, lines=lines or _lines(view, frames),
        )  # fmt: skip

    def occurrences(self, rows: Sequence[int], lines: Sequence[tuple[str, ...]] = ()) -> Iterator[Occurrences]:
        """Yield some together; `lines` are those of all if their frames may be gone."""
        ids: dict[str, int] = {}
        every = np.array(rows, np.int64)
        key = np.array([ids.setdefault(self.what[k], len(ids)) for k in rows], np.int64)
        early = self.early[every]
        for noted in dict.fromkeys(early.tolist()):
            some = np.flatnonzero(early == noted)
            found = self._alike(every[some], key[some])
            yield replace(found, lines=partial(_kept, lines, some)) if lines else found

    def _alike(self, rows: Array, key: Array) -> Occurrences:
        """Return some of one severity."""
        t, bus, node, code, number = (
            column[rows] for column in (self.of.t, self.of.bus, self.of.node, self.of.code, self.of.number)
        )
        return Occurrences(
            rule="TRF-005", t=t, bus=bus, node=node, type=code, frame=number,
            values=lambda k: self.values(rows.item(k)), frames=lambda k: self.of.frames(rows.item(k)),
            key=key, severity=self.severity(rows.item(0)), drops=True, each_named=True,
        )  # fmt: skip


class MissingStart:
    """Puts orphans together, in the order of their numbers.

    Args:
        begun: time and first frame of each session's first transfer.
    """

    def __init__(self, begun: Mapping[int, tuple[int, int]]) -> None:
        self._begun = begun
        self._open: dict[int, _Remainder] = {}
        self._orphaned: dict[int, int] = {}
        self._early_ones: dict[tuple[int, str], list[Occurrence]] = {}
        self._excused = 0
        self._budget = SearchBudget()
        self._causes = KnownCauses()
        self._closed: list[_Remainder] = []

    def feed(self, view: View) -> None:
        """Keep the frames of remainders that were open before this batch: they may be gone when these are told."""
        for one in self._open.values():
            if not one.lines and one.frames[-1] < view.frames.first:
                one.lines = _lines(view, one.frames)

    def add(self, view: View, orphans: LooseFrames) -> None:
        """Add more orphans; a remainder that cannot get any more frames waits for `told`."""
        cells = orphans.number, orphans.session, orphans.t, orphans.bus, orphans.node, orphans.code, orphans.flags
        first = zip(*(column.tolist() for column in cells), strict=True)
        rest = (orphans.tail & TAIL_ID).tolist(), (orphans.tail & TAIL_END).tolist(), (orphans.size - 1).tolist()
        known, opened = self._orphaned, self._open
        for cell, transfer_id, ends, size, lines in zip(first, *rest, orphans.lines, strict=True):
            number, key, t = cell[:3]
            if key not in known and len(known) < MOST_OPEN:
                known[key] = t
            one = opened.get(key)
            if one is not None and (one.transfer_id != transfer_id or t - one.latest > TIMEOUT):
                self._closed.append(opened.pop(key))
                one = None
            if one is None:
                if len(opened) >= MOST_OPEN:
                    self._closed.append(opened.pop(next(iter(opened))))
                opened[key] = _Remainder(transfer_id, cell, t, size, [number], lines or ())
            else:
                one.latest = t
                one.received += size
                if len(one.frames) < MOST_FRAMES:
                    one.frames.append(number)
                    if one.lines or lines:
                        before = one.lines or _lines(view, one.frames[:-1])
                        one.lines = before + (lines or view.lines((number,)))
            if ends:
                self._closed.append(opened.pop(key))

    def close(self) -> None:
        """Close all that are open: no more frames will come."""
        self._closed += self._open.values()
        self._open.clear()

    def excused(self) -> Iterator[Occurrence]:
        """Yield those that were held back to the end."""
        for held in self._early_ones.values():
            yield from held

    def told(self, view: View, together: list[Occurrences]) -> Iterator[Occurrence]:
        """Tell of remainders that were closed `together`, and yield those that were held back before."""
        if not self._closed:
            return
        closed, self._closed = _Remainders.of(self._closed), []
        told = self._searched(view, closed)
        rows: list[int] = []
        kept: dict[int, tuple[str, ...]] = {}
        columns = told.what, closed.session.tolist(), told.early.tolist(), closed.sizes.tolist(), closed.lines
        for k, (what, key, early, size, lines) in enumerate(zip(*columns, strict=True)):
            if not what or (early and view.cut_in and self._first(*closed.first(k))):
                continue
            kind = key, what
            if early and self._excused < MOST_EARLY:
                self._excused += 1
                self._early_ones.setdefault(kind, []).append(told.occurrence(view, k))
                continue
            goes_on = kind in self._early_ones
            held = self._early_ones.pop(kind, ())
            self._excused -= len(held)
            # What goes on is no moment in which the sender was busy.
            yield from (replace(one, severity=None) for one in held) if len(held) >= _HABIT else held
            if lines or size > MOST_LINES or goes_on:
                kept[k] = lines or _lines(view, closed.frames(k))
            else:
                rows.append(k)
        together += told.occurrences(rows)
        together += told.occurrences([*kept], [*kept.values()])

    def _searched(self, view: View, closed: _Remainders) -> _Told:
        """Return what is missing of each; nothing of one whose frames belong to a transfer that says so itself."""
        senders = senders_of(closed.bus, closed.node, closed.code)
        searched = self._budget.take(senders)
        rows, others = np.flatnonzero(searched), np.flatnonzero(~searched)
        found = ask(view, REMAINDER, closed.lists(rows))
        whats = [FORMS[form].what for form in found.form.tolist()]
        shapes = list(zip(closed.sizes.tolist(), closed.received.tolist(), strict=True))
        who = senders.tolist()
        gone = found.gone.tolist()
        self._causes.note_all(
            (who[k], shapes[k], what) for k, what, lost in zip(rows.tolist(), whats, gone, strict=True) if not lost
        )
        known = self._causes.like_all((who[k], shapes[k]) for k in others.tolist())
        told = np.empty(len(who), object)
        told[rows], told[others] = whats, known
        at = np.full(len(who), -1)
        at[rows] = np.arange(len(rows))

        def cause(k: int) -> Cause:
            return alike(told[k]) if at.item(k) < 0 else found.cause(at.item(k))

        losses = np.fromiter((what in _LOSSES for what in told), bool, len(told))
        losses[losses] = self._early(view, closed, np.flatnonzero(losses))
        return _Told(closed, told.tolist(), cause, losses)

    def _first(self, number: int, session: int, t: int) -> bool:
        """Return whether it is the first that was heard of its session: of a window that is where the window begins."""
        begun = self._begun.get(session)
        return (begun is None or number < begun[1]) and self._orphaned.get(session) == t

    def _early(self, view: View, closed: _Remainders, rows: Array) -> Array:
        """Return whether a sender may have been busy as the session, the capture, or the part behind a gap began."""
        number, session, t, bus = (column[rows] for column in (closed.number, closed.session, closed.t, closed.bus))
        sessions, last = session.tolist(), t.tolist()
        begun = [self._begun.get(key, (NO_TIME, place)) for key, place in zip(sessions, number.tolist(), strict=True)]
        began, lead = np.array(begun, np.int64).reshape(-1, 2).T
        heard = np.array([self._orphaned.get(key, when) for key, when in zip(sessions, last, strict=True)], np.int64)
        heard = np.where(began != NO_TIME, np.minimum(heard, began), heard)
        started = np.array([view.starts.get(one, when) for one, when in zip(bus.tolist(), last, strict=True)], np.int64)
        since = np.maximum(np.maximum(started, heard), all_resumed(view, t))
        return np.where(t == NO_TIME, number <= lead, t - since <= TIMEOUT)


def _kept(lines: Sequence[tuple[str, ...]], rows: Array, k: int) -> tuple[str, ...]:
    row: int = rows.item(k)
    return lines[row]


def _lines(view: View, frames: Sequence[int]) -> tuple[str, ...]:
    if len(frames) <= MOST_LINES:  # as nearly always
        return view.lines(frames)
    return tuple(line for number in frames for line in view.lines((number,)))
