"""ESCStatus: the unit of a node's temperature (4.4.3)."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from dissectors.kit import NODES, Rule, breach, sender, usable
from dissectors.records import replace

if TYPE_CHECKING:
    from collections.abc import Iterator

    from dissectors.kit import Occurrence, Occurrences, View
from dissectors.tmotor.rules.values.float16 import _first_rows

_UNITS = {"K": "kelvin", "degC": "degrees Celsius"}


class TemperatureUnit(Rule):
    """States each node's unit of temperature, as its readings have it; at most one entry a node."""

    rules = ("TYP-301",)

    def __init__(self) -> None:
        self._lowest = np.full(NODES, np.inf, np.float32)
        self._highest = np.full(NODES, -np.inf, np.float32)
        self._places: dict[int, Occurrence] = {}

    def feed(self, view: View) -> Iterator[Occurrences]:
        """Widen the ranges."""
        table = view.table("ESCStatus")
        if table is not None:
            rows = (usable(table) & np.isfinite(table["temperature"])).nonzero()[0]
            node, degrees = sender(table, rows), table["temperature"][rows]
            for code, at in _first_rows(node):
                if code not in self._places:
                    self._places[code] = breach(view, table, int(rows[at]), "TYP-301", {}, held=True)
            np.minimum.at(self._lowest, node, degrees)
            np.maximum.at(self._highest, node, degrees)
        yield from ()

    def finish(self, view: View) -> Iterator[Occurrence]:
        """Yield one statement a node."""
        for code, place in sorted(self._places.items()):
            choice = view.choice("ESCStatus", "temperature", code >> 7, code & 0x7F)
            name, _, forced = choice.partition(" ")
            unit = " ".join(filter(None, (_UNITS.get(name, name), forced)))
            lowest, highest = float(self._lowest[code]), float(self._highest[code])
            yield replace(place, values={"unit": unit, "lowest": lowest, "highest": highest})
