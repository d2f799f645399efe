"""Flights and their events as tables of a run."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import pyarrow as pa

from analyzer.sinks.export import HAPPENED
from analyzer.tables import raw_rows

if TYPE_CHECKING:
    from collections.abc import Collection, Iterable, Iterator, Mapping

    from analyzer.app.run import Run
    from analyzer.decode.engine import Batch
    from analyzer.flight.finder import EventFinder
    from analyzer.flight.flights import FlightFinder
    from analyzer.sinks.extent import Extent
    from analyzer.sources.dataflash import AutopilotLog


class HappenedTables:
    """Finds them while somebody else uses the batches of a run; `names` are those of the tables that are wanted.

    Args:
        run: not read yet.
        wanted: names of tables, these among others.
        autopilot: the autopilot's own log, of which the events have the words.
    """

    def __init__(self, run: Run, wanted: Collection[str], autopilot: AutopilotLog | None = None) -> None:
        self.names = tuple(name for name in HAPPENED if name in wanted)
        self._finders: dict[str, FlightFinder | EventFinder] = {}
        if self.names:
            from analyzer.flight.finder import EventFinder  # noqa: PLC0415 - few exports want them
            from analyzer.flight.flights import FlightFinder  # noqa: PLC0415

            flights, _ = HAPPENED
            for name in self.names:
                made = FlightFinder(run.registry) if name == flights else EventFinder(run.registry, autopilot)
                self._finders[name] = made

    def beside(self, batches: Iterable[Batch]) -> Iterator[Batch]:
        """Yield the batches, and look at each."""
        for batch in batches:
            self.feed(batch)
            yield batch

    def feed(self, batch: Batch) -> None:
        """Look at the next batch."""
        for finder in self._finders.values():
            finder.feed(batch)

    def table(self, name: str) -> pa.Table:
        """Return all of a table, after the last batch."""
        return self._finders[name].finish()

    @property
    def autopilot(self) -> Mapping[str, Any] | None:
        """The fate of the autopilot's log, after the tables."""
        return next((found for one in self._finders.values() if (found := getattr(one, "autopilot", None))), None)

    def rows(self, name: str, extent: Extent | None = None) -> pa.RecordBatch:
        """Return a table, after the last batch: all of it, or what is in the `extent` of a window.

        What is at no frame is where its time is.
        """
        found = self._finders[name].finish()
        if extent is not None:
            inside = [
                extent.has_times(one["t_end"])
                if one["frame"] is None
                else extent.has_frames(one["frame"] + 1, one.get("frame_end", one["frame"]) + 1)
                for one in raw_rows(found)
            ]
            found = found.filter(pa.array(inside, pa.bool_()))
        return next(iter(found.combine_chunks().to_batches()), pa.RecordBatch.from_pylist([], schema=found.schema))
