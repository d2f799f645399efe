"""Reports of ESCs while their command is held: a bounded number of reports of each, evenly over the capture."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from analyzer.facts.traffic import times
from dissectors.kit.cells import numbers, valid
from dissectors.records import dataclass

if TYPE_CHECKING:
    import pyarrow as pa

    from dissectors.kit import Array

MOST_ESCS = 64
MOST_ROWS = 8192  # of an ESC, and every second one is left out
QUANTITIES = ("rpm", "current", "voltage", "temperature", "reported")

EscKey = tuple[int, int, int]  # bus, node, channel or -1


@dataclass(slots=True)
class EscRows:
    """Reports of one ESC: a row each, with its time in ns (0 without), command in percent and `QUANTITIES`."""

    t: list[Array]
    values: list[Array]
    rows: int = 0
    stride: int = 1
    phase: int = 0
    command: float = np.nan
    reports: int = 0

    def arrays(self) -> tuple[Array, Array]:
        """Return times, and values by row and column: the command, then `QUANTITIES`."""
        return np.concatenate(self.t), np.concatenate(self.values)

    def thin(self) -> None:
        """Leave out every second row."""
        t, values = self.arrays()
        self.t, self.values = [t[::2]], [values[::2]]
        self.rows, self.stride = len(self.t[0]), self.stride * 2


class EscSamples:
    """Adds up the batches of the table `esc`: of the first `MOST_ESCS` ESCs, rows whose command had settled.

    Args:
        settled: percent by which the command may have moved since the report before.
    """

    def __init__(self, settled: float) -> None:
        self.all: dict[EscKey, EscRows] = {}
        self._settled = settled

    def feed(self, table: pa.RecordBatch) -> None:
        """Add the rows of the next batch."""
        if not len(table):
            return
        t, timed = times(table)
        ch = np.where(valid(column := table.column("ch")), numbers(column), -1).astype(np.int64)
        bus, node = (numbers(table.column(name)).astype(np.int64) for name in ("bus", "node"))
        columns = [_floats(table.column(name)) for name in ("commanded", *QUANTITIES)]
        commanded = np.where(np.isnan(columns[0]), columns[-1], columns[0])
        values = np.column_stack([commanded, *columns[1:]]).astype(np.float32)
        code = bus << 32 | node << 24 | (ch + 1)
        for one in np.unique(code).tolist():
            rows = np.flatnonzero(code == one)
            key = one >> 32, one >> 24 & 0xFF, (one & 0xFFFFFF) - 1
            self._add(key, np.where(timed[rows], t[rows], 0), values[rows])

    def _add(self, key: EscKey, t: Array, values: Array) -> None:
        kept = self.all.get(key)
        if kept is None:
            if len(self.all) >= MOST_ESCS:
                return
            kept = self.all[key] = EscRows([], [])
        command = values[:, 0]
        before = np.concatenate(([kept.command], command[:-1]))
        kept.command, kept.reports = float(command[-1]), kept.reports + len(t)
        held = np.flatnonzero(np.abs(command - before) <= self._settled)
        held = held[(kept.phase + np.arange(len(held))) % kept.stride == 0] if kept.stride > 1 else held
        kept.phase += len(held)
        kept.t.append(t[held])
        kept.values.append(values[held])
        kept.rows += len(held)
        while kept.rows > MOST_ROWS:
            kept.thin()


def _floats(column: pa.Array) -> Array:
    array: Array = numbers(column).astype(np.float64)
    return np.where(valid(column), array, np.nan)
