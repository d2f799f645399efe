"""Entries between the transfers of a list: frames that form none, error frames, and what the recorder lost."""

from __future__ import annotations

from collections import deque
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from analyzer.facts.error_frames import overflowed
from analyzer.tables import EVENTS, raw_times
from dissectors.kit.cells import numbers, valid

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator

    import pyarrow as pa

    from analyzer.decode.engine import Batch
    from analyzer.views.colours.painter import RowColours
    from analyzer.window.listed import ListedRows
    from analyzer.window.numbering import Numbering
    from dissectors.kit import Array

_ERROR_FRAME, _DROP, _GAP = (EVENTS.index(name) for name in ("error frame", "drop", "gap"))
_SHOWN = (_ERROR_FRAME, _DROP, _GAP)


class ListMark(NamedTuple):
    """An event, or a frame without a transfer.

    `before` is the place of the frame that it stands before, or its own, from 0; `bus` an index or None. `number` is
    what it is shown with, None for what has none. `colour` is
    that of a rule, None without one. `src`, `dst` and `transfer_id` are those of a frame that names them.
    """

    before: int
    t: int | None
    bus: int | None
    kind: str
    text: str
    number: int | None = None
    src: str = ""
    dst: str = ""
    transfer_id: int | None = None
    sign: str = "!"
    colour: str | None = None


class Marks:
    """The entries of one batch after another, in the order of the capture.

    Args:
        numbering: tells whether error frames have numbers.
    """

    def __init__(self, numbering: Numbering) -> None:
        self._numbering = numbering
        self._waiting: deque[ListMark] = deque()

    def feed(
        self, batch: Batch, picked: ListedRows, loose: Iterable[ListMark] = (), colours: RowColours | None = None
    ) -> None:
        """Take the picked events of the next batch, and its frames without a transfer."""
        told = self._events(batch, picked.events)
        events = (mark for _, mark in told)
        if colours is not None:
            loose = [mark._replace(colour=colours.frames.get(mark.before)) for mark in loose]
            events = (mark._replace(colour=colours.events.get(row)) for row, mark in told)
        self._waiting.extend(sorted([*events, *loose], key=lambda mark: mark.before))

    @property
    def waiting(self) -> bool:
        """True while some have not been given."""
        return bool(self._waiting)

    def due(self, place: int | None) -> Iterator[ListMark]:
        """Return those that stand before a frame; all of them for None."""
        while self._waiting and (place is None or self._waiting[0].before <= place):
            yield self._waiting.popleft()

    def _events(self, batch: Batch, picked: Array) -> Iterator[tuple[int, ListMark]]:
        events = batch.events
        if not len(picked):
            return
        kinds = numbers(events.column("kind"))
        numbered = iter(self._numbering.of_errors(batch.first_frame, batch.frames, events).tolist())
        number = [next(numbered, None) if kind == _ERROR_FRAME else None for kind in kinds.tolist()]
        rows = np.asarray(picked)[np.isin(kinds[picked], _SHOWN)]
        before = np.searchsorted(numbers(batch.frames.column("line")), numbers(events.column("line"))[rows])
        times, has_bus, bus = raw_times(events.column("t")), valid(events.column("bus")), numbers(events.column("bus"))
        for row, frame in zip(rows.tolist(), before.tolist(), strict=True):
            where = int(bus[row]) if has_bus[row] else None
            text, place = _text(events, row), batch.first_frame + frame
            yield row, ListMark(place, times[row], where, EVENTS[kinds[row]], text, number[row])


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
