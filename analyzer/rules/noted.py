"""The rule over fields beyond what the notes of their dissector say, made for the types in use."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from analyzer.rules.catalogue import load
from analyzer.rules.field_tests import judged
from analyzer.rules.values.noted_fields import LIMITS, NAMES, NotedColumn, columns_of
from dissectors.kit import Rule

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator

    from dissectors import Registry
    from dissectors.kit import Array, DecodedTable, Occurrences, Severity, Values, View


class NotedFields(Rule):
    """Every field with limits or an enumeration, of every type and packet, unless the page of a rule names it."""

    rules = (LIMITS, NAMES)

    def __init__(self, registry: Registry) -> None:
        self._registry = registry
        self._taken = {name for page in load(registry).values() for name in page.judged}
        self._packets = {
            f"{carrier.table}.{one.name}": (one.layout, one.notes)
            for carrier in registry.carriers()
            for one in (carrier.packets.packets if carrier.packets is not None else ())
        }
        self._columns: dict[str, tuple[NotedColumn, ...]] = {}

    def feed(self, view: View) -> Iterable[Occurrences]:
        """Check each field with one mask."""
        for name in view.tables():
            if name not in self._columns:
                self._columns[name] = tuple(self._of(name))
            table = view.table(name) if self._columns[name] else None
            for column in self._columns[name] if table is not None else ():
                if table is not None and (column.listed or column.name in table):
                    yield from self._check(view, table, column)

    def _check(self, view: View, table: DecodedTable, column: NotedColumn) -> Iterator[Occurrences]:
        severity: Severity | None = "note" if table.name.startswith("uavcan.") else None
        for rule, asked in ((LIMITS, (column.low, column.high) != (None, None)), (NAMES, bool(column.enum))):
            if not asked or (rule == LIMITS and column.enum):
                continue
            rows, shown = _wrong(table, column, column.outside if rule == LIMITS else column.nameless)
            if not len(rows):
                continue
            found = dict(zip(rows.tolist(), shown.tolist(), strict=True))

            def values(row: int, rule: str = rule, found: dict[int, float] = found) -> Values:
                said = f"{found[row]:.6g}{f' {column.unit}' if column.unit else ''}"
                return {"field": column.name, "value": said, "allowed": column.allowed(rule)}

            key = np.rint(shown).astype(np.int64) if rule == NAMES else None
            yield view.among_rows(rule, table, rows, values, key=key, severity=severity)

    def _of(self, table: str) -> Iterator[NotedColumn]:
        if table in self._packets:
            layout, notes = self._packets[table]
        elif table in self._registry.names():
            message = self._registry.resolve(table)
            layout, notes = message.layout, message.notes
        else:
            return
        for name, note in notes.items():
            for column in columns_of(name, note, layout):
                if f"{table}.{column.name}" not in self._taken:
                    yield column


def _wrong(table: DecodedTable, column: NotedColumn, wrong: object) -> tuple[Array, Array]:
    """Return rows that can be relied on and are wrong, with what they show; of a list the first wrong element."""
    if not column.listed:
        shown = table[column.name]
        rows = np.flatnonzero(wrong(shown))  # type: ignore[operator]
        rows = rows[judged(table, column.name, rows)] if len(rows) else rows
        if column.word and column.special and len(rows):
            rows = rows[~np.isin(table[column.word][rows], column.special)]
        return rows, shown[rows]
    offsets, elements = table.lists(column.name)
    places = np.flatnonzero(wrong(elements))  # type: ignore[operator]
    rows, first = np.unique(np.searchsorted(offsets, places, "right") - 1, return_index=True)
    good = table.trusted[rows]
    return rows[good], elements[places[first]][good]
