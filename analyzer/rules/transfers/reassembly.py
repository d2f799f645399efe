"""Transfers that did not arrive as they were sent: what happened to each, as far as its surroundings prove it.

A cause may show only in the frames that follow, so each transfer waits for some of them.
"""

from __future__ import annotations

from collections import deque
from functools import partial
from typing import TYPE_CHECKING, TypeVar

import numpy as np

from analyzer.rules.diagnosis.budgets import KnownCauses, SearchBudget, alike
from analyzer.rules.diagnosis.causes import EVERY_ID_FORM, FORMS, NOTED, NOTHING, OTHER_ID_FORM
from analyzer.rules.diagnosis.search import AHEAD, BROKEN, ELSEWHERE, LATER, MISNUMBERED, PROVEN, ask
from analyzer.rules.transfers.broken_rows import ENDED, Rows, Why
from analyzer.rules.transfers.incomplete import CHECKSUM, CUT, LATE, SECONDS, SEQUENCE
from analyzer.rules.transfers.wrong_crc import WrongCrcs
from analyzer.tables import TRANSFER_ANOMALIES
from dissectors.kit import MILLISECOND, NO_TIME, SECOND, Rule

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence

    from analyzer.rules.diagnosis.causes import Cause
    from dissectors.kit import Array, Occurrence, Occurrences, TransferTable, View

_TOGGLE, _CRC, _ABANDONED, _TIMEOUT = (
    1 << TRANSFER_ANOMALIES.index(name) for name in ("toggle", "crc", "abandoned", "timeout")
)
_NEXT = 20 * MILLISECOND  # in which the next frame of a transfer would have come
_CLOSED = round(SECONDS * SECOND)  # behind its first frame
_NOTED = np.array([form.what in NOTED for form in FORMS])
T = TypeVar("T")
_NEVER = (1 << 63) - 1  # the time of a frame that did not come


class Reassembly(Rule):
    """Toggles that do not alternate, ends that never came, CRCs that do not fit."""

    rules = ("TRF-003", "TRF-006", "TRF-007", "TRF-010", "TRF-011", "CAN-020")

    def __init__(self) -> None:
        rules = (SEQUENCE, CUT, LATE)
        self._budgets = {rule: SearchBudget() for rule in rules}
        self._causes = {rule: KnownCauses() for rule in rules}
        self._crcs = WrongCrcs()
        # In the order in which they ended, so that what is known of a sender does not depend on the batches.
        self._waiting: dict[str, deque[Rows]] = {rule: deque() for rule in (*rules, CHECKSUM)}

    def feed(self, view: View) -> Iterator[Occurrences | Occurrence]:
        """Yield those whose surroundings are known by now."""
        bits = view.transfers.anomaly & (_TOGGLE | _CRC | _ABANDONED | _TIMEOUT)
        if bits.any():
            self._add(view.transfers, bits)
        yield from self._ready(view, view.frames.first + len(view.frames) - AHEAD)

    def finish(self, view: View) -> Iterator[Occurrences | Occurrence]:
        """Yield those at the end of the capture."""
        yield from self._ready(view, None)
        yield from self._crcs.finish()

    def _add(self, t: TransferTable, bits: Array) -> None:
        """Add what a batch shows."""
        whole, cut, late = bits & _TOGGLE == 0, bits & _ABANDONED != 0, bits & _TIMEOUT != 0
        kinds = {SEQUENCE: ~whole, CUT: whole & cut, LATE: whole & late, CHECKSUM: bits & _CRC != 0}
        ended = np.where(cut, ENDED.index(CUT), np.where(late, ENDED.index(LATE), 0))
        for rule, mask in kinds.items():
            rows = np.flatnonzero(mask)
            if len(rows):
                self._waiting[rule].append(Rows.of(rule, t, rows, ended[rows]))

    def _ready(self, view: View, end: int | None) -> Iterator[Occurrences | Occurrence]:
        """Yield those whose last frame came before `end`, None for all."""
        for waiting in self._waiting.values():
            while waiting:
                rows = waiting.popleft()
                ready = len(rows.row) if end is None else rows.before(end)
                yield from self._explained(view, rows.take(slice(ready)))
                if ready < len(rows.row):
                    waiting.appendleft(rows.take(slice(ready, None)))
                    break

    def _explained(self, view: View, rows: Rows) -> Iterator[Occurrences | Occurrence]:
        """Yield them with their causes."""
        if rows.rule == CHECKSUM:
            yield from self._crcs.explained(view, rows)
            return
        searched = self._budgets[rows.rule].take(rows.senders)
        yield from self._searched(view, rows.take(searched))
        yield from self._unsearched(view, rows.take(~searched))

    def _searched(self, view: View, rows: Rows) -> Iterator[Occurrences]:
        """Yield transfers with the cause that is found."""
        if not len(rows.row):
            return
        found, cut = ask(view, BROKEN, rows.lists()), rows.rule == CUT
        proven = found.flags & PROVEN != 0
        elsewhere = found.flags & (ELSEWHERE | LATER if cut else ELSEWHERE) != 0
        there = np.flatnonzero(~found.gone)
        whats = np.where(elsewhere, NOTHING, found.kinds)
        self._causes[rows.rule].note_all(*(column[there] for column in (rows.senders, rows.shapes, whats)))
        excused = _in_gaps(view, rows, np.where(found.gone, _NEVER, found.value))
        excused |= found.form == EVERY_ID_FORM
        # TRF-009 names the frames.
        excused |= proven & (found.form == OTHER_ID_FORM) & (found.flags & MISNUMBERED == 0)

        def further(k: int) -> Sequence[int]:
            return found.evidence(k) if rows.rule == SEQUENCE or proven[k] else ()

        for noted in (False, True):
            which = np.flatnonzero(~elsewhere & (excused == noted))
            why = Why(found.kinds[which], partial(_of, found.cause, which), partial(_of, further, which))
            yield from rows.take(which).occurrences(view, why, noted=noted, drops=True)

    def _unsearched(self, view: View, rows: Rows) -> Iterator[Occurrences]:
        """Yield transfers with the cause of earlier ones."""
        if not len(rows.row):
            return
        known = self._causes[rows.rule].like_all(rows.senders, rows.shapes)
        excused = _in_gaps(view, rows, np.full(len(known), _NEVER)) | _NOTED[known]
        for noted in (False, True):
            which = np.flatnonzero((known != NOTHING) & (excused == noted))
            why = Why(known[which], partial(_alike, known[which]))
            yield from rows.take(which).occurrences(view, why, noted=noted, drops=True)


def _alike(known: Array, k: int) -> Cause:
    """Return the cause of one of those that are told like earlier ones."""
    return alike(FORMS[known[k]].what)


def _of(make: Callable[[int], T], which: Array, k: int) -> T:
    """Return what is made of one of those that are picked."""
    return make(int(which[k]))


def _in_gaps(view: View, rows: Rows, behind: Array) -> Array:
    """Return whether what each transfer lacks may have come in a gap of the capture (CAP-002).

    `behind` is when the first frame of its session came behind its last one.
    """
    t, end = (column[rows.row] for column in (rows.table.t, rows.table.t_end))
    found, timed = np.zeros(len(t), bool), np.flatnonzero(t != NO_TIME)
    if len(timed):
        since, until = np.minimum(t, end)[timed].min(), np.maximum(t, end)[timed].max() + max(_NEXT, _CLOSED)
        if view.paused(int(since), int(until)):  # else there is no gap anywhere near
            each = zip(*(column[timed].tolist() for column in (t, end, behind)), strict=True)
            found[timed] = [_in_gap(view, rows.rule, *times) for times in each]
    return found


def _in_gap(view: View, rule: str, t: int, end: int, behind: int) -> bool:
    """Return the same of one that has a time, and that ends at `end`."""
    if rule == LATE:
        return view.paused(t, t + _CLOSED)
    if rule == CUT and view.paused(end, end + _NEXT):
        return behind - end > _NEXT
    return view.paused(t, end)
