"""ESCStatus: a status word that counts errors (4.4.3)."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from dissectors.kit import NODES, Previous, Rule, breach, sender, usable
from dissectors.records import dataclass, replace
from dissectors.tmotor.rules.values.reports import mode

if TYPE_CHECKING:
    from collections.abc import Iterator

    from dissectors.kit import Array, DecodedTable, Occurrence, Occurrences, View


@dataclass(slots=True)
class _Count:
    """The first rise of a node's word, and how often it rose."""

    place: Occurrence
    before: int
    value: int
    rises: int = 0


class ErrorCount(Rule):
    """A first word that only rises, in small steps, at least twice, and never shows a mode; an entry a node."""

    rules = ("TYP-307",)

    def __init__(self) -> None:
        self._other = np.zeros(NODES, bool)  # nodes whose word is no counter
        self._before = Previous(-1)
        self._counts: dict[int, _Count] = {}

    def feed(self, view: View) -> Iterator[Occurrences]:
        """Follow nodes that may count."""
        table = view.table("ESCStatus")
        if table is not None:
            rows = usable(table).nonzero()[0]
            node, word = sender(table, rows), table["error_count"][rows]
            self._other[node[mode(word) - np.uint32(1) < 8]] = True
            still = ~self._other[node]
            if still.any():
                self._follow(view, table, rows[still], node[still])
        yield from ()

    def _follow(self, view: View, table: DecodedTable, rows: Array, node: Array) -> None:
        word = table["error_count"][rows].astype(np.int64)
        (before,), _ = self._before.feed(node, word)
        step = np.where(before < 0, 0, word - before)
        self._other[node[(step < 0) | (step > view.number("TYP-307", "max_step"))]] = True
        for at in (step != 0).nonzero()[0].tolist():
            code = int(node[at])
            if self._other[code]:
                self._counts.pop(code, None)
            else:
                if code not in self._counts:
                    place = breach(view, table, int(rows[at]), "TYP-307", {}, held=True)
                    self._counts[code] = _Count(place, int(before[at]), int(word[at]))
                self._counts[code].rises += 1

    def finish(self, _view: View) -> Iterator[Occurrence]:
        """Yield nodes that counted to the end."""
        for code, one in sorted(self._counts.items()):
            if one.rises > 1 and not self._other[code]:
                yield replace(one.place, values={"before": one.before, "value": one.value})
