"""How far the frame count of each packet went from the one before it, by what may share a count."""

from __future__ import annotations

from copy import deepcopy
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from dissectors.kit import NODES, Previous, sender
from dissectors.tmotor.rules.packets.carried import carrier, place, unit_key

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence

    from dissectors.kit import Array, DecodedTable

READINGS = ("unit", "frame ID", "sender", "frame ID of the sender")
BY_UNIT = 0
BY_ID = frozenset({1, 3})  # each frame ID for itself
OF_UNIT = frozenset({0, 1})  # each unit for itself
_NONE = -1


class Hit(NamedTuple):
    """A packet whose steps are not all 1; one is None for the first packet of what shares a count."""

    place: int
    table: DecodedTable
    row: int
    key: int
    steps: tuple[int | None, ...]

    @property
    def alike(self) -> bool:
        """Return whether no reading sees it otherwise than that of a unit."""
        return self.steps[BY_UNIT] is not None and len({*self.steps} - {None}) == 1


class CountSteps:
    """Remembers the counts of all senders."""

    def __init__(self) -> None:
        """Begin with nothing seen."""
        self._by_sender: dict[str, Previous] = {}
        self._by_id: dict[str, Previous] = {}
        self._names: dict[str, set[str]] = {}

    def feed(self, tables: Sequence[DecodedTable], chosen: Mapping[tuple[str, int], int]) -> list[Hit]:
        """Add the packets of a batch; return those whose counts do not go on, in their order.

        Of a sender whose reading is `chosen`, by carrier and node, only that one tells.
        """
        hits: list[Hit] = []
        carriers = [carrier(table) for table in tables]
        for name in sorted({*carriers}):
            own = [table for table, other in zip(tables, carriers, strict=True) if other == name]
            hits += self._of_carrier(name, own, {node: one for (other, node), one in chosen.items() if other == name})
        return sorted(hits, key=lambda hit: hit.place)

    def _of_carrier(self, name: str, tables: Sequence[DecodedTable], chosen: Mapping[int, int]) -> Iterator[Hit]:
        whole = [(table.has("frame_count") & table.has("unit_id")).nonzero()[0] for table in tables]
        known = self._note_names(name, tables)
        of_all = self._steps(self._by_sender[name], tables, whole)
        for table, rows, by_sender in zip(tables, whole, of_all, strict=True):
            by_id = by_sender
            if len(known) > 1:
                (by_id,) = self._steps(self._by_id.setdefault(table.name, Previous(_NONE)), [table], [rows])
            steps = np.empty((len(READINGS), len(rows)), np.int64)
            steps[0], steps[1] = _of(table, "count_step", rows), _of(table, "count_step_id", rows)
            steps[2], steps[3] = by_sender, by_id
            odd = (steps != 1) & (steps != _NONE)
            if not odd.any():
                continue
            if chosen:
                readings = np.full(NODES, _NONE, np.int8)
                readings[list(chosen.keys())] = list(chosen.values())
                reading = readings[sender(table, rows)]
                odd &= (reading == _NONE) | (reading == np.arange(len(READINGS))[:, np.newaxis])
            found = (odd.any(axis=0) & table.trusted[rows]).nonzero()[0]
            at = rows[found]
            columns = place(table)[at], at, unit_key(table)[at], *steps[:, found]
            for where, row, key, *told in zip(*(column.tolist() for column in columns), strict=True):
                yield Hit(where, table, row, key, tuple([None if step == _NONE else step for step in told]))

    def _note_names(self, name: str, tables: Sequence[DecodedTable]) -> set[str]:
        """Return the packets of a carrier so far: as long as they are of one kind, they need no count of their own."""
        before = self._by_sender.setdefault(name, Previous(_NONE))
        known = self._names.setdefault(name, set())
        more = {table.name for table in tables} - known
        if more and len(known) == 1:
            self._by_id[next(iter(known))] = deepcopy(before)
        known |= more
        return known

    @staticmethod
    def _steps(before: Previous, tables: Sequence[DecodedTable], rows: Sequence[Array]) -> list[Array]:
        """Return the steps of each table's rows among the packets of all of them."""
        of = list(zip(tables, rows, strict=True))
        if len(of) == 1:
            return [
                _counted(before, sender(table, own), table["frame_count"][own].astype(np.int64)) for table, own in of
            ]
        order = np.argsort(np.concatenate([place(table)[own] for table, own in of]), kind="stable")
        nodes = np.concatenate([sender(table, own) for table, own in of])[order]
        counts = np.concatenate([table["frame_count"][own] for table, own in of])[order].astype(np.int64)
        steps = np.empty(len(order), np.int64)
        steps[order] = _counted(before, nodes, counts)
        return np.split(steps, np.cumsum([len(own) for own in rows])[:-1])


def _counted(before: Previous, nodes: Array, counts: Array) -> Array:
    """Return how far each count went from the one of its node before it."""
    (past,), _ = before.feed(nodes, counts)
    return np.where(past == _NONE, _NONE, (counts - past) % 256)


def _of(table: DecodedTable, name: str, rows: Array) -> Array:
    return np.where(table.has(name)[rows], table[name][rows].astype(np.int64), _NONE)
