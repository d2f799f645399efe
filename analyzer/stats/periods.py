"""`periods`: how evenly each sender sends each type."""

from __future__ import annotations

from math import floor, log10
from typing import TYPE_CHECKING

import numpy as np

from analyzer.facts.periods import Periods
from analyzer.facts.traffic import FEWEST_OF_RATE
from analyzer.stats.distribution import Distribution
from analyzer.stats.statistic import Statistic
from analyzer.stats.table import StatColumn, StatTable
from analyzer.stats.traffic import type_of
from analyzer.tables import KINDS

if TYPE_CHECKING:
    from collections.abc import Sequence

    from analyzer.facts.periods import Key
    from analyzer.stats.chosen import ChosenBatch
    from analyzer.stats.order import StatOrder
    from analyzer.stats.statistic import StatEnd
    from dissectors.kit import Array

COLUMNS = (
    StatColumn("bus", "Bus", "text"),
    StatColumn("node", "Node", "text"),
    StatColumn("type", "Type", "text"),
    StatColumn("count", "Count", rank=2),
    StatColumn("nominal_hz", "Hz", "number", 1),
    StatColumn("median_ms", "Median", "number", 2),
    StatColumn("jitter_ms", "Jitter", "number", 2),
    StatColumn("p99_ms", "p99", "number", 2),
    StatColumn("worst_ms", "Worst", "number", 1),
    StatColumn("worst_periods", "x", "number", 1),
    StatColumn("worst_ns", "Worst until", "time", rank=1),
)
_MS = 1000
_MESSAGE = KINDS.index("message")


class PeriodTable(Statistic):
    """A row a node and type of message that came at least twice; times are from first frame to first frame."""

    def __init__(self, _: StatOrder) -> None:
        self._gaps: dict[Key, Distribution] = {}
        self._worst: dict[Key, tuple[float, int]] = {}
        self._periods = Periods(self._note)

    def feed(self, batch: ChosenBatch) -> None:
        """Add the next batch."""
        self._periods.feed(batch.whole)

    def finish(self, end: StatEnd) -> Sequence[StatTable]:
        """Return the table, by interface, node and type."""
        rows = []
        for key, pace in sorted(self._periods.all.items()):
            gaps = self._gaps.get(key)
            if gaps is None or not end.timed:
                continue
            bus, node, type_id = key
            median, early, late = (gaps.quantile(share) or 0.0 for share in (0.5, 0.05, 0.95))
            nominal = _rounded(1 / median) if pace.steady and median else None
            times = [median, (late - early) / 2, gaps.quantile(0.99) or 0.0, gaps.high]
            name = type_of(end.registry, _MESSAGE, type_id)
            far = gaps.high / median if median else None
            ms: list[float | None] = [time * _MS for time in times]
            if pace.gaps + 1 < FEWEST_OF_RATE:
                ms[1] = ms[2] = None  # a time or two are not spread
            rows.append((end.buses[bus], str(node), name, pace.gaps + 1, nominal, *ms, far, self._worst[key][1]))
        about = (
            "time from one message of a node and type to the next, in ms; 90 % are within the jitter of the "
            "median; x is the worst in medians; Hz is what was meant, - for what comes as it is needed"
        )
        notes = [] if end.timed else ["no times that can be compared: no periods"]
        return (StatTable("periods", about, COLUMNS, rows, notes),)

    def _note(self, key: Key, gaps: Array, t: Array) -> None:
        self._gaps.setdefault(key, Distribution()).feed(gaps)
        at = int(np.argmax(gaps))
        if float(gaps[at]) > self._worst.get(key, (-1.0, 0))[0]:
            self._worst[key] = float(gaps[at]), int(t[at])


def _rounded(hz: float) -> float:
    """Return a rate to two digits: what was meant, as far as what came tells it."""
    return round(hz, 1 - floor(log10(hz)))
