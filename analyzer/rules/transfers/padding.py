"""Transfers whose bytes are wrong: broken ones, start values of unknown types, padding that is none."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from analyzer.tables import TRANSFER_ANOMALIES
from dissectors.kit import rule

if TYPE_CHECKING:
    from collections.abc import Iterable

    from dissectors.kit import Array, DecodedTable, Occurrences, Values, View

_CAN_FD = 1 << TRANSFER_ANOMALIES.index("can fd")

# Bytes before the tail that a CAN FD frame has room for when so many are needed.
_FD_ROOM = np.array([next(n - 1 for n in (*range(1, 9), 12, 16, 20, 24, 32, 48, 64) if n > need) for need in range(64)])


@rule("TRF-030")
def padding(view: View) -> Iterable[Occurrences]:
    """Yield CAN FD transfers whose bytes behind the type are not zero, or more than the frame length needs."""
    fd = view.transfers.anomaly & _CAN_FD
    if fd.any():
        tables = (view.table(name) for name in view.tables())
        yield from (_padded(view, table, fd) for table in tables if table is not None and "bits_left" in table)


def _padded(view: View, table: DecodedTable, fd: Array) -> Occurrences:
    t = view.transfers
    here = ((fd[table.row] != 0) & table.trusted & ~table["bad_tag"] & (table["bits_left"] >= 0)).nonzero()[0]
    rows = table.row[here]
    spare = table["bits_left"][here].astype(np.int64) // 8
    size = t.length[rows] - spare + 2 * t.has("crc_wire")[rows]
    needed = _FD_ROOM[size - np.maximum(size - 1, 0) // 63 * 63] - (size - np.maximum(size - 1, 0) // 63 * 63)
    dirty = table["pad_nonzero"][here] & (spare > 0)
    for k in dirty.nonzero()[0].tolist():
        dirty[k] = any(t.payload(int(rows[k]))[-int(spare[k]) :])
    bad = (dirty | (spare > needed)).nonzero()[0]
    about = {int(rows[k]): (int(spare[k]), int(needed[k])) for k in bad}

    def values(row: int) -> Values:
        length, due = about[row]
        filling = t.payload(row)[-length:].lstrip(b"\0")
        return {"padding": length, "needed": due, "value": filling[0] if filling else 0}

    return view.among_transfers("TRF-030", rows[bad], values)
