"""The last reports of a supply, with which later ones are compared."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from analyzer.flight.thresholds import lasting
from dissectors.records import dataclass

if TYPE_CHECKING:
    from collections.abc import Sequence

    from analyzer.flight.clock import RowPlaces
    from dissectors.kit import Array

MOST = 4096  # reports of one device within the time in which a voltage may fall


@dataclass(slots=True)
class SupplyReports:
    """Reports of a supply: V, A and what the line of its current says, in V; NaN for what is not known."""

    at: RowPlaces
    voltage: Array
    current: Array
    line: Array

    def told(self, k: int) -> tuple[float, float]:
        """Return voltage and current of one of them."""
        return float(self.voltage[k]), float(self.current[k])


class _Piece(NamedTuple):
    """Reports that came together, the latest of their times and the highest of their voltages."""

    reports: SupplyReports
    newest: int
    highest: float


class RecentSupply:
    """Keeps the reports of one device of the last `sink_s`, `MOST` at most."""

    def __init__(self) -> None:
        self._pieces: list[_Piece] = []

    @property
    def highest(self) -> float:
        """The highest voltage."""
        return max((one.highest for one in self._pieces), default=-np.inf)

    def followed_by(self, new: SupplyReports) -> SupplyReports:
        """Return all of them, and others behind them."""
        return _joined([*(one.reports for one in self._pieces), new]) if self._pieces else new

    def keep(self, new: SupplyReports) -> None:
        """Take the next ones."""
        oldest = int(new.at.ran.max()) - lasting("sink")
        first = max(len(new.at) - MOST, int(np.argmax(new.at.ran >= oldest)))
        some = slice(first, None)
        kept = [one for one in self._pieces if one.newest >= oldest]
        at, columns = new.at.take(some).settled(), [one[some].copy() for one in (new.voltage, new.current, new.line)]
        kept.append(_Piece(SupplyReports(at, *columns), int(at.ran.max()), float(columns[0].max())))
        while len(kept) > 1 and sum(len(one.reports.at) for one in kept) > MOST:
            del kept[0]
        self._pieces = kept


def _joined(pieces: Sequence[SupplyReports]) -> SupplyReports:
    at = pieces[0].at
    for one in pieces[1:]:
        at = at.followed_by(one.at)
    voltage, current, line = (
        np.concatenate(columns)
        for columns in zip(*((one.voltage, one.current, one.line) for one in pieces), strict=True)
    )
    return SupplyReports(at, voltage, current, line)
