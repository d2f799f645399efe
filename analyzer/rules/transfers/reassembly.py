"""Transfers that did not arrive as they were sent: what happened to each, as far as its surroundings prove it.

A cause may show only in the frames that follow, so each transfer waits for some of them.
"""

from __future__ import annotations

from functools import partial
from itertools import accumulate, pairwise
from typing import TYPE_CHECKING

import numpy as np

from analyzer.rules.diagnosis.budgets import IS_NOTED, WHATS, KnownCauses, SearchBudget, alike
from analyzer.rules.diagnosis.causes import EVERY_ID_FORM, NOTHING, OTHER_ID_FORM
from analyzer.rules.diagnosis.search import AHEAD, BROKEN, ELSEWHERE, LATER, MISNUMBERED, PROVEN, ask
from analyzer.rules.transfers.broken_rows import ENDED, BrokenTransfers
from analyzer.rules.transfers.incomplete import CUT, LATE, SECONDS, SEQUENCE
from analyzer.rules.transfers.told_transfers import Why, occurrences
from analyzer.rules.transfers.wrong_crc import WrongCrcs
from analyzer.tables import TRANSFER_ANOMALIES
from dissectors.kit import MILLISECOND, NO_TIME, SECOND, Rule, groups

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from analyzer.rules.diagnosis.causes import Cause
    from analyzer.rules.diagnosis.search import FrameSearch
    from dissectors.kit import Array, Occurrence, Occurrences, TransferTable, View

_RULES = (SEQUENCE, CUT, LATE)  # a bit of `BrokenTransfers.due` each, and one more for a wrong CRC
_TOGGLE, _CRC, _ABANDONED, _TIMEOUT = (
    1 << TRANSFER_ANOMALIES.index(name) for name in ("toggle", "crc", "abandoned", "timeout")
)
_NEXT = 20 * MILLISECOND  # in which the next frame of a transfer would have come
_CLOSED = round(SECONDS * SECOND)  # behind its first frame
_NEVER = (1 << 63) - 1  # the time of a frame that did not come


class Reassembly(Rule):
    """Toggles that do not alternate, ends that never came, CRCs that do not fit."""

    rules = ("TRF-003", "TRF-006", "TRF-007", "TRF-010", "TRF-011", "CAN-020")

    def __init__(self) -> None:
        self._budgets = [SearchBudget() for _ in _RULES]
        self._causes = [KnownCauses() for _ in _RULES]
        self._crcs = WrongCrcs()
        # In the order in which they ended, so that what is known of a sender does not depend on the batches.
        self._waiting = BrokenTransfers.none()

    def feed(self, view: View) -> Iterator[Occurrences | Occurrence]:
        """Yield those whose surroundings are known by now."""
        bits = view.transfers.anomaly & (_TOGGLE | _CRC | _ABANDONED | _TIMEOUT)
        rows = bits.nonzero()[0]
        if len(rows):
            self._add(view.transfers, rows, bits[rows])
        yield from self._ready(view, view.frames.first + len(view.frames) - AHEAD)

    def finish(self, view: View) -> Iterator[Occurrences | Occurrence]:
        """Yield those at the end of the capture."""
        yield from self._ready(view, None)
        yield from self._crcs.finish()

    def _add(self, t: TransferTable, rows: Array, bits: Array) -> None:
        """Add what a batch shows."""
        whole, cut, late = bits & _TOGGLE == 0, bits & _ABANDONED != 0, bits & _TIMEOUT != 0
        due = ~whole | (whole & cut) * 2 | (whole & late) * 4 | (bits & _CRC != 0) * 8
        ended = np.where(cut, ENDED.index(CUT), np.where(late, ENDED.index(LATE), 0))
        new = BrokenTransfers.of(t, rows, due, ended)
        self._waiting = self._waiting.joined(new) if len(self._waiting) else new

    def _ready(self, view: View, end: int | None) -> Iterator[Occurrences | Occurrence]:
        """Yield those whose last frame came before `end`, None for all."""
        broken = self._waiting
        if not len(broken):
            return
        ready, due = [], broken.due.copy()
        for place in range(len(_RULES) + 1):
            rows = (due & 1 << place).nonzero()[0]
            rows = rows if end is None else rows[: broken.before(rows, end)]
            due[rows] &= ~(1 << place)
            ready.append(rows)
        self._waiting = broken.left(due)
        yield from self._explained(view, broken, ready[:-1])
        yield from self._crcs.explained(view, broken, ready[-1])

    def _explained(self, view: View, broken: BrokenTransfers, ready: Sequence[Array]) -> Iterator[Occurrences]:
        """Yield some of each rule, batch by batch: those whose cause is searched, then those that are like them."""
        rows, rule = np.concatenate(ready), np.repeat(np.arange(len(ready)), [len(some) for some in ready])
        if not len(rows):
            return
        senders, shapes = broken.senders(rows), broken.shapes(rows)
        spans = [*pairwise((0, *accumulate(map(len, ready))))]
        each = zip(self._budgets, spans, strict=True)
        searched = np.concatenate([budget.take(senders[low:high]) for budget, (low, high) in each if low < high])
        place, found = searched.nonzero()[0], ask(view, BROKEN, broken.lists(rows[searched]))
        told, kinds, noted = (np.empty(len(rows), kind) for kind in (bool, np.int64, bool))
        told[place], kinds[place], noted[place] = _judged(found, rule[place])
        sought = place[~found.gone]
        for causes, (low, high) in zip(self._causes, spans, strict=True):
            new = sought[sought.searchsorted(low) : sought.searchsorted(high)]
            if len(new):
                causes.note_all(senders[new], shapes[new], np.where(told[new], kinds[new], NOTHING))
            others = low + (~searched[low:high]).nonzero()[0]
            if len(others):
                kinds[others] = known = causes.like_all(senders[others], shapes[others])
                told[others], noted[others] = known != NOTHING, IS_NOTED[known]
        behind = np.full(len(rows), _NEVER)
        behind[place] = np.where(found.gone, _NEVER, found.value)
        noted |= _in_gaps(view, broken, rows, rule, behind)
        answer = np.cumsum(searched) - 1

        def cause(which: Array, k: int) -> Cause:
            at = which.item(k)
            return found.cause(answer.item(at)) if searched[at] else alike(WHATS[kinds.item(at)])

        def further(which: Array, k: int) -> Sequence[int]:
            at = which.item(k)
            shown = searched[at] and (_RULES[rule.item(at)] == SEQUENCE or found.flags.item(answer.item(at)) & PROVEN)
            return found.evidence(answer.item(at)) if shown else ()

        begun = np.zeros(len(broken), np.int64)
        (broken.batch[1:] != broken.batch[:-1]).cumsum(out=begun[1:])
        code = (rule * len(broken) + begun[rows]) << 2 | ~searched << 1 | noted
        for key, which in groups(np.where(told, code + 1, 0)):
            if key:
                name, noted_too = _RULES[rule[which[0]]], bool(key - 1 & 1)
                why = Why(kinds[which], partial(cause, which), partial(further, which))
                yield from occurrences(view, broken, name, rows[which], why, noted=noted_too, drops=True)


def _judged(found: FrameSearch, rule: Array) -> tuple[Array, Array, Array]:
    """Return of each answer whether this finding tells it, a number for what happened, and whether it is a note."""
    flags, cut = found.flags, rule == _RULES.index(CUT)
    elsewhere = flags & np.where(cut, ELSEWHERE | LATER, ELSEWHERE) != 0
    # TRF-009 names the frames.
    named = (flags & PROVEN != 0) & (found.form == OTHER_ID_FORM) & (flags & MISNUMBERED == 0)
    return ~elsewhere, found.kinds, named | (found.form == EVERY_ID_FORM)


def _in_gaps(view: View, broken: BrokenTransfers, rows: Array, rule: Array, behind: Array) -> Array:
    """Return whether what each transfer lacks may have come in a gap of the capture (CAP-002).

    `rule` is the place of the rule that it breaches; `behind` is when the first frame of its session came behind its
    last one.
    """
    t, end = broken.t[rows], broken.t_end[rows]
    found, timed = np.zeros(len(t), bool), (t != NO_TIME).nonzero()[0]
    if len(timed):
        since, until = np.minimum(t, end)[timed].min(), np.maximum(t, end)[timed].max() + max(_NEXT, _CLOSED)
        if view.paused(int(since), int(until)):  # else there is no gap anywhere near
            each = zip(*(column[timed].tolist() for column in (rule, t, end, behind)), strict=True)
            found[timed] = [_in_gap(view, _RULES[kind], *times) for kind, *times in each]
    return found


def _in_gap(view: View, rule: str, t: int, end: int, behind: int) -> bool:
    """Return the same of one that has a time, and that ends at `end`."""
    if rule == LATE:
        return view.paused(t, t + _CLOSED)
    if rule == CUT and view.paused(end, end + _NEXT):
        return behind - end > _NEXT
    return view.paused(t, end)
