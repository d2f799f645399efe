"""Message and packet tables, cut into the rows of one device each; `devices` draws those."""

from __future__ import annotations

from typing import TYPE_CHECKING

from analyzer.devices.rows import pieces, usable
from analyzer.devices.units import Units
from analyzer.plot.devices import DevicePlots, DeviceRows
from analyzer.plot.moments import Moments, times
from dissectors import picture
from dissectors.kit.cells import numbers

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    import pyarrow as pa

    from analyzer.plot.canvas import Canvas
    from dissectors import Registry
    from dissectors.kit import Array


class MessagePlots:
    """Draws the tables of one capture, batch by batch.

    Args:
        canvas: takes the points.
        registry: the types that the capture is decoded with. Raises `ProfileError` for a wrong `plots.toml`.
    """

    def __init__(self, canvas: Canvas, registry: Registry) -> None:
        self.pictures = picture.load(registry)
        self._canvas = canvas
        self._registry = registry
        self._devices = DevicePlots(canvas, self.pictures)
        self._units = Units()

    def feed(
        self, tables: Mapping[str, pa.RecordBatch], lead: Callable[[Array], Array], buses: tuple[str, ...]
    ) -> None:  # fmt: skip
        """Draw the tables of a batch; `lead` gives the numbers of the first frames of transfers, from 1."""
        for name, table in tables.items():
            plot = self.pictures.plots.get(name) or picture.Plot(name)
            for piece, bus, node, number in pieces(usable(table), plot.who):
                unit = self._units.unit(name, plot.who, bus, node, number, buses[bus])
                if unit is None:
                    self._canvas.inventory.beyond += 1
                    continue
                moments = Moments(times(piece.column("t")), lead(numbers(piece.column("transfer"))))
                rows = DeviceRows(piece, moments, self._registry.definition(name), unit, (bus, node, buses[bus]))
                self._devices.draw(plot, rows, self._units)
