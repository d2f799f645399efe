"""Rests of transfers whose start is missing: their later frames together are one occurrence."""

from __future__ import annotations

from typing import TYPE_CHECKING

from analyzer.facts.identifiers import NOBODY
from analyzer.rules.diagnosis.budgets import LIKE, NOT_SEARCHED, KnownCauses, SearchBudget
from analyzer.rules.diagnosis.losses import FIRST, FIRSTS, LOST_SEVERAL, missing
from analyzer.rules.diagnosis.neighbours import NeighbourFinder
from analyzer.rules.diagnosis.proofs import Cause, proven
from analyzer.rules.diagnosis.tail_bits import in_a_row
from analyzer.rules.joint.gathered import Sent
from analyzer.rules.recent import MOST_LINES
from analyzer.tables import FD, TAIL_END, TAIL_ID
from dissectors.kit import NO_TIME, SECOND, Kept, Occurrence
from dissectors.records import dataclass, field, replace

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Mapping

    from analyzer.rules.diagnosis.budgets import Sender
    from analyzer.rules.diagnosis.neighbours import Neighbours
    from analyzer.rules.joint.gathered import Gathered
    from dissectors.kit import View

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


@dataclass(slots=True)
class _Remainder:
    transfer_id: int
    first: LooseFrame
    latest: int
    received: int = 0
    frames: list[int] = field(default_factory=list)
    lines: tuple[str, ...] = ()


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
        self._neighbours = NeighbourFinder()

    def feed(self, view: View) -> None:
        """Keep the frames of remainders that were open before this batch: they may be gone when these are told."""
        for one in self._open.values():
            if not one.lines and one.frames[-1] < view.frames.first:
                one.lines = _lines(view, one.frames)

    def add(self, view: View, loose: LooseFrame, told: Gathered) -> Iterator[Occurrence]:
        """Add one more orphan; tell of a remainder that cannot get any more frames.

        Those that are searched or held back are yielded, others are `told`.
        """
        key, tail, t = loose.session, loose.kept.data[-1], loose.kept.t
        if len(self._orphaned) < MOST_OPEN:
            self._orphaned.setdefault(key, t)
        one = self._open.get(key)
        if one is not None and (one.transfer_id != tail & TAIL_ID or t - one.latest > TIMEOUT):
            yield from self._close(view, key, told)
            one = None
        if one is None:
            if len(self._open) >= MOST_OPEN:
                yield from self._close(view, next(iter(self._open)), told)
            one = self._open[key] = _Remainder(tail & TAIL_ID, loose, t)
        one.latest = t
        one.received += len(loose.kept.data) - 1
        if len(one.frames) < MOST_FRAMES:
            one.frames.append(loose.number)
            if one.lines or loose.lines:
                before = one.lines or _lines(view, one.frames[:-1])
                one.lines = before + (loose.lines or view.lines((loose.number,)))
        if tail & TAIL_END:
            yield from self._close(view, key, told)

    def rest(self, view: View, told: Gathered) -> Iterator[Occurrence]:
        """Yield those that were never closed."""
        for key in list(self._open):
            yield from self._close(view, key, told)
        for held in self._early_ones.values():
            yield from held

    def _close(self, view: View, key: int, told: Gathered) -> Iterator[Occurrence]:
        one = self._open.pop(key)
        who = one.first.kept.bus, NOBODY if one.first.node is None else one.first.node, one.first.code
        searched = self._budget.take(who, one.frames[0])
        cause = self._search(view, one, who) if searched else self._like(one, who)
        if cause is None:
            return
        early = cause.what in _LOSSES and self._early(view, one.first)
        values = {"transfer_id": one.transfer_id, "cause": cause.what, "detail": cause.detail}
        kind = one.first.session, cause.what
        alone = searched or early or one.lines or len(one.frames) > MOST_LINES or kind in self._early_ones
        if not alone:
            told.add("TRF-005", one.first.sent, one.frames, values, cause.what)
            return
        sent = one.first.sent
        found = Occurrence(
            "TRF-005", sent.t, sent.bus, sent.node, view.type_name(sent.code), tuple(one.frames), values,
            severity="note" if early else None, drops=True, lines=one.lines or _lines(view, one.frames),
        )  # fmt: skip
        if early and self._excused < MOST_EARLY:
            self._excused += 1
            self._early_ones.setdefault(kind, []).append(found)
            return
        held = self._early_ones.pop(kind, [])
        self._excused -= len(held)
        # What goes on is no moment in which the sender was busy.
        yield from (replace(one, severity=None) for one in held) if len(held) >= _HABIT else held
        yield found

    def _search(self, view: View, one: _Remainder, who: Sender) -> Cause | None:
        """Return what is missing; None if the frames belong to a transfer that says so itself."""
        here = self._neighbours.of(view, one.frames, one.first.code, fd=bool(one.first.kept.flags & FD))
        if here is None:
            return Cause(NOT_SEARCHED)
        cause = _found(here)
        self._causes.note(who, (len(one.frames), one.received), "" if cause is None else cause.what)
        return cause

    def _like(self, one: _Remainder, who: Sender) -> Cause | None:
        """Return the same of one that nothing is searched for."""
        what = self._causes.like(who, (len(one.frames), one.received))
        return Cause(what, "" if what == NOT_SEARCHED else LIKE) if what else None

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


def _found(here: Neighbours) -> Cause | None:
    copy = here.copy()
    if copy is not None:
        return copy
    proof = proven(here.parts, here.around(), here.expected)
    if proof is not None:
        own = {part.number for part in here.parts}
        return proof.cause if all(part.number in own for part in proof.order) else None
    row = in_a_row(here.parts, here.near, here.expected)
    if row is None:
        return missing(here.parts, here.expected)
    # The frames behind a single one with an end bit too many: nothing else tells of them.
    first, second = row.order[:2]
    return row.cause if first.start and first.end and second == here.parts[0] else None
