"""PUSH-010 and PUSH-011: how a node's packets are read, and which power unit is which ESC."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from dissectors.kit import Rule, sender, sound, usable
from dissectors.tmotor.rules.packets.carried import FIRST_UNIT, LAST_UNIT, occurrence, packet_tables, unit_key

if TYPE_CHECKING:
    from collections.abc import Iterator

    from dissectors.kit import Array, DecodedTable, Occurrence, View

_MOST = 4096
_INDEXES = 5  # bits of esc_index


class FloatOrders(Rule):
    """States once for a node that its packets are read high byte first."""

    rules = ("PUSH-010",)

    def __init__(self) -> None:
        """Begin without a node."""
        self._known: set[int] = set()

    def feed(self, view: View) -> Iterator[Occurrence]:
        """Yield the first packets that are read so."""
        tables = [one for one in packet_tables(view) if "big_endian" in one and one["big_endian"].any()]
        first: dict[int, tuple[int, DecodedTable, int]] = {}
        for table in tables:
            rows = (table["big_endian"] & sound(table)).nonzero()[0]
            nodes = sender(table)[rows]
            for node in np.unique(nodes).tolist():
                row = int(rows[nodes == node][0])
                place = int(table["transfer"][row])
                if node not in first or place < first[node][0]:
                    first[node] = place, table, row
        for node, (_, table, row) in first.items():
            if node not in self._known and len(self._known) < _MOST:
                self._known.add(node)
                yield occurrence(view, table, row, "PUSH-010", {"order": "high byte first"})


class UnitMapping(Rule):
    """Lists units that are not in the order of the indexes, once for each node, unit and index."""

    rules = ("PUSH-011",)

    def __init__(self) -> None:
        """Begin without an index."""
        self._index: dict[int, int] = {}
        self._reported: set[tuple[int, int, int]] = set()

    def feed(self, view: View) -> Iterator[Occurrence]:
        """Yield units whose number is not that of the ESC's latest index."""
        status = view.table("ESCStatus")
        reports = {} if status is None else _indexes_of(status, self._index)
        packets = view.table("PUSHCAN.MotorStatus")
        if packets is not None:
            yield from self._compare(view, packets, status, reports)
        if status is not None:
            for node, rows in reports.items():
                self._index[node] = int(status["esc_index"][rows[-1]])

    def _compare(
        self, view: View, packets: DecodedTable, status: DecodedTable | None, reports: dict[int, Array]
    ) -> Iterator[Occurrence]:
        pairs = unit_key(packets)
        good = sound(packets)
        for pair in np.bincount(pairs[good], minlength=1).nonzero()[0].tolist():
            node, unit = pair >> 8, pair & 0xFF
            if not FIRST_UNIT <= unit <= LAST_UNIT:
                continue
            index = self._index.get(node)
            if node not in reports or status is None:
                if index is not None and self._new(node, unit, index):
                    row = int((good & (pairs == pair)).nonzero()[0][0])
                    yield _mapping_breach(view, packets, row, index)
                continue
            rows = (good & (pairs == pair)).nonzero()[0]
            at = status["transfer"][reports[node]].searchsorted(packets["transfer"][rows]) - 1
            before = -1 if index is None else index
            indexes = np.where(at < 0, before, status["esc_index"][reports[node][np.maximum(at, 0)]].astype(np.int64))
            for found in np.unique(indexes[indexes >= 0]).tolist():
                if self._new(node, unit, found):
                    yield _mapping_breach(view, packets, int(rows[indexes == found][0]), found)

    def _new(self, node: int, unit: int, index: int) -> bool:
        if index == unit - FIRST_UNIT or (node, unit, index) in self._reported or len(self._reported) >= _MOST:
            return False
        self._reported.add((node, unit, index))
        return True


def _indexes_of(status: DecodedTable, known: dict[int, int]) -> dict[int, Array]:
    """Return rows of the nodes that say another index than is known of them, or several."""
    good, nodes = usable(status), sender(status)
    packed = nodes.astype(np.int64) << _INDEXES | status["esc_index"]
    new: dict[int, Array] = {}
    for code in np.bincount(packed[good], minlength=1).nonzero()[0].tolist():
        node, index = code >> _INDEXES, code & (1 << _INDEXES) - 1
        if node not in new and known.get(node) != index and (node in known or len(known) < _MOST):
            new[node] = (good & (nodes == node)).nonzero()[0]
    return new


def _mapping_breach(view: View, packets: DecodedTable, row: int, index: int) -> Occurrence:
    values = {"unit_id": int(packets["unit_id"][row]), "esc_index": index}
    return occurrence(view, packets, row, "PUSH-011", values)
