"""Error frames on the bus, but for those that only say that frames were lost."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from analyzer.rules.events import among_events, error_frames, when
from dissectors.kit import rule
from dissectors.records import replace

if TYPE_CHECKING:
    from collections.abc import Iterator

    from dissectors.kit import Array, Occurrences, Values, View

_BUS_OFF = "bus-off"


@rule("CAN-004")
def seen(view: View) -> Iterator[Occurrences]:
    """Find the error frames of each kind."""
    kinds: dict[str, list[int]] = {}
    for row, _, kind in error_frames(view):
        kinds.setdefault(kind, []).append(row)
    for kind, some in kinds.items():
        rows = np.asarray(some)

        def values(k: int, rows: Array = rows, kind: str = kind) -> Values:
            return {"kind": kind, **_counters(view, int(rows[k]))}

        t = np.fromiter((when(view, row) for row in some), np.int64, len(some))
        found = among_events("CAN-004", view, rows, t, values)
        yield replace(found, severity="error") if _BUS_OFF in kind else found


def _counters(view: View, row: int) -> Values:
    events = view.events
    columns = {"tx_errors": events.tx_errors, "rx_errors": events.rx_errors}
    return {name: int(column[row]) if events.has(name)[row] else "?" for name, column in columns.items()}
