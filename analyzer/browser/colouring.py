"""Colours of the rows of stored batches: those of the colour rules, found once a segment."""

from __future__ import annotations

from collections import OrderedDict
from typing import TYPE_CHECKING

import numpy as np

from analyzer.browser.store.order import EVENT, FRAME, SETTLED, TRANSFER
from analyzer.window.listed import ListedRows

if TYPE_CHECKING:
    from collections.abc import Sequence

    from analyzer.browser.store.store import TableStore
    from analyzer.views.colours.rules import ColourRule
    from dissectors.kit import Array

_KEPT = 6  # segments
_TABLES = {TRANSFER: "transfers", FRAME: "frames", SETTLED: "settled", EVENT: "events"}


class RowColouring:
    """Finds the parameters of an escape sequence for rows; "" for those that no rule is about.

    Args:
        store: the batches.
        rules: the first that holds wins.
    """

    def __init__(self, store: TableStore, rules: Sequence[ColourRule]) -> None:
        self._store = store
        self._rules = list(rules)
        self._kept: OrderedDict[int, dict[int, Array]] = OrderedDict()

    def codes(self, segment: int, kind: int, rows: Sequence[int]) -> list[str]:
        """Return the codes of rows of a table of a segment."""
        if not self._rules:
            return [""] * len(rows)
        found = self._found(segment)[kind]
        return ["" if found[row] < 0 else self._rules[found[row]].codes for row in rows]

    def _found(self, segment: int) -> dict[int, Array]:
        if segment not in self._kept:
            self._kept[segment] = self._look(segment)
            while len(self._kept) > _KEPT:
                self._kept.popitem(last=False)
        self._kept.move_to_end(segment)
        return self._kept[segment]

    def _look(self, segment: int) -> dict[int, Array]:
        batch = self._store.opened(segment).batch
        rows = ListedRows.all_of(batch)
        found = {kind: np.full(len(getattr(batch, name)), -1, np.int8) for kind, name in _TABLES.items()}
        for k, rule in enumerate(self._rules):
            matches = rule.filter.matcher(zero=self._store.zero).feed(batch)
            loose = np.zeros(len(batch.frames), bool)
            if len(rows.frames):
                loose[rows.frames] = matches.loose(rows.frames)
            for kind, holds in ((TRANSFER, matches.transfers), (FRAME, loose), (EVENT, matches.events)):
                found[kind][(found[kind] < 0) & holds] = k
            if len(batch.settled):
                found[SETTLED][(found[SETTLED] < 0) & matches.settled] = k
        return found
