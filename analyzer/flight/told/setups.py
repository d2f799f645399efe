"""How devices are set up: which hardware they are, their software, which way they are set to turn; and since when."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np
import pyarrow as pa

from analyzer.decode.columns import senders
from analyzer.devices.settings import commands, written
from analyzer.facts.meaning import meaning
from analyzer.facts.software import version, version_column
from analyzer.flight.reports import ReportEvents
from dissectors.kit.cells import numbers, pylist
from dissectors.kit.order import by_key
from dissectors.times import NO_TIME

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

    from analyzer.decode.engine import Batch
    from analyzer.flight.reports import EventOrder
    from dissectors.kit import Array
    from dissectors.picture import Plot

SOFTWARE, HARDWARE = "software", "hardware"
MOST_NODES, MOST_CHANGES = 256, 64  # changes of one thing of a node, of which the first ones are kept
Node = tuple[int, int]  # bus, node


class NodeStatement(NamedTuple):
    """A statement of a node, from a recorded time on."""

    ran: int
    text: str


class Setups(ReportEvents):
    """Adds up batches; bounds: `MOST_NODES`, `MOST_CHANGES`."""

    def __init__(self, order: EventOrder) -> None:
        super().__init__(order)
        self._plots = [plot for plot in self._plots if not commands(order.registry, plot.table)]
        self._all: dict[Node, dict[str, list[NodeStatement]]] = {}
        self._versions: dict[str, str | None] = {}  # the column of each table that was seen, None for none

    @staticmethod
    def of_use(plot: Plot) -> bool:
        """Return whether devices tell there which they are, or which way they turn."""
        return plot.parameters and bool(plot.turning or plot.identity)

    def feed(self, batch: Batch) -> None:
        """Add the next batch."""
        for name in batch.messages:
            if name not in self._versions:
                self._versions[name] = version_column(batch.messages[name])
            column = self._versions[name]
            if column is not None and (table := self._reader.rows(name, batch)) is not None:
                # Who tells it in two types tells it in two ways: neither is a change of the other.
                what = f"{SOFTWARE} ({name.removesuffix('.Response').rpartition('.')[2]})"
                rows = self._timed(table)
                told = pylist(table.column(column).take(pa.array(rows)))
                self._note(table, what, rows, [version(value) for value in told])
        for plot in self._plots:
            if (table := self._reader.rows(plot.table, batch)) is not None:
                for name, what in ((plot.identity, HARDWARE), *((one, one) for one in plot.turning)):
                    if name in table.schema.names:
                        rows = self._changed(table, name)
                        self._note(table, what, rows, list(self._texts(plot, table, name, rows)))

    def finish(self) -> None:
        """Take the end: everything is known."""

    def of(self, node: Node, until: int) -> Mapping[str, str]:
        """Return what a node told last of each thing, up to a recorded time."""
        told = {name: [one for one in some if one.ran <= until] for name, some in self._all.get(node, {}).items()}
        return {name: some[-1].text for name, some in told.items() if some}

    def _timed(self, table: pa.RecordBatch) -> Array:
        return np.flatnonzero(self._clock.of(table).t != NO_TIME)

    def _changed(self, table: pa.RecordBatch, name: str) -> Array:
        """Return the rows with a time, without those in which a node tells the same number as in the one before."""
        rows, column = self._timed(table), table.column(name)
        if column.null_count or not (pa.types.is_integer(column.type) or pa.types.is_boolean(column.type)):
            return rows
        order, begins = by_key(senders(table)[rows])
        values = numbers(column)[rows[order]]
        other = np.ones(len(rows), bool)
        np.not_equal(values[1:], values[:-1], out=other[1:])
        other[begins] = True
        found: Array = rows[np.sort(order[other])]
        return found

    def _texts(self, plot: Plot, table: pa.RecordBatch, name: str, rows: Array) -> Iterator[str]:
        about = meaning(self._registry.definition(plot.table), name)
        for value in pylist(table.column(name).take(pa.array(rows))):
            hexadecimal = about.note is not None and about.note.hex and isinstance(value, int)
            yield about.texts.get(value) or (f"0x{value & 0xFFFF_FFFF:X}" if hexadecimal else written(value))

    def _note(self, table: pa.RecordBatch, what: str, rows: Array, texts: list[str]) -> None:
        columns = senders(table)[rows].tolist(), self._clock.of(table).take(rows).ran.tolist(), texts
        for code, ran, text in zip(*columns, strict=True):
            node = code >> 8, code & 0xFF
            if not text or (node not in self._all and len(self._all) >= MOST_NODES):
                continue
            told = self._all.setdefault(node, {}).setdefault(what, [])
            if len(told) < MOST_CHANGES and (not told or told[-1].text != text):
                told.append(NodeStatement(ran, text))
