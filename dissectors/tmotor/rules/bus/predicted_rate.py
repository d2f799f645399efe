"""How much all configured rates add up to."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from dissectors.kit import SECOND, Occurrence, Rule, breach, usable
from dissectors.records import replace
from dissectors.tmotor.rules.joined.joins import commands

if TYPE_CHECKING:
    from collections.abc import Iterable

    from dissectors.kit import Occurrences, View
from dissectors.tmotor.rules.bus.report_rate import OPEN

_FRAMES_A_REPORT = 3
_FEW = 7  # bytes that one frame holds


class PredictedRate(Rule):
    """The sum of all configured rates, with the commands that there were."""

    rules = ("BUS-024",)

    def __init__(self) -> None:
        self._rates: dict[int, dict[int, int]] = {}
        self._place: dict[int, Occurrence] = {}
        self._sent: dict[int, list[int]] = {}  # frames of commands, first and last time by bus

    def feed(self, view: View) -> Iterable[Occurrences | Occurrence]:
        """Collect rates and commands."""
        for bus, sent in commands(view).items():
            length = view.transfers.length[sent.table.row[sent.rows]]
            frames = int(np.where(length <= _FEW, 1, (length + 8) // _FEW).sum())
            entry = self._sent.setdefault(bus, [0, int(sent.t[0]), 0])
            entry[0], entry[2] = entry[0] + frames, int(sent.t[-1])
        table = view.table("ParamGet")
        if table is not None:
            for row in np.flatnonzero(usable(table) & (table["esc_fdb_rate"] != OPEN)).tolist():
                bus, node, rate = int(table.bus[row]), int(table.src[row]), int(table["esc_fdb_rate"][row])
                if self._rates.setdefault(bus, {}).get(node) == rate:
                    continue
                self._rates[bus][node] = rate
                self._place[bus] = breach(view, table, row, "BUS-024", {}, held=True, node=None)
        yield from ()

    def finish(self, view: View) -> Iterable[Occurrences | Occurrence]:
        """Add up."""
        limit = int(view.number("BUS-024", "limit_per_s"))
        for bus, rates in self._rates.items():
            sent, first, last = self._sent.get(bus, (0, 0, 0))
            total = _FRAMES_A_REPORT * sum(rates.values()) + (sent * SECOND // (last - first) if last > first else 0)
            if total > limit:
                yield replace(self._place[bus], values={"frames": total, "limit": limit})
