"""Markers where transfers broke: the node that sent them, over time."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from analyzer.plot.chunks import path
from analyzer.plot.inventory import Series
from analyzer.plot.moments import Moments, times
from analyzer.tables import STATUSES
from dissectors.kit.cells import numbers

if TYPE_CHECKING:
    import pyarrow as pa

    from analyzer.plot.canvas import Canvas
    from dissectors.kit import Array

BROKEN = "broken"
_WHOLE = tuple(STATUSES.index(name) for name in ("ok", "unchecked"))


def draw(canvas: Canvas, transfers: pa.RecordBatch, lead: Array) -> None:
    """Draw points at the starts of broken transfers, a series a status; `lead` are numbers of their first frames."""
    status = numbers(transfers.column("status"))
    rows = np.flatnonzero(~np.isin(status, _WHOLE))
    if not len(rows):
        return
    t, node = times(transfers.column("t")), numbers(transfers.column("src"))
    for code in np.unique(status[rows]).tolist():
        here = rows[status[rows] == code]
        name = STATUSES[code]
        entity = path(BROKEN, name)
        series = canvas.inventory.series.get(entity) or Series(
            entity, "points", BROKEN, name, "node", owner="bus", number=code
        )
        canvas.lines([(series, node[here].astype(np.float64), None)], Moments(t[here], lead[here]))
