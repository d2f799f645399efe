"""Frames of sessions that no transfer took: each waits for those behind it, which show what it was."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from analyzer.rules.anomalies import GONE as FRAME_GONE
from analyzer.rules.diagnosis import search
from analyzer.rules.diagnosis.budgets import SearchBudget
from analyzer.rules.diagnosis.causes import BELONGS, FOREIGN, FOREIGN_RIGHT, GONE, INSIDE, NOTHING
from analyzer.rules.diagnosis.search import AHEAD
from analyzer.rules.transfers.loose_frames import LooseFrames
from analyzer.rules.transfers.missing_start import MissingStart
from analyzer.tables import TAIL_END, TAIL_ID, VERDICTS
from dissectors.frame_text import FrameNumber

if TYPE_CHECKING:
    from collections.abc import Iterator

    from analyzer._native import Firsts
    from analyzer.rules.diagnosis.search import FrameSearch
    from dissectors.kit import Array, Kept, Occurrence, Occurrences, Values, View

COPY, OTHER_ID, ORPHAN = (VERDICTS.index(name) for name in ("duplicate", "wrong transfer id", "orphan"))
_USED = VERDICTS.index("used")
NEAR = 4096  # frames that are looked through for the one before
_CLOSE = 64  # of these that are looked through first
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

    def __init__(self, begun: Firsts) -> None:
        self._missing_start = MissingStart(begun)
        self._waiting: list[LooseFrames] = []
        self._budget = SearchBudget()

    def add(self, frames: LooseFrames) -> None:
        """Add more frames."""
        if len(frames):
            self._waiting.append(frames)

    def feed(self, view: View) -> Iterator[Occurrences | Occurrence]:
        """Yield those whose surroundings are known by now."""
        self._missing_start.feed(view)
        if self._waiting:
            waiting = LooseFrames.joined(self._waiting)
            ready = int(waiting.number.searchsorted(view.frames.first + len(view.frames) - AHEAD))
            self._waiting = []
            self.add(waiting.take(slice(ready, None)))
            yield from self._report(view, waiting.take(slice(ready)))

    def finish(self, view: View) -> Iterator[Occurrences | Occurrence]:
        """Yield those at the end of the capture."""
        yield from self._report(view, LooseFrames.joined(self._waiting), last=True)

    def _report(self, view: View, frames: LooseFrames, *, last: bool = False) -> Iterator[Occurrences | Occurrence]:
        form, answers, at = self._search(view, frames)
        alone = (frames.verdict == ORPHAN) | ((frames.verdict == OTHER_ID) & (form == NOTHING))
        together: list[Occurrences] = []
        rows = ((frames.verdict == COPY) & (form != NOTHING)).nonzero()[0]
        if len(rows):
            copies = frames.take(rows)
            together.append(copies.breaches(view, "TRF-004", partial(_copy, view, copies), drops=True))
        rows = ((frames.verdict == OTHER_ID) & (form != NOTHING)).nonzero()[0]
        if len(rows):
            others = frames.take(rows)
            values = partial(_other_id, view, others, answers, at[rows], form[rows])
            together.append(others.breaches(view, "TRF-009", values, drops=True))
        together.sort(key=lambda one: int(one.frame[0]))
        yield from self._missing_start.add(view, frames.take(alone), together, last=last)
        if last:
            yield from self._missing_start.excused()
        yield from together

    def _search(self, view: View, frames: LooseFrames) -> tuple[Array, FrameSearch | None, Array]:
        """Return what is found of copies and frames inside other transfers: a form each.

        Behind it come the answers on those with another transfer ID, and the place of each among these, or -1.

        A frame that looks like a copy and is none has no form, and so has one with another transfer ID that is left of
        a transfer that was cut itself, or where the ID of the frame before it is or may be wrong (TRF-006).
        """
        form, at, known = np.full(len(frames), GONE), np.full(len(frames), -1), None
        inside = (frames.verdict != ORPHAN).nonzero()[0]
        searched = inside[self._budget.take(frames.senders[inside])]
        for question, verdict in ((search.COPY, COPY), (search.INSIDE, OTHER_ID)):
            rows = searched[frames.verdict[searched] == verdict]
            if len(rows):
                answers = search.ask(view, question, frames.take(rows).lists())
                form[rows] = answers.form
                if verdict == OTHER_ID:
                    known, at[rows] = answers, np.arange(len(rows))
        return form, known, at


def preceding(view: View, number: int, bus: int, session: int, most: int = NEAR) -> Iterator[tuple[int, Kept]]:
    """Yield earlier frames of a session, the last one first."""
    low, end, look = max(number - most, 0), number, _CLOSE
    while low < end:  # mostly the first ones suffice
        begin = max(number - look, low)
        for index in reversed(view.indexes(begin, end)):
            for earlier in reversed(index.numbers(begin, end, bus, session)):
                other = view.frame(earlier)
                if other is not None and other.data:
                    yield earlier, other
        end, look = begin, look * 8


def _copy(view: View, copies: LooseFrames, k: int) -> Values:
    number = copies.number.item(k)
    found = next((FrameNumber.at(earlier) for earlier, _ in preceding(view, number, *copies.whose(k))), FRAME_GONE)
    return {"frame": FrameNumber.at(number), "previous_frame": found}


def _other_id(view: View, others: LooseFrames, found: FrameSearch | None, at: Array, form: Array, k: int) -> Values:
    mine, what = others.tail.item(k) & TAIL_ID, form.item(k)
    why = _WHY[what] if found is None or what in _WHY else ": {}{}".format(*found.cause(at.item(k)))
    before = preceding(view, others.number.item(k), *others.whose(k))
    tails = (other.data[-1] for _, other in before if other.verdict == _USED)
    under_way = (tail & TAIL_ID for tail in tails if not tail & TAIL_END)
    return {"transfer_id": mine, "expected": next((one for one in under_way if one != mine), FRAME_GONE), "why": why}
