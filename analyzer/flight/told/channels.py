"""Channels that nodes have told of themselves, as people count them."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pyarrow as pa

from analyzer.devices.escs import CHANNEL
from analyzer.devices.rows import usable
from analyzer.devices.settings import commands
from analyzer.tables import distinct
from dissectors.kit.cells import numbers, valid

if TYPE_CHECKING:
    from analyzer.decode.engine import Batch
    from dissectors import Registry

_MOST = 0xFF  # an index of the protocol has five bits


class ToldChannels:
    """Adds up batches; bounded by the nodes that there can be. Of a node with several channels none is known.

    Args:
        registry: the types. Whoever commands a channel has none of its own by that.
    """

    def __init__(self, registry: Registry) -> None:
        self._registry = registry
        self._told: dict[tuple[int, int], set[int]] = {}

    def feed(self, batch: Batch) -> None:
        """Add the next batch."""
        for name, table in batch.messages.items():
            told = CHANNEL in table.schema.names and "src" in table.schema.names
            if told and not commands(self._registry, name):
                self._note(usable(table))

    def _note(self, table: pa.RecordBatch) -> None:
        column = table.column(CHANNEL)
        if not pa.types.is_floating(column.type) and not pa.types.is_integer(column.type):
            return
        rows = valid(column) & (numbers(column) >= 0) & (numbers(column) <= _MOST)
        bus, node, told = (numbers(table.column(name))[rows].astype(np.int64) for name in ("bus", "src", CHANNEL))
        for code in distinct(bus << 16 | node << 8 | told):
            of = self._told.setdefault((code >> 16, code >> 8 & 0xFF), set())
            if len(of) < 2:
                of.add(code & 0xFF)

    def of(self, bus: int, node: int) -> int | None:
        """Return the channel of a node, None if it has none, or several."""
        told = self._told.get((bus, node), ())
        return next(iter(told)) if len(told) == 1 else None
