"""Rests of transfers whose start is missing: their later frames together are one occurrence."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, NamedTuple

from analyzer.rules.diagnosis.budgets import LIKE, NOT_SEARCHED, KnownCauses, SearchBudget
from analyzer.rules.diagnosis.losses import FIRST, FIRSTS, LOST_SEVERAL, missing
from analyzer.rules.diagnosis.neighbours import NeighbourFinder
from analyzer.rules.diagnosis.proofs import Cause, proven
from analyzer.rules.diagnosis.tail_bits import in_a_row
from analyzer.tables import FD, TAIL_END, TAIL_ID
from dissectors.kit import NO_TIME, SECOND, Kept, Occurrence

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

    from analyzer.rules.diagnosis.neighbours import Neighbours
    from dissectors.kit import View

_LOSSES = {FIRST, FIRSTS, LOST_SEVERAL, NOT_SEARCHED}  # what a sender that was busy as the capture began explains
TIMEOUT = 2 * SECOND
MOST_OPEN = 4096
MOST_FRAMES = 64  # of one remainder that are named
MOST_EARLY = 4096  # remainders that may be excused, until the session shows whether it goes on like that
_HABIT = 3  # of them that no busy moment explains


class LooseFrame(NamedTuple):
    """A frame outside of transfers: its number, its session (bus and identifier without priority) and its bytes."""

    number: int
    session: int
    kept: Kept
    lines: tuple[str, ...]


@dataclass(slots=True)
class _Remainder:
    transfer_id: int
    node: int | None
    type: str
    code: int
    session: int
    first: LooseFrame
    latest: int
    received: int = 0
    frames: list[int] = field(default_factory=list)
    lines: list[str] = field(default_factory=list)


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
        """Take every batch."""

    def add(self, view: View, loose: LooseFrame, node: int | None, type_: str, code: int) -> Iterator[Occurrence]:
        """Add one more orphan; yield a remainder that cannot get any more frames."""
        key, tail, t = loose.session, loose.kept.data[-1], loose.kept.t
        if len(self._orphaned) < MOST_OPEN:
            self._orphaned.setdefault(key, t)
        one = self._open.get(key)
        if one is not None and (one.transfer_id != tail & TAIL_ID or t - one.latest > TIMEOUT):
            yield from self._close(view, key)
            one = None
        if one is None:
            if len(self._open) >= MOST_OPEN:
                yield from self._close(view, next(iter(self._open)))
            one = self._open[key] = _Remainder(tail & TAIL_ID, node, type_, code, key, loose, t)
        one.latest = t
        one.received += len(loose.kept.data) - 1
        if len(one.frames) < MOST_FRAMES:
            one.frames.append(loose.number)
            one.lines += loose.lines
        if tail & TAIL_END:
            yield from self._close(view, key)

    def rest(self, view: View) -> Iterator[Occurrence]:
        """Yield those that were never closed."""
        for key in list(self._open):
            yield from self._close(view, key)
        for held in self._early_ones.values():
            yield from held

    def _close(self, view: View, key: int) -> Iterator[Occurrence]:
        one = self._open.pop(key)
        kept = one.first.kept
        cause = self._cause(view, one)
        if cause is None:
            return
        early = cause.what in _LOSSES and self._early(view, one.first)
        found = Occurrence(
            "TRF-005", kept.t, kept.bus, one.node, one.type, tuple(one.frames),
            {"transfer_id": one.transfer_id, "cause": cause.what, "detail": cause.detail},
            severity="note" if early else None, drops=True, lines=tuple(one.lines),
        )  # fmt: skip
        kind = one.session, cause.what
        if early and self._excused < MOST_EARLY:
            self._excused += 1
            self._early_ones.setdefault(kind, []).append(found)
            return
        held = self._early_ones.pop(kind, [])
        self._excused -= len(held)
        # What goes on is no moment in which the sender was busy.
        yield from (replace(one, severity=None) for one in held) if len(held) >= _HABIT else held
        yield found

    def _cause(self, view: View, one: _Remainder) -> Cause | None:
        """Return what is missing; None if the frames belong to a transfer that says so itself."""
        kept, shape = one.first.kept, (len(one.frames), one.received)
        who = kept.bus, -1 if one.node is None else one.node, one.code
        if not self._budget.take(who):
            what = self._causes.like(who, shape)
            return Cause(what, "" if what == NOT_SEARCHED else LIKE) if what else None
        here = self._neighbours.of(view, one.frames, one.code, fd=bool(kept.flags & FD))
        if here is None:
            return Cause(NOT_SEARCHED)
        cause = _search(here)
        self._causes.note(who, shape, "" if cause is None else cause.what)
        return cause

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


def _search(here: Neighbours) -> Cause | None:
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
