"""`odd`: which ESC differs from its own past, or always from the others; and the mark of it among the nodes."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from analyzer.flight.flights import FlightFinder
from analyzer.flight.odd.finder import OddFinder
from analyzer.flight.odd.quantities import QUANTITIES
from analyzer.flight.reading import FlightReading
from analyzer.stats.nodes import NodeTable
from analyzer.stats.statistic import Statistic
from analyzer.stats.table import StatColumn, StatTable
from dissectors.kit.cells import numbers

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence

    from analyzer.decode.engine import Batch
    from analyzer.flight.odd.judge import OddReport
    from analyzer.stats.chosen import ChosenBatch
    from analyzer.stats.order import StatOrder
    from analyzer.stats.statistic import StatEnd
    from dissectors import Registry

COLUMNS = (
    StatColumn("bus", "Bus", "text"),
    StatColumn("node", "Node", "text"),
    StatColumn("ch", "Ch", "text"),
    StatColumn("quantity", "Quantity", "text"),
    StatColumn("against", "Against", "text"),
    StatColumn("difference", "Difference", "number", 1),
    StatColumn("unit", "Unit", "text"),
    StatColumn("z", "z", "number", 1),
    StatColumn("since_ns", "Since", "time"),
    StatColumn("text", "What", "text"),
)
_TITLES = {"speed": "Speed %", "current": "Current %", "temperature": "Temp C", "voltage": "Volts %"}
COMPARED = (
    StatColumn("bus", "Bus", "text"),
    StatColumn("node", "Node", "text"),
    StatColumn("ch", "Ch", "text"),
    StatColumn("reports", "Reports"),
    *(
        StatColumn(
            f"{one.key}_{'c' if one.unit == 'C' else 'percent'}", _TITLES.get(one.key, f"{one.key.title()} %"),
            "number", 1,
        )
        for one in QUANTITIES
    ),
    StatColumn("odd", "Odd", "text"),
)  # fmt: skip
_ABOUT = "each ESC against its own past first, then against the others"
_COMPARED = "how far each ESC is from the median of those that report alike"


class _OddLook:
    """Looks at all batches for odd ESCs; one reading of a capture for flights and them."""

    def __init__(self, registry: Registry) -> None:
        self._reading = reading = FlightReading(registry)
        self._flights = FlightFinder(registry, reading.order)
        self._odd = OddFinder(reading.clock, reading.escs)

    def feed(self, batch: Batch) -> None:
        self._reading.feed(batch)
        self._odd.feed()
        self._flights.feed(batch)

    def found(self, end: StatEnd) -> OddReport | None:
        """Return what is odd, None if times cannot be compared."""
        return self._odd.found(self._flights.flights()) if end.timed else None


class OddTable(Statistic):
    """The odd ESCs, a row a quantity; and how far all are apart. With a filter those that sent what it chooses."""

    def __init__(self, order: StatOrder) -> None:
        self._look = _OddLook(order.registry)
        self._filtered = order.filtered
        self._chosen = np.zeros(1 << 16, bool)  # by bus and node

    def feed(self, batch: ChosenBatch) -> None:
        """Add the next batch."""
        self._look.feed(batch.batch)
        if batch.rows is not None and len(batch.rows):
            transfers = batch.batch.transfers
            bus, src = (numbers(transfers.column(name))[batch.rows].astype(np.int64) for name in ("bus", "src"))
            self._chosen[bus << 8 | src] = True

    def finish(self, end: StatEnd) -> Sequence[StatTable]:
        """Return both tables."""
        found = self._look.found(end)
        notes = ["looked for in everything; these are of nodes that sent what matches"] * self._filtered
        if found is None:
            return (StatTable("odd", _ABOUT, COLUMNS, [], [*notes, "without times nothing can be compared"]),)
        rows = [
            (
                end.buses[one.bus], str(one.node), None if one.ch is None else str(one.ch), one.quantity, one.against,
                one.difference, one.unit, one.z, one.since, one.text,
            )
            for one in found.odd
            if self._wanted(one.bus, one.node)
        ]  # fmt: skip
        marks = odd_marks(found)
        compared = [
            (
                end.buses[one.bus], str(one.node), None if one.ch is None else str(one.ch), one.reports,
                *one.levels.values(), "odd" if (one.bus, one.node) in marks else "",
            )
            for one in found.compared
            if self._wanted(one.bus, one.node)
        ]  # fmt: skip
        notes = [*notes, *found.facts, *_how(found)]
        return (
            StatTable("odd", _ABOUT, COLUMNS, rows, notes),
            StatTable("odd_compared", _COMPARED, COMPARED, compared, main=False),
        )

    def _wanted(self, bus: int, node: int) -> bool:
        return not self._filtered or bool(self._chosen[bus << 8 | node])


class MarkedNodeTable(NodeTable):
    """The nodes, the odd ESCs among them marked."""

    def __init__(self, order: StatOrder) -> None:
        super().__init__(order)
        self._look = _OddLook(order.registry)

    def feed(self, batch: ChosenBatch) -> None:
        """Add the next batch."""
        super().feed(batch)
        self._look.feed(batch.batch)

    def marks(self, end: StatEnd) -> Mapping[tuple[int, int], Sequence[str]]:
        """Return what is odd about ESCs, by bus and node."""
        found = self._look.found(end)
        return {} if found is None else odd_marks(found)


def odd_marks(found: OddReport) -> Mapping[tuple[int, int], Sequence[str]]:
    """Return what is odd about each, by bus and node."""
    marks: dict[tuple[int, int], list[str]] = {}
    for one in found.odd:
        marks.setdefault((one.bus, one.node), []).append(one.text)
    return marks


def _how(found: OddReport) -> Iterator[str]:
    """Yield how much was compared."""
    escs = len(found.compared)
    if not escs:
        yield "no ESC reports that can be compared"
    elif not found.comparisons:
        yield f"{escs} ESCs, too few reports of turning motors to compare"
    else:
        yield f"{escs} ESCs, {found.comparisons} comparisons; chance alone makes one ESC odd in a thousand captures"
