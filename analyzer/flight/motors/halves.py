"""Reports of ESCs that tell speeds in one message, and voltage, current and temperature in another."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from analyzer.flight.thresholds import lasting

if TYPE_CHECKING:
    from analyzer.flight.tables import ReportTable
    from dissectors.kit import Array
    from dissectors.picture import Plot

MOST_DEVICES = 1024
_TOLD = ("voltage", "current", "temperature")


def speeds_alone(plot: Plot) -> bool:
    """Return whether a table tells speeds and nothing of the supply, of ESCs that are known by their nodes."""
    return bool(plot.esc.rpm) and not plot.esc.voltage and not plot.esc.current and not plot.who.column


def supply_alone(plot: Plot) -> bool:
    """Return whether a table tells the supply of ESCs that are known by their nodes, and no speeds."""
    return bool(plot.esc.voltage or plot.esc.current) and not plot.esc.rpm and not plot.who.column


class _Half(NamedTuple):
    """Reports of the supply of one ESC: their last frames, when, and a row each of what is told."""

    frame_end: Array
    ran: Array
    told: Array


class SupplyHalves:
    """Keeps what each ESC told last of its supply; `MOST_DEVICES` at most."""

    def __init__(self) -> None:
        self._now: dict[int, _Half] = {}

    def feed(self, tables: list[ReportTable]) -> None:
        """Take the next batch."""
        self._now = {key: _Half(*(column[-1:] for column in half)) for key, half in self._now.items()}
        for table in tables:
            names = [getattr(table.plot.esc, name) for name in _TOLD]
            told = np.stack([table.numbers(name) for name in names], axis=1)
            for key, rows, at in table.devices:
                new = _Half(np.maximum.accumulate(at.frame_end), at.ran, told[rows])
                old = self._now.get(key)
                if old is None and len(self._now) >= MOST_DEVICES:
                    continue
                self._now[key] = new if old is None else _Half(*map(np.concatenate, zip(old, new, strict=True)))

    def beside(self, table: ReportTable) -> Array:
        """Return voltages, currents and temperatures, a row each, that were told just before reports of speeds.

        Of what was whole before a report began the last one counts, if it is not too old, however batches are cut.
        """
        told = np.full((len(_TOLD), len(table.order)), np.nan)
        for key, rows, at in table.devices:
            half = self._now.get(key)
            if half is not None:
                place = np.searchsorted(half.frame_end, at.frame, "left") - 1
                fresh = (place >= 0) & (at.ran - half.ran[place] <= lasting("together"))
                told[:, rows] = np.where(fresh, half.told[place].T, np.nan)
        return told
