"""Transfer IDs that do not count up by 1: gaps, repetitions, restarts, shared counters, several senders in a session.

The core measures each step, so a session without steps costs nothing. It also follows a node whose counter breaks: what
it breaks is held back until it is clear whether one counter for all types (TRF-020), several devices (BUS-010) or a
counter that always wraps early explain it. All show in a few transfers; else everything is reported after 2.0 s without
another step, and transfers that only changed places are one breach.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, ClassVar

import numpy as np

from analyzer._native import IdNodes
from analyzer.decode.columns import NODES
from analyzer.decode.sent import cells
from analyzer.facts.node_status import NODE_STATUS
from analyzer.rules.counters.causes import shown_causes
from analyzer.rules.counters.id_steps import MESSAGE, odd_cells, odd_rows
from analyzer.rules.counters.orphan_frames import OrphanFrames
from analyzer.rules.counters.told_steps import ToldSteps
from dissectors.kit import Rule

if TYPE_CHECKING:
    from collections.abc import Iterator

    from dissectors.kit import Array, Occurrence, Occurrences, TransferTable, View

_NEVER = 1 << 62


class TransferIds(Rule):
    """Steps of transfer IDs, and what explains them. Nodes are at most 127 an interface."""

    rules: ClassVar[tuple[str, ...]] = ("TRF-016", "TRF-017", "TRF-018", "TRF-019", "TRF-020", "BUS-010")

    def __init__(self) -> None:
        self._nodes = IdNodes()
        self._orphans = OrphanFrames()

    def feed(self, view: View) -> Iterator[Occurrences | Occurrence]:
        """Yield breaches that are explained, or that nothing explains."""
        self._orphans.feed(view)
        t = view.transfers
        odd = odd_rows(t)
        messages = _messages(t, np.concatenate((_senders(t, odd), cells(self._nodes.sharing, np.uint16))))
        lists = t.frame_lists if len(odd) or len(messages[0]) else (np.empty(0, np.int64), np.empty(0, np.uint64))
        indexes = [*view.indexes(0, _NEVER)] if len(odd) else []
        given = odd_cells(view, odd), messages, _uptimes(view)
        least = int(view.number("BUS-010", "min_transfers"))
        known = view.start, view.gap_ends, least, view.end, view.starts, view.types.starts
        causes, told = self._nodes.feed(self._orphans.index, indexes, given, lists, known)
        yield from shown_causes(view, causes)
        yield from ToldSteps.of(told).occurrences(view.frames.first)

    def finish(self, _view: View) -> Iterator[Occurrences | Occurrence]:
        """Yield what was held back at the end of the capture."""
        _, told = self._nodes.finish()
        yield from ToldSteps.of(told).occurrences()


def _senders(t: TransferTable, rows: Array) -> Array:
    """Return bus and node of transfers."""
    return t.bus[rows].astype(np.uint16) << 8 | t.src[rows]


def _messages(t: TransferTable, senders: Array) -> tuple[Array, ...]:
    """Return the messages of some nodes: senders, rows, types, transfer IDs, steps."""
    rows = np.empty(0, np.int64)
    if len(senders):
        wanted = np.zeros(NODES, bool)
        wanted[senders] = True
        rows = (t.kind == MESSAGE).nonzero()[0]
        rows = rows[wanted[_senders(t, rows)]]
    return _senders(t, rows), rows.astype(np.uint32), t.code[rows], t.transfer_id[rows], t.step[rows]


def _uptimes(view: View) -> tuple[Array, ...]:
    """Return what nodes say: senders, rows of the transfers, times, seconds, transfer IDs."""
    t, table = view.transfers, view.table(NODE_STATUS)
    rows = np.empty(0, np.int64) if table is None else table.trusted.nonzero()[0]
    seconds = np.empty(0, np.int64) if table is None else table["uptime_sec"][rows].astype(np.int64)
    row = rows if table is None else table.row[rows]
    return _senders(t, row), row.astype(np.uint32), t.t[row], seconds, t.transfer_id[row]
