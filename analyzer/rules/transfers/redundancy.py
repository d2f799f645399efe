"""Transfers that one of two interfaces misses, where both carry the same traffic."""

from __future__ import annotations

from typing import TYPE_CHECKING, ClassVar

import numpy as np

from analyzer.tables import KINDS, STATUSES, TRANSFER_IDS
from dissectors.kit import MILLISECOND, NO_TIME, SECOND, Occurrence, Rule

if TYPE_CHECKING:
    from collections.abc import Iterator

    from dissectors.kit import Array, View

REQUEST, _MESSAGE = KINDS.index("request"), KINDS.index("message")
LATE = 3 * SECOND  # a transfer can come out 2.0 s after its start
MOST = 1 << 16  # transfers that wait for their copy
MOST_ALONE = 4096  # transfers without one that wait for a later pair
_WHOLE = [STATUSES.index(word) for word in ("ok", "unchecked", "bad crc")]
_NOBODY = 127  # in place of a destination
# Rows of what waits: session and transfer ID, time, interface, source, type, number of the first frame.
_CODE, _T, _BUS, _SRC, _TYPE, _LEAD = range(6)


class RedundantTransfers(Rule):
    """Pairs each transfer with its copy; a session is redundant between its first and its last pair."""

    rules: ClassVar[tuple[str, ...]] = ("TRF-028",)

    def __init__(self) -> None:
        self._waiting: Array = np.empty((6, 0), np.int64)
        self._pairs: dict[int, tuple[int, int]] = {}
        self._alone: list[tuple[int, Occurrence]] = []

    def feed(self, view: View) -> Iterator[Occurrence]:
        """Yield transfers without a copy, once a later one of their session had one."""
        if len(view.starts) == 1 or not len(view.transfers):
            return
        rows = np.concatenate((self._waiting, _rows(view)), axis=1)
        rows = rows[:, np.lexsort((rows[_T], rows[_CODE]))]
        starts, paired = _paired(rows, round(view.number("TRF-028", "match_ms") * MILLISECOND))
        self._note(rows[:, starts])
        rows = rows[:, ~paired]
        over = rows[_T] < view.end - LATE
        self._leave(view, rows[:, over])
        self._waiting = rows[:, ~over][:, -MOST:]
        yield from self._ready()

    def finish(self, view: View) -> Iterator[Occurrence]:
        """Yield what still waited."""
        self._leave(view, self._waiting)
        yield from self._ready()

    def _note(self, pairs: Array) -> None:
        """Note the first and the last pair of each session."""
        pairs = pairs[:, np.argsort(pairs[_CODE] // TRANSFER_IDS, kind="stable")]
        sessions, at = np.unique(pairs[_CODE] // TRANSFER_IDS, return_index=True)
        if not len(at):
            return
        low, high = np.minimum.reduceat(pairs[_T], at), np.maximum.reduceat(pairs[_T], at)
        for session, first, last in zip(sessions.tolist(), low.tolist(), high.tolist(), strict=True):
            known = self._pairs.get(session, (first, last))
            self._pairs[session] = min(first, known[0]), max(last, known[1])

    def _leave(self, view: View, rows: Array) -> None:
        """Give up on copies of these, of sessions that had some."""
        if not self._pairs:
            return
        for code, t, bus, src, kind, lead in rows.T.tolist():
            since = self._pairs.get(code // TRANSFER_IDS)
            if since is not None and since[0] < t and len(self._alone) < MOST_ALONE:
                values = {"transfer_id": code % TRANSFER_IDS, "interface": view.buses[bus]}
                found = Occurrence("TRF-028", t, bus, src, view.type_name(kind), (lead,), values)
                self._alone.append((code // TRANSFER_IDS, found))

    def _ready(self) -> Iterator[Occurrence]:
        """Yield those between two pairs: then both interfaces were recorded."""
        kept = []
        for session, found in self._alone:
            if self._pairs[session][1] > found.t:
                yield found
            else:
                kept.append((session, found))
        self._alone = kept


def _rows(view: View) -> Array:
    """Return complete transfers of this batch with a time and a source, from the second interface's first frame on."""
    t = view.transfers
    both = sorted(view.starts.values())[1:2] or [NO_TIME]
    service = t.kind >= REQUEST
    session = (t.type_id.astype(np.int64) << 2 | t.kind) << 14 | np.where(service, t.dst, _NOBODY).astype(np.int64) << 7
    code = (session | t.src) * TRANSFER_IDS + t.transfer_id
    fit = np.isin(t.status, _WHOLE) & (t.t != NO_TIME) & (t.t >= both[0]) & ((t.src > 0) | (t.kind == _MESSAGE))
    return np.array([code, t.t, t.bus, t.src, t.code, t.lead], np.int64)[:, fit]


def _paired(rows: Array, apart: int) -> tuple[Array, Array]:
    """Return which rows begin a pair, and which belong to one: neighbours of one code on different interfaces."""
    link = (np.diff(rows[_CODE]) == 0) & (np.diff(rows[_BUS]) != 0) & (np.diff(rows[_T]) <= apart)
    begins = link & ~np.concatenate(([False], link[:-1]))
    place = np.arange(len(link))
    since = np.maximum.accumulate(np.where(begins, place, 0)) if len(link) else place
    starts = (link & ((place - since) % 2 == 0)).nonzero()[0]
    paired = np.zeros(rows.shape[1], bool)
    paired[starts] = paired[starts + 1] = True
    return starts, paired
