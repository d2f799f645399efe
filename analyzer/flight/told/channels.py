"""Channels that nodes have told of themselves, as people count them."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pyarrow as pa

from analyzer.devices.escs import CHANNEL
from analyzer.devices.settings import commands
from analyzer.tables import distinct
from dissectors.kit.cells import numbers, valid

if TYPE_CHECKING:
    from analyzer.decode.engine import Batch
    from analyzer.flight.tables import ReportReader
    from dissectors import Registry

_MOST = 0xFF  # an index of the protocol has five bits


class ToldChannels:
    """Adds up batches; bounded by the nodes that there can be. Of a node with several channels none is known.

    Args:
        registry: the types. Whoever commands a channel has none of its own by that.
        reader: of the tables of each batch.
    """

    def __init__(self, registry: Registry, reader: ReportReader) -> None:
        self._registry, self._reader = registry, reader
        self._told: dict[tuple[int, int], set[int]] = {}

    def feed(self, batch: Batch) -> None:
        """Add the next batch."""
        for name, table in batch.messages.items():
            told = CHANNEL in table.schema.names and "src" in table.schema.names
            if told and not commands(self._registry, name) and (some := self._reader.rows(name, batch)) is not None:
                self._note(some)

    def _note(self, table: pa.RecordBatch) -> None:
        column = table.column(CHANNEL)
        if not pa.types.is_floating(column.type) and not pa.types.is_integer(column.type):
            return
        told = numbers(column)
        if column.null_count or told.min(initial=0) < 0 or not told.max(initial=0) <= _MOST:
            rows = valid(column) & (told >= 0) & (told <= _MOST)
            table, told = table.filter(pa.array(rows)), told[rows]
        bus, node = (numbers(table.column(name)).astype(np.uint32) for name in ("bus", "src"))
        for code in distinct(bus << 16 | node << 8 | told.astype(np.uint32)):
            of = self._told.setdefault((code >> 16, code >> 8 & 0xFF), set())
            if len(of) < 2:
                of.add(code & 0xFF)

    def of(self, bus: int, node: int) -> int | None:
        """Return the channel of a node, None if it has none, or several."""
        told = self._told.get((bus, node), ())
        return next(iter(told)) if len(told) == 1 else None
