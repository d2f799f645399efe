"""Steps of transfer IDs that are not 1, as the core measures them."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from analyzer.tables import KINDS
from dissectors.kit import all_resumed

if TYPE_CHECKING:
    from dissectors.kit import Array, TransferTable, View

MESSAGE, REQUEST = KINDS.index("message"), KINDS.index("request")
GAP, COPIED, REPEATED, RESTARTED = RULES = ("TRF-016", "TRF-017", "TRF-018", "TRF-019")
IS_GAP, IS_COPY = range(2)  # places among these
LATE, EARLY, ASTRAY = 1, 2, 4  # bits of a step's marks
WITHOUT_START = "frames came without a start"


def odd_rows(t: TransferTable) -> Array:
    """Return rows of messages and requests whose step is there and is not 1."""
    rows: Array = (t.step != 1).nonzero()[0]
    if not len(rows):
        return rows
    kind = t.kind[rows]
    ours: Array = t.has("step")[rows] & ((kind == MESSAGE) | (kind == REQUEST))
    return np.extract(ours, rows)


def odd_cells(view: View, rows: Array) -> Array:
    """Return what the core judges odd rows by, a column behind the other (i64).

    Anomalies, kinds, buses, sources, destinations, IDs, steps, type IDs, times, times since the transfer before (0 for
    none), since when frames have come without a gap, types, first frames, rows.
    """
    t = view.transfers
    at = t.t[rows]
    gap = np.where(t.has("gap")[rows], t.gap[rows], 0)
    columns = (
        t.anomaly[rows], t.kind[rows], t.bus[rows], t.src[rows], t.dst[rows], t.transfer_id[rows], t.step[rows],
        t.type_id[rows], at, gap, all_resumed(view, at), t.code[rows], t.lead[rows], rows,
    )  # fmt: skip
    cells = np.empty((len(columns), len(rows)), np.int64)
    for k, column in enumerate(columns):
        cells[k] = column
    return cells
