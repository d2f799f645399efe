"""`events`: what happened to the vehicle, in the order of the capture."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from analyzer.flight.finder import EventFinder
from analyzer.stats.statistic import Statistic
from analyzer.stats.table import StatColumn, StatTable
from analyzer.tables import raw_rows
from dissectors.kit.cells import numbers

if TYPE_CHECKING:
    from collections.abc import Sequence

    from analyzer.stats.chosen import ChosenBatch
    from analyzer.stats.order import StatOrder
    from analyzer.stats.statistic import StatEnd
    from dissectors.kit import Array

COLUMNS = (
    StatColumn("event", "Event", rank=-1),
    StatColumn("t_ns", "Before", "time", rank=-1),
    StatColumn("t_end_ns", "Time", "time"),
    StatColumn("until_ns", "Until", "time", rank=1),
    StatColumn("frame", "Frame", rank=2),
    StatColumn("bus", "Bus", "text"),
    StatColumn("node", "Node", "text"),
    StatColumn("ch", "Ch", "text"),
    StatColumn("kind", "Kind", "text"),
    StatColumn("text", "What", "text"),
    StatColumn("source", "Source", "text", rank=-1),
    StatColumn("type", "Type", "text", rank=-1),
    StatColumn("clause", "Clause", "text", rank=-1),
    StatColumn("values", "Values", "text", rank=-1),
)


class FlightEventTable(Statistic):
    """The events of flights. With a filter those whose report it chooses: they are looked for in everything."""

    def __init__(self, order: StatOrder) -> None:
        self._finder = EventFinder(order.registry, order.autopilot)
        self._filtered = order.filtered
        self._chosen: list[tuple[int, int, Array]] = []  # first frame, how many, a bit each

    def feed(self, batch: ChosenBatch) -> None:
        """Add the next batch."""
        self._finder.feed(batch.batch)
        if batch.rows is not None and len(batch.rows):
            column = batch.batch.transfers.column("frame")
            first = numbers(column.values)[np.asarray(column.offsets)[:-1][batch.rows]].astype(np.int64)
            low = int(first.min())
            marks = np.zeros(int(first.max()) - low + 1, bool)
            marks[first - low] = True
            self._chosen.append((low, len(marks), np.packbits(marks)))

    def finish(self, end: StatEnd) -> Sequence[StatTable]:
        """Return the events; frames count from 1."""
        found = self._finder.finish()
        self.autopilot = self._finder.autopilot
        found = found if end.timed else found.slice(0, 0)
        rows = [
            (
                one["event"], one["t"], one["t_end"], one["until"], None if one["frame"] is None else one["frame"] + 1,
                None if one["bus"] is None else end.buses[one["bus"]],
                *(None if one[name] is None else str(one[name]) for name in ("node", "ch")), one["kind"], one["text"],
                one["source"], one["type"], one["clause"], one["values"],
            )
            for one in raw_rows(found)
            if not self._filtered or self._has(one["frame"])
        ]  # fmt: skip
        notes = [*self._finder.notes]
        notes += [f"{self._finder.more} more that are like these"] if self._finder.more else []
        if self._filtered:
            notes.append("looked for in everything; these are told by a transfer that matches")
        if not end.timed:
            notes.append("without times nothing can be told")
        return (StatTable("events", "what happened to the vehicle", COLUMNS, rows, notes),)

    def _has(self, frame: int | None) -> bool:
        """Return whether a chosen transfer begins with a frame."""
        return frame is not None and any(
            low <= frame < low + count and bool(bits[(frame - low) >> 3] >> (7 - ((frame - low) & 7)) & 1)
            for low, count, bits in self._chosen
        )
