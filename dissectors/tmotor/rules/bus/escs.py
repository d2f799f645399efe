"""How many ESCs there are: more than a bus should have, fewer than channels."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from dissectors.kit import Rule, breach
from dissectors.records import replace
from dissectors.tmotor.rules.joined.joins import commands, units

if TYPE_CHECKING:
    from collections.abc import Iterable

    from dissectors.kit import Occurrence, Occurrences, View


class TooMany(Rule):
    """More ESCs on one bus than the document recommends."""

    rules = ("BUS-008",)

    def __init__(self) -> None:
        self._nodes: dict[int, set[int]] = {}
        self._found: dict[int, Occurrence] = {}

    def feed(self, view: View) -> Iterable[Occurrences | Occurrence]:
        """Count nodes; the place is the first report of the first one too many."""
        table, most = view.table("ESCStatus"), int(view.number("BUS-008", "max_nodes"))
        if table is None:
            return
        fresh: dict[tuple[int, int], int] = {}
        for unit, rows in units(view).items():
            if unit.node not in self._nodes.setdefault(unit.bus, set()):
                row = int(rows[0])
                fresh[unit.bus, unit.node] = min(row, fresh.get((unit.bus, unit.node), row))
        for (bus, node), row in sorted(fresh.items(), key=lambda one: one[1]):
            self._nodes[bus].add(node)
            if len(self._nodes[bus]) == most + 1:
                self._found[bus] = breach(view, table, row, "BUS-008", {}, held=True, node=None)
        yield from ()

    def finish(self, _view: View) -> Iterable[Occurrences | Occurrence]:
        """Yield how many there were in the end."""
        for bus, found in self._found.items():
            yield replace(found, values={"nodes": len(self._nodes[bus])})


class SpareChannels(Rule):
    """Channels of commands for which no ESC ever reports."""

    rules = ("BUS-027",)

    def __init__(self) -> None:
        self._indexes: set[int] = set()
        self._first: dict[int, list[Occurrence]] = {}

    def feed(self, view: View) -> Iterable[Occurrences | Occurrence]:
        """Remember indexes, and the first command with each channel."""
        self._indexes.update(unit.index for unit in units(view))
        for bus, sent in commands(view).items():
            known = self._first.setdefault(bus, [])
            for channel in range(len(known), len(sent.cmd)):
                row = int(sent.rows[np.flatnonzero(sent.counts > channel)[0]])
                known.append(breach(view, sent.table, row, "BUS-027", {"channel": channel + 1}, held=True))
        yield from ()

    def finish(self, _view: View) -> Iterable[Occurrences | Occurrence]:
        """Yield what never reported, if anything did."""
        if self._indexes:
            for known in self._first.values():
                yield from (one for one in known if int(one.values["channel"]) - 1 not in self._indexes)
