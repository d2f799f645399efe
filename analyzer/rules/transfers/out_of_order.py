"""Frames of sessions that no transfer took: each waits for those behind it, which show what it was."""

from __future__ import annotations

from functools import partial
from itertools import pairwise
from typing import TYPE_CHECKING

from analyzer.facts.identifiers import NOBODY
from analyzer.rules.anomalies import GONE
from analyzer.rules.diagnosis.budgets import SearchBudget
from analyzer.rules.diagnosis.neighbours import AHEAD, NeighbourFinder
from analyzer.rules.diagnosis.proofs import proven
from analyzer.rules.frames.foreign import session_of
from analyzer.rules.joint.gathered import Gathered
from analyzer.rules.transfers.missing_start import MissingStart
from analyzer.tables import FD, TAIL_END, TAIL_ID, VERDICTS

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Mapping, Sequence

    from analyzer.rules.diagnosis.neighbours import Neighbours
    from analyzer.rules.diagnosis.proofs import Part, Proof
    from analyzer.rules.transfers.missing_start import LooseFrame
    from dissectors.kit import Kept, Occurrence, Occurrences, Values, View

COPY, OTHER_ID, ORPHAN = (VERDICTS.index(name) for name in ("duplicate", "wrong transfer id", "orphan"))
_USED = VERDICTS.index("used")
NEAR = 4096  # frames that are looked through for the one before
KINDS = (COPY, OTHER_ID, ORPHAN)


class OutOfOrder:
    """Copies, frames with another transfer ID, and what is left of transfers without a start.

    Args:
        begun: time and first frame of each session's first transfer.
    """

    def __init__(self, begun: Mapping[int, tuple[int, int]]) -> None:
        self._missing_start = MissingStart(begun)
        self._neighbours = NeighbourFinder()
        self._waiting: list[LooseFrame] = []
        self._told = Gathered()
        self._budget = SearchBudget()

    def add(self, loose: LooseFrame) -> None:
        """Add one more frame."""
        self._waiting.append(loose)

    def feed(self, view: View) -> Iterator[Occurrences | Occurrence]:
        """Yield those whose surroundings are known by now."""
        self._missing_start.feed(view)
        if self._waiting:
            end = view.frames.first + len(view.frames)
            ready = [one for one in self._waiting if one.number + AHEAD < end]
            self._waiting = [one for one in self._waiting if one.number + AHEAD >= end]
            yield from self._report(view, ready)
            yield from self._told.occurrences()

    def finish(self, view: View) -> Iterator[Occurrences | Occurrence]:
        """Yield those at the end of the capture."""
        yield from self._report(view, self._waiting)
        yield from self._missing_start.rest(view, self._told)
        yield from self._told.occurrences()

    def _report(self, view: View, ready: Sequence[LooseFrame]) -> Iterator[Occurrence]:
        for one in sorted(ready, key=lambda one: one.number):
            kept = one.kept
            if kept.verdict == ORPHAN:
                yield from self._missing_start.add(view, one, self._told)
                continue
            searched = self._budget.take((kept.bus, NOBODY if one.node is None else one.node, one.code), one.number)
            near = self._neighbours.of(view, (one.number,), one.code, fd=bool(kept.flags & FD)) if searched else None
            if kept.verdict == COPY:
                if near is None or not _is_needed(near):
                    self._tell("TRF-004", one, partial(_copy, view, one.number, kept))
                continue
            why = ": cause not sought" if near is None else _inside(near)
            if why is None:
                yield from self._missing_start.add(view, one, self._told)
            else:
                self._tell("TRF-009", one, partial(_other_id, view, one.number, kept, why))

    def _tell(self, rule: str, one: LooseFrame, values: Callable[[], Values]) -> None:
        self._told.add(rule, one.sent, (one.number,), values)


def _is_needed(near: Neighbours) -> bool:
    """Return whether a frame that looks like a copy is none.

    Where toggles stand still, or where one between both has another transfer ID, the CRC is right only with it.
    """
    (frame,) = near.parts
    if frame.number in near.settled:
        return False
    run = _from_start(near.near, frame)
    apart = [part for k, part in enumerate(run) if not k or part[1:] != run[k - 1][1:]]
    stands_still = any(one.toggle == after.toggle for one, after in pairwise(apart))
    if (stands_still or len(apart) == 1) and near.expected.fits(run):
        return True
    here = near._replace(parts=apart)
    proof = proven(here.parts, here.around(), near.expected) if apart else None
    return proof is not None and frame in proof.order and sum(part[1:] == frame[1:] for part in proof.order) > 1


def _from_start(near: Sequence[Part], frame: Part) -> list[Part]:
    """Return the transfer around a frame as it came, copies and all: from the start before it to the end behind it."""
    mine = [part for part in near if part.transfer_id == frame.transfer_id]
    first = max((k for k, part in enumerate(mine) if part.start and part.number <= frame.number), default=0)
    while first and mine[first - 1][1:] == mine[first][1:]:
        first -= 1
    last = next((k for k, part in enumerate(mine) if part.end and part.number >= frame.number), len(mine) - 1)
    return mine[first : last + 1]


def _inside(near: Neighbours) -> str | None:
    """Return what a frame with another transfer ID does inside a transfer.

    None if it is left of one that was cut itself, or if the ID of the frame before it is or may be wrong (TRF-006).
    """
    (frame,) = near.parts
    copy = near.copy()
    copied = f": {copy.what}{copy.detail}" if copy is not None else ""
    for run in near.whole:
        if run[0].number < frame.number < run[-1].number and run[0].transfer_id != frame.transfer_id:
            right = near.expected.fits(run)
            return copied or (": a foreign frame, the CRC is right without it" if right else "")
    proof = _around(near, frame)
    if proof is not None and frame in proof.order:
        first, *rest = proof.order
        unsure = rest == [frame] and first in near.misnumbered(proof.order)
        return None if unsure else ": it belongs to that one"
    if copied or proof is not None or not near.expected.starts:
        return copied or (": a foreign frame" if proof is not None else "")
    rest = [part for part in near.near if part.number >= frame.number and part.transfer_id == frame.transfer_id]
    end = next((k for k, part in enumerate(rest) if part.end), None)
    right = end is not None and all(one.toggle != after.toggle for one, after in pairwise(rest[: end + 1]))
    return None if right else ""


def _around(near: Neighbours, frame: Part) -> Proof | None:
    """Return what must be different in the transfer that was begun before a frame with another ID, if that is known."""
    before = [part for part in near.near if part.number < frame.number and part.start and not part.end]
    if not before or before[-1].transfer_id == frame.transfer_id:
        return None
    begun = before[-1]
    outer = [part for part in near.near if part.transfer_id == begun.transfer_id and part.number >= begun.number]
    cut = next((k for k, part in enumerate(outer) if k and (part.start or outer[k - 1].end)), len(outer))
    here = near._replace(parts=outer[:cut])
    return proven(here.parts, here.around(), near.expected)


def preceding(view: View, number: int, kept: Kept, most: int = NEAR) -> Iterator[tuple[int, Kept]]:
    """Yield earlier frames of the session, the last one first."""
    for earlier in view.numbers_before(number, most, kept.bus, session_of(kept.id, kept.verdict)):
        other = view.frame(earlier)
        if other is not None and other.data:
            yield earlier, other


def _copy(view: View, number: int, kept: Kept) -> Values:
    found = next((earlier + 1 for earlier, _ in preceding(view, number, kept)), GONE)
    return {"frame": number + 1, "previous_frame": found}


def _other_id(view: View, number: int, kept: Kept, why: str) -> Values:
    mine = kept.data[-1] & TAIL_ID
    tails = (other.data[-1] for _, other in preceding(view, number, kept) if other.verdict == _USED)
    under_way = (tail & TAIL_ID for tail in tails if not tail & TAIL_END)
    return {"transfer_id": mine, "expected": next((one for one in under_way if one != mine), GONE), "why": why}
