"""RawCommand: values that no command should have (4.4.1)."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from dissectors.kit import rule, usable
from dissectors.records import replace
from dissectors.tmotor.rules.joined.joins import FULL_THROTTLE

if TYPE_CHECKING:
    from collections.abc import Iterator

    from dissectors.kit import Array, DecodedTable, Occurrences, Values, View


@rule("TYP-101", "TYP-102")
def ranges(view: View) -> Iterator[Occurrences]:
    """Find channels below 0, and below -8191 (4.4.1 expl. 2)."""
    table = view.table("RawCommand")
    if table is None:
        return
    starts, values = table.lists("cmd")
    low = (values < 0).nonzero()[0]
    if not low.size:
        return
    rows = starts.searchsorted(low, "right") - 1
    good = usable(table)[rows]
    low, rows = low[good], rows[good]
    for code, limit in (("TYP-101", 0), ("TYP-102", -FULL_THROTTLE)):
        mine = values[low] < limit
        if mine.any():
            yield _channels(view, code, table, rows[mine], low[mine])


def _channels(view: View, rule: str, table: DecodedTable, rows: Array, at: Array) -> Occurrences:
    """Return elements `at` of the lists of `rows`; a row may be there more than once."""
    starts, values = table.lists("cmd")
    channels = at - starts[rows] + 1

    def values_of(k: int) -> Values:
        return {"channel": int(channels[k]), "value": int(values[at[k]])}

    worst = {"value": ("lowest", values[at].astype(np.float64))}
    return replace(view.among_rows(rule, table, rows, lambda _row: {}, key=channels, worst=worst), values=values_of)


@rule("TYP-104")
def empty(view: View) -> Iterator[Occurrences]:
    """Find commands without a byte (4.4.1)."""
    table = view.table("RawCommand")
    if table is None:
        return
    starts, _ = table.lists("cmd")
    rows = (np.diff(starts) == 0).nonzero()[0]
    if rows.size:
        rows = rows[usable(table)[rows] & (view.transfers.length[table.row[rows]] == 0)]
        yield view.among_rows("TYP-104", table, rows, lambda _row: {})
