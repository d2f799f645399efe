"""`flights`: when motors turned, and how that ended."""

from __future__ import annotations

from typing import TYPE_CHECKING

from analyzer.flight.flights import FlightFinder
from analyzer.stats.statistic import Statistic
from analyzer.stats.table import StatColumn, StatTable
from analyzer.tables import raw_rows
from dissectors.times import SECOND

if TYPE_CHECKING:
    from collections.abc import Sequence

    from analyzer.stats.chosen import ChosenBatch
    from analyzer.stats.order import StatOrder
    from analyzer.stats.statistic import StatEnd

COLUMNS = (
    StatColumn("flight", "Flight"),
    StatColumn("t_ns", "From", "time"),
    StatColumn("t_end_ns", "To", "time"),
    StatColumn("duration_s", "Seconds", "number", 1),
    StatColumn("end", "End", "text"),
    StatColumn("chs", "Channels", "text"),
    StatColumn("by", "Told by", "text"),
    StatColumn("frame", "First frame", rank=1),
    StatColumn("frame_end", "Last frame", rank=2),
)


class FlightTable(Statistic):
    """The flights of a capture, of everything in it whatever was chosen."""

    def __init__(self, order: StatOrder) -> None:
        self._finder = FlightFinder(order.registry)
        self._filtered = order.filtered

    def feed(self, batch: ChosenBatch) -> None:
        """Add the next batch."""
        self._finder.feed(batch.batch)

    def finish(self, end: StatEnd) -> Sequence[StatTable]:
        """Return the flights in the order of the capture; frames count from 1."""
        found = self._finder.finish()
        found = found if end.timed else found.slice(0, 0)
        rows = [
            (
                one["flight"], one["t"], one["t_end"], one["ran"] / SECOND, one["end"],
                ",".join(map(str, one["chs"])), one["by"], one["frame"] + 1, one["frame_end"] + 1,
            )
            for one in raw_rows(found)
        ]  # fmt: skip
        notes = ["flights are of everything: a filter chooses none"] * self._filtered
        if not end.timed:
            notes.append("without times no flight can be told")
        return (StatTable("flights", "when motors turned: landed, cut by the end, or lost", COLUMNS, rows, notes),)
