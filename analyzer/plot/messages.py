"""Message and packet tables, cut into the rows of one device each; `devices` draws those."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np
import pyarrow as pa

from analyzer.devices.rows import pieces, usable
from analyzer.devices.units import Units
from analyzer.plot.devices import DevicePlots, DeviceRows
from analyzer.plot.moments import Moments, times
from dissectors import picture
from dissectors.kit.cells import numbers

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence

    from analyzer.plot.canvas import Canvas
    from dissectors import Registry
    from dissectors.kit import Array

_TOGETHER = 1 << 16  # rows of a table that are drawn at once, where lines wait for the end anyway


class _Part(NamedTuple):
    """Rows of a table, and for each the transfer and the number of its first frame, from 1."""

    table: pa.RecordBatch
    transfers: Array
    leads: Array


class MessagePlots:
    """Draws the tables of one capture, batch by batch.

    Args:
        canvas: takes the points.
        registry: the types that the capture is decoded with. Raises `ProfileError` for a wrong `plots.toml`.
        waiting: few rows of a table may wait for more of them.
    """

    def __init__(self, canvas: Canvas, registry: Registry, *, waiting: bool = False) -> None:
        self.pictures = picture.load(registry)
        self._canvas = canvas
        self._registry = registry
        self._devices = DevicePlots(canvas, self.pictures)
        self._units = Units()
        self._together = _TOGETHER if waiting else 0
        self._parts: dict[str, list[_Part]] = {}
        self._buses: tuple[str, ...] = ()

    def feed(
        self, tables: Mapping[str, pa.RecordBatch], lead: Callable[[Array], Array], buses: tuple[str, ...]
    ) -> None:  # fmt: skip
        """Draw the tables of a batch; `lead` gives the numbers of the first frames of transfers, from 1."""
        self._buses = buses
        for name, table in tables.items():
            transfers = numbers(table.column("transfer"))
            if not len(transfers):
                continue
            parts = self._parts.setdefault(name, [])
            parts.append(_Part(table, transfers, lead(transfers)))
            if sum(len(part.transfers) for part in parts) >= self._together:
                self._draw(name)

    def finish(self) -> None:
        """Draw what has waited."""
        for name in self._parts:
            self._draw(name)

    def _draw(self, name: str) -> None:
        if not self._parts[name]:
            return
        plot = self.pictures.plots.get(name) or picture.Plot(name)
        whole = _joined(self._parts[name])
        self._parts[name] = []
        for piece, bus, node, number in pieces(usable(whole.table), plot.who):
            unit = self._units.unit(name, plot.who, bus, node, number, self._buses[bus])
            if unit is None:
                self._canvas.inventory.beyond += 1
                continue
            leads = whole.leads[np.searchsorted(whole.transfers, numbers(piece.column("transfer")))]
            moments = Moments(times(piece.column("t")), leads)
            rows = DeviceRows(piece, moments, self._registry.definition(name), unit, (bus, node, self._buses[bus]))
            self._devices.draw(plot, rows, self._units)


def _joined(parts: Sequence[_Part]) -> _Part:
    if len(parts) == 1:
        return parts[0]
    (table,) = pa.Table.from_batches([part.table for part in parts]).combine_chunks().to_batches()
    return _Part(
        table, np.concatenate([part.transfers for part in parts]), np.concatenate([part.leads for part in parts])
    )
