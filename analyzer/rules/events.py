"""Events of a batch for the rules: error frames with their kinds, and occurrences that have no frame and no node."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from analyzer.facts.error_frames import kind_of, overflowed
from analyzer.tables import EVENTS
from dissectors.kit import Occurrences

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from dissectors.kit import Array, Values, View

NO_BUS = -1
_ERROR_FRAME = EVENTS.index("error frame")


def error_frames(view: View) -> Iterator[tuple[int, str]]:
    """Yield row and kind of each error frame, but for those that only say that frames were lost."""
    events = view.events
    # They are rare, or the bus is broken: one by one.
    for row in np.flatnonzero(events.kind == _ERROR_FRAME).tolist() if len(events) else ():
        error_class, data = int(events.number[row]), events.data(row)
        if not overflowed(error_class, data):
            yield row, kind_of(error_class, data)


def among_events(rule: str, view: View, rows: Array, t: Array, values: Callable[[int], Values]) -> Occurrences:
    """Return breaches in rows of the events; `values` is asked with the place in `rows`."""
    none = np.full(len(rows), -1)
    bus = np.where(view.events.has("bus")[rows], view.events.bus[rows].astype(np.int64), NO_BUS)
    return Occurrences(
        rule=rule, t=t, bus=bus, node=none, type=none, frame=none, values=values, frames=lambda _: (),
    )  # fmt: skip
