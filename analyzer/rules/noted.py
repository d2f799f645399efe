"""The rule over fields beyond what the notes of their dissector say, made for the types in use."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from analyzer.rules.catalogue import load
from analyzer.rules.field_tests import judged
from analyzer.rules.values.noted_fields import LIMITS, NAMES, NotedTest, columns_of
from analyzer.rules.values.shapes import column_of
from dissectors.kit import Rule

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator

    from dissectors import Registry
    from dissectors.kit import Array, DecodedTable, Occurrences, Severity, Values, View


class NotedFields(Rule):
    """Every field with limits or an enumeration, of every type and packet, unless the page of a rule names it."""

    rules = (LIMITS, NAMES)

    def __init__(self, registry: Registry) -> None:
        self._taken = {name for page in load(registry).values() for name in page.judged}
        self._registry = registry
        self._tests: dict[str, tuple[NotedTest, ...]] = {}

    def feed(self, view: View) -> Iterable[Occurrences]:
        """Check each field with one mask."""
        for name in view.tables():
            tests = self._tests.get(name)
            if tests is None:
                tests = self._tests[name] = tuple(self._of(name))
            table = view.table(name) if tests else None
            if table is not None:
                for test in tests:
                    if test.column.inner or test.column.name in table:
                        yield from self._check(view, table, test)

    def _check(self, view: View, table: DecodedTable, test: NotedTest) -> Iterator[Occurrences]:
        rows, shown = _wrong(table, test)
        if not len(rows):
            return
        column = test.column
        severity: Severity | None = "note" if table.name.startswith("uavcan.") else None
        found = dict(zip(rows.tolist(), shown.tolist(), strict=True))

        def values(row: int) -> Values:
            unit = f" {column.unit}" if column.unit else ""
            said = {"value": f"{found[row]:.6g}{unit}", "number": float(found[row]), "unit": unit}
            return {"field": column.name, "allowed": column.allowed, **said}

        key = np.rint(shown).astype(np.int64) if column.rule == NAMES else None
        worst = {} if column.rule == NAMES else {"number": (column.worst, shown.astype(np.float64))}
        yield view.among_rows(column.rule, table, rows, values, key=key, severity=severity, worst=worst)

    def _of(self, table: str) -> Iterator[NotedTest]:
        of = self._registry.definition(table)
        if of is None:
            return
        for name, note in of.notes.items():
            for column in columns_of(name, note, of.layout):
                if f"{table}.{column.name}" not in self._taken:
                    yield NotedTest(column)


def _wrong(table: DecodedTable, test: NotedTest) -> tuple[Array, Array]:
    """Return rows that can be relied on and are wrong, with what they show; of several numbers the first wrong one."""
    column = test.column
    if column.inner:
        return _wrong_inside(table, test)
    name = column.read or column.name if column.word else column_of(table, column.read or column.name)
    shown = table[name]
    rows = test.wrong(shown)
    rows = rows[judged(table, name, rows)] if len(rows) else rows
    if column.word and column.special and len(rows):
        rows = rows[~np.isin(table[column_of(table, column.word)][rows], column.special)]
    if column.only is not None and len(rows):
        field, code = column.only
        rows = rows[table[column_of(table, field)][rows] == code]
    return rows, shown[rows]


def _wrong_inside(table: DecodedTable, test: NotedTest) -> tuple[Array, Array]:
    column = test.column
    head, *members = (column.word or column.name).split(".")
    whole, found = table.inner(column_of(table, head), *members)
    shown = column.part_of(found) if column.word else found
    places = test.wrong(shown)
    if not len(places):
        return places, shown[places]
    if column.word and column.special:
        places = places[~np.isin(found[places], column.special)]
    rows, first = np.unique(whole[places], return_index=True)
    good = table.trusted[rows]
    return rows[good], shown[places[first]][good]
