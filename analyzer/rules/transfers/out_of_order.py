"""Frames of sessions that no transfer took: each waits for those behind it, which show what it was."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING

from analyzer.rules.anomalies import GONE as FRAME_GONE
from analyzer.rules.diagnosis import search
from analyzer.rules.diagnosis.budgets import SearchBudget
from analyzer.rules.diagnosis.causes import BELONGS, FOREIGN, FOREIGN_RIGHT, GONE, INSIDE, NOTHING, Cause
from analyzer.rules.diagnosis.search import AHEAD
from analyzer.rules.frames.foreign import session_of
from analyzer.rules.joint.gathered import Gathered
from analyzer.rules.transfers.missing_start import MissingStart, loose_lists, loose_senders
from analyzer.tables import TAIL_END, TAIL_ID, VERDICTS

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Mapping, Sequence

    from analyzer.rules.transfers.missing_start import LooseFrame
    from dissectors.kit import Kept, Occurrence, Occurrences, Values, View

COPY, OTHER_ID, ORPHAN = (VERDICTS.index(name) for name in ("duplicate", "wrong transfer id", "orphan"))
_USED = VERDICTS.index("used")
NEAR = 4096  # frames that are looked through for the one before
KINDS = (COPY, OTHER_ID, ORPHAN)
_WHY = {  # of a frame with another transfer ID inside a transfer
    GONE: ": cause not sought",
    FOREIGN_RIGHT: ": a foreign frame, the CRC is right without it",
    FOREIGN: ": a foreign frame",
    BELONGS: ": it belongs to that one",
    INSIDE: "",
}


class OutOfOrder:
    """Copies, frames with another transfer ID, and what is left of transfers without a start.

    Args:
        begun: time and first frame of each session's first transfer.
    """

    def __init__(self, begun: Mapping[int, tuple[int, int]]) -> None:
        self._missing_start = MissingStart(begun)
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
        ready = sorted(ready, key=lambda one: one.number)
        found = self._search(view, [one for one in ready if one.kept.verdict != ORPHAN])
        for one in ready:
            if one.kept.verdict == ORPHAN:
                self._missing_start.add(view, one)
                continue
            form, cause = found.get(one.number, _NOT_SEARCHED)
            if one.kept.verdict == COPY:
                if form != NOTHING:
                    self._tell("TRF-004", one, partial(_copy, view, one.number, one.kept))
            elif form == NOTHING:
                self._missing_start.add(view, one)
            else:
                why = _WHY[form] if form in _WHY else ": {}{}".format(*cause())
                self._tell("TRF-009", one, partial(_other_id, view, one.number, one.kept, why))
        yield from self._missing_start.told(view, self._told)

    def _search(self, view: View, loose: Sequence[LooseFrame]) -> dict[int, tuple[int, Callable[[], Cause]]]:
        """Return what is found of copies and frames inside other transfers, by number: a form, and its cause in words.

        A frame that looks like a copy and is none has no form, and so has one with another transfer ID that is left of
        a transfer that was cut itself, or where the ID of the frame before it is or may be wrong (TRF-006).
        """
        found: dict[int, tuple[int, Callable[[], Cause]]] = {}
        if not loose:
            return found
        searched = [one for one, may in zip(loose, self._budget.take(loose_senders(loose)), strict=True) if may]
        for question, verdict in ((search.COPY, COPY), (search.INSIDE, OTHER_ID)):
            some = [one for one in searched if one.kept.verdict == verdict]
            answers = search.ask(view, question, loose_lists(some, [(one.number,) for one in some]))
            for k, (one, form) in enumerate(zip(some, answers.form.tolist(), strict=True)):
                found[one.number] = form, partial(answers.cause, k)
        return found

    def _tell(self, rule: str, one: LooseFrame, values: Callable[[], Values]) -> None:
        self._told.add(rule, one.sent, (one.number,), values)


def _unknown() -> Cause:
    return Cause("")


_NOT_SEARCHED = GONE, _unknown


def preceding(view: View, number: int, kept: Kept, most: int = NEAR) -> Iterator[tuple[int, Kept]]:
    """Yield earlier frames of the session, the last one first."""
    for earlier in view.numbers_before(number, most, kept.bus, session_of(kept.id, kept.verdict)):
        other = view.frame(earlier)
        if other is not None and other.data:
            yield earlier, other


def _copy(view: View, number: int, kept: Kept) -> Values:
    found = next((earlier + 1 for earlier, _ in preceding(view, number, kept)), FRAME_GONE)
    return {"frame": number + 1, "previous_frame": found}


def _other_id(view: View, number: int, kept: Kept, why: str) -> Values:
    mine = kept.data[-1] & TAIL_ID
    tails = (other.data[-1] for _, other in preceding(view, number, kept) if other.verdict == _USED)
    under_way = (tail & TAIL_ID for tail in tails if not tail & TAIL_END)
    return {"transfer_id": mine, "expected": next((one for one in under_way if one != mine), FRAME_GONE), "why": why}
