"""Two nodes that claim the same: one index, or the throttle."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from dissectors.kit import NO_TIME, SECOND, Rule
from dissectors.records import replace
from dissectors.tmotor.rules.joined.joins import MOST_UNITS, commands, units

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator

    from dissectors.kit import Array, DecodedTable, Occurrence, Occurrences, View


class SameIndex(Rule):
    """One index in the reports of two nodes."""

    rules = ("BUS-009",)

    def __init__(self) -> None:
        self._last: dict[tuple[int, int], tuple[int, int]] = {}  # (bus, index): node and time of the last report

    def feed(self, view: View) -> Iterable[Occurrences | Occurrence]:
        """Compare neighbours in the sequence of all reports with one index."""
        table = view.table("ESCStatus")
        if table is None or view.start == NO_TIME:
            return
        window = round(view.number("BUS-009", "window_s") * SECOND)
        together: dict[tuple[int, int], list[Array]] = {}
        for unit, rows in units(view).items():
            together.setdefault((unit.bus, unit.index), []).append(rows)
        for place, parts in together.items():
            rows = parts[0] if len(parts) == 1 else np.sort(np.concatenate(parts))
            node, t = self._last.get(place, (int(table.src[rows[0]]), int(table.t[rows[0]])))
            if len(parts) > 1 or node != table.src[rows[0]]:
                yield from _twos(view, table, rows, ("BUS-009", place[1]), (node, t), window)
            if place in self._last or len(self._last) < MOST_UNITS:
                self._last[place] = int(table.src[rows[-1]]), int(table.t[rows[-1]])


class TwoSources(Rule):
    """Throttle from two nodes."""

    rules = ("BUS-023",)

    def __init__(self) -> None:
        self._last: dict[int, tuple[int, int]] = {}

    def feed(self, view: View) -> Iterable[Occurrences | Occurrence]:
        """Compare neighbours in the sequence of all commands of a bus."""
        if view.start == NO_TIME:
            return
        window = round(view.number("BUS-023", "window_s") * SECOND)
        for bus, sent in commands(view).items():
            last = self._last.get(bus, (int(sent.src[0]), int(sent.t[0])))
            if last[0] != sent.src[0] or (sent.src != sent.src[0]).any():
                yield from _twos(view, sent.table, sent.rows, ("BUS-023", None), last, window)
            self._last[bus] = int(sent.src[-1]), int(sent.t[-1])


def _twos(
    view: View, table: DecodedTable, rows: Array, what: tuple[str, int | None], last: tuple[int, int], window: int
) -> Iterator[Occurrences]:
    """Yield rows from another node than the row before, within a window. `last` is the row before all of them."""
    rule, index = what
    src, t = table.src[rows].astype(np.int64), table.t[rows]
    before, since = np.concatenate(([last[0]], src[:-1])), t - np.concatenate(([last[1]], t[:-1]))
    at = np.flatnonzero((src != before) & (since < window))
    if not len(at):
        return
    low, high = np.minimum(src, before)[at], np.maximum(src, before)[at]
    place = {int(row): k for k, row in enumerate(rows[at])}

    def values(row: int) -> dict[str, int]:
        k = place[row]
        more = {} if index is None else {"esc_index": index}
        return {"first_node": int(low[k]), "second_node": int(high[k]), **more}

    found = view.among_rows(rule, table, rows[at], values, key=low * 128 + high if index is None else None)
    yield replace(found, node=high)
