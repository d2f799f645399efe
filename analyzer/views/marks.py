"""Entries between the transfers of a list: error frames, frames that the recorder lost, gaps of the recording."""

from __future__ import annotations

from collections import deque
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from analyzer.facts.error_frames import overflowed
from analyzer.tables import EVENTS, raw_times
from dissectors.kit.cells import numbers, valid

if TYPE_CHECKING:
    from collections.abc import Iterator

    import pyarrow as pa

    from analyzer.decode.engine import Batch

_ERROR_FRAME, _DROP, _GAP = (EVENTS.index(name) for name in ("error frame", "drop", "gap"))
_SHOWN = (_ERROR_FRAME, _DROP, _GAP)


class ListMark(NamedTuple):
    """An event; `before` is the number of the frame that it stands before, from 1, and `bus` an index or None."""

    before: int
    t: int | None
    bus: int | None
    kind: str
    text: str


class Marks:
    """The events of one batch after another, in the order of the capture."""

    def __init__(self) -> None:
        self._waiting: deque[ListMark] = deque()

    def feed(self, batch: Batch) -> None:
        """Take the next batch."""
        events = batch.events
        kinds = numbers(events.column("kind")) if len(events) else np.zeros(0, np.uint8)
        rows = np.flatnonzero(np.isin(kinds, _SHOWN))
        if not rows.size:
            return
        before = np.searchsorted(numbers(batch.frames.column("line")), numbers(events.column("line"))[rows])
        times, has_bus, bus = raw_times(events.column("t")), valid(events.column("bus")), numbers(events.column("bus"))
        for row, frame in zip(rows.tolist(), before.tolist(), strict=True):
            where = int(bus[row]) if has_bus[row] else None
            kind = EVENTS[kinds[row]]
            self._waiting.append(ListMark(batch.first_frame + frame + 1, times[row], where, kind, _text(events, row)))

    def due(self, frame: int | None) -> Iterator[ListMark]:
        """Return those that stand before a frame; all of them for None."""
        while self._waiting and (frame is None or self._waiting[0].before <= frame):
            yield self._waiting.popleft()


def _text(events: pa.RecordBatch, row: int) -> str:
    kind, number = numbers(events.column("kind"))[row], int(numbers(events.column("class"))[row])
    if kind == _DROP:
        return f"{number} frame{'s' * (number != 1)} lost by the recorder" if number else "frames lost by the recorder"
    if kind == _GAP:
        return str(events.column("text")[row].as_py() or "")
    from analyzer.facts.error_frames import kind_of  # noqa: PLC0415 - few captures hold error frames

    data = events.column("data")[row].as_py() or b""
    words = "receive overflow, frames lost" if overflowed(number, data) else kind_of(number, data)
    counters = [(name, events.column(f"{name}_errors")[row].as_py()) for name in ("tx", "rx")]
    return words + "".join(f", {name} errors {count}" for name, count in counters if count is not None)
