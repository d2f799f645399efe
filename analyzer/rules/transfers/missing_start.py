"""Rests of transfers whose start is missing: their later frames together are one occurrence."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from analyzer.facts.identifiers import NOBODY
from analyzer.rules.diagnosis.budgets import KnownCauses, SearchBudget, alike, senders_of
from analyzer.rules.diagnosis.causes import FIRST, FIRSTS, FORMS, LOST_SEVERAL, NOT_SEARCHED, Cause
from analyzer.rules.diagnosis.search import REMAINDER, FrameLists, ask
from analyzer.rules.joint.gathered import Sent
from analyzer.rules.recent import MOST_LINES
from analyzer.tables import FD, TAIL_END, TAIL_ID
from dissectors.kit import NO_TIME, SECOND, Kept, Occurrence
from dissectors.records import dataclass, field, replace

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence

    from analyzer.rules.diagnosis.budgets import Shape
    from analyzer.rules.joint.gathered import Gathered
    from dissectors.kit import Array, Values, View

_LOSSES = {FIRST, FIRSTS, LOST_SEVERAL, NOT_SEARCHED}  # what a sender that was busy as the capture began explains
TIMEOUT = 2 * SECOND
MOST_OPEN = 4096
MOST_FRAMES = 64  # of one remainder that are named
MOST_EARLY = 4096  # remainders that may be excused, until the session shows whether it goes on like that
_HABIT = 3  # of them that no busy moment explains


@dataclass(slots=True)
class LooseFrame:
    """A frame outside of transfers: its number, its session (bus and identifier without priority), bytes and sender.

    `lines` are those of a frame that may be gone when they are needed.
    """

    number: int
    session: int
    kept: Kept
    node: int | None
    code: int
    lines: tuple[str, ...] = ()

    @property
    def sent(self) -> Sent:
        """When it was sent, and by whom."""
        return Sent(self.kept.t, self.kept.bus, self.node, self.code)


def loose_senders(loose: Sequence[LooseFrame]) -> Array:
    """Return who sent each, and its type."""
    who = [(one.kept.bus, NOBODY if one.node is None else one.node, one.code) for one in loose]
    return senders_of(*np.array(who, np.int64).reshape(-1, 3).T)


def loose_lists(loose: Sequence[LooseFrame], frames: Sequence[Sequence[int]]) -> FrameLists:
    """Return lists of frames of the sessions of some."""
    return FrameLists.of(frames, [one.code for one in loose], [bool(one.kept.flags & FD) for one in loose])


@dataclass(slots=True)
class _Remainder:
    transfer_id: int
    first: LooseFrame
    latest: int
    received: int = 0
    frames: list[int] = field(default_factory=list)
    lines: tuple[str, ...] = ()

    @property
    def shape(self) -> Shape:
        """Frames and bytes that came."""
        return len(self.frames), self.received


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

    def add(self, view: View, loose: LooseFrame) -> None:
        """Add one more orphan; a remainder that cannot get any more frames waits for `told`."""
        key, tail, t = loose.session, loose.kept.data[-1], loose.kept.t
        if len(self._orphaned) < MOST_OPEN:
            self._orphaned.setdefault(key, t)
        one = self._open.get(key)
        if one is not None and (one.transfer_id != tail & TAIL_ID or t - one.latest > TIMEOUT):
            self._close(key)
            one = None
        if one is None:
            if len(self._open) >= MOST_OPEN:
                self._close(next(iter(self._open)))
            one = self._open[key] = _Remainder(tail & TAIL_ID, loose, t)
        one.latest = t
        one.received += len(loose.kept.data) - 1
        if len(one.frames) < MOST_FRAMES:
            one.frames.append(loose.number)
            if one.lines or loose.lines:
                before = one.lines or _lines(view, one.frames[:-1])
                one.lines = before + (loose.lines or view.lines((loose.number,)))
        if tail & TAIL_END:
            self._close(key)

    def rest(self, view: View, told: Gathered) -> Iterator[Occurrence]:
        """Yield those that were never closed."""
        for key in list(self._open):
            self._close(key)
        yield from self.told(view, told)
        for held in self._early_ones.values():
            yield from held

    def told(self, view: View, told: Gathered) -> Iterator[Occurrence]:
        """Tell of remainders that were closed: those that are held back are yielded, others are `told`."""
        closed, self._closed = self._closed, []
        if not closed:
            return
        for one, what, cause in zip(closed, *self._search(view, closed), strict=True):
            if what:
                yield from self._tell(view, one, what, cause, told)

    def _close(self, key: int) -> None:
        self._closed.append(self._open.pop(key))

    def _tell(
        self, view: View, one: _Remainder, what: str, cause: Callable[[], Cause], told: Gathered
    ) -> Iterator[Occurrence]:
        def values() -> Values:
            return {"transfer_id": one.transfer_id, "cause": what, "detail": cause().detail}

        early = what in _LOSSES and self._early(view, one.first)
        if early and view.cut_in and self._first(one):
            return
        kind, sent = (one.first.session, what), one.first.sent
        held_back = early and self._excused < MOST_EARLY
        if not (held_back or one.lines or len(one.frames) > MOST_LINES or kind in self._early_ones):
            told.add("TRF-005", sent, one.frames, values, what, severity="note" if early else None)
            return
        found = Occurrence(
            "TRF-005", sent.t, sent.bus, sent.node, view.type_name(sent.code), tuple(one.frames), values(),
            severity="note" if early else None, drops=True, lines=one.lines or _lines(view, one.frames),
        )  # fmt: skip
        if held_back:
            self._excused += 1
            self._early_ones.setdefault(kind, []).append(found)
            return
        held = self._early_ones.pop(kind, [])
        self._excused -= len(held)
        # What goes on is no moment in which the sender was busy.
        yield from (replace(one, severity=None) for one in held) if len(held) >= _HABIT else held
        yield found

    def _search(self, view: View, closed: Sequence[_Remainder]) -> tuple[list[str], list[Callable[[], Cause]]]:
        """Return what is missing of each, and what makes it more exact.

        Nothing of one whose frames belong to a transfer that says so itself.
        """
        first = [one.first for one in closed]
        senders, shapes = loose_senders(first), [one.shape for one in closed]
        searched = np.flatnonzero(self._budget.take(senders)).tolist()
        found = ask(view, REMAINDER, loose_lists([first[k] for k in searched], [closed[k].frames for k in searched]))
        whats = [FORMS[form].what for form in found.form.tolist()]
        who = senders.tolist()
        known = [(who[k], shapes[k], what) for k, what in zip(searched, whats, strict=True)]
        self._causes.note_all(one for one, gone in zip(known, found.gone.tolist(), strict=True) if not gone)
        told = self._causes.like_all(zip(who, shapes, strict=True))
        causes: list[Callable[[], Cause]] = [partial(alike, what) for what in told]
        for at, (k, what) in enumerate(zip(searched, whats, strict=True)):
            told[k], causes[k] = what, partial(found.cause, at)
        return told, causes

    def _first(self, one: _Remainder) -> bool:
        """Return whether it is the first that was heard of its session: of a window that is where the window begins."""
        begun = self._begun.get(one.first.session)
        return (begun is None or one.first.number < begun[1]) and self._orphaned.get(
            one.first.session
        ) == one.first.kept.t

    def _early(self, view: View, loose: LooseFrame) -> bool:
        """Return whether the sender may have been busy as the session, the capture, or the part behind a gap began."""
        t, bus = loose.kept.t, loose.kept.bus
        begun, number = self._begun.get(loose.session, (NO_TIME, loose.number))
        if t == NO_TIME:
            return loose.number <= number
        starts = [view.starts.get(bus, t), self._orphaned.get(loose.session, t)]
        if begun != NO_TIME:
            starts[1] = min(starts[1], begun)
        return t - max(*starts, view.resumed(t)) <= TIMEOUT


def _lines(view: View, frames: Iterable[int]) -> tuple[str, ...]:
    return tuple(line for number in frames for line in view.lines((number,)))
