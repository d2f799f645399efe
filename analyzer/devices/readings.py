"""The reading of each row of a node, as it comes: from the first evidence on, and for ever after.

Unlike the statements of `facts.dialects`, which wait for the end of a capture, this is known for every row when it
comes by, and does not depend on how the capture is cut.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from analyzer.facts.meaning import meaning
from dissectors.kit.cells import numbers, valid

if TYPE_CHECKING:
    from collections.abc import Collection, Iterable, Mapping

    import pyarrow as pa

    from dissectors import Registry
    from dissectors.kit import Array
    from dissectors.only import Only
    from dissectors.picture import Plot
    from dissectors.schema import Evidence, Message, Reading

_NEVER = np.iinfo(np.uint64).max


class Readings:
    """The readings of one message's doubtful fields.

    Args:
        message: whose rows are asked about.
        forced: choices by node ID that stand against any evidence.
    """

    def __init__(self, message: Message, forced: Mapping[int, Collection[str]]) -> None:
        self._message = message
        self._forced = forced
        self._readings = {reading.name: reading for reading in message.readings}
        # by reading and choice: from which transfer on the evidence of a sender (bus and node) counts
        self._since: dict[tuple[str, str], Array] = {}

    def feed(self, tables: Mapping[str, pa.RecordBatch]) -> None:
        """Add the tables of a batch: evidence in the rows of the message, and what nodes sent beside it."""
        own = tables.get(self._message.table)
        for reading in self._readings.values():
            for evidence in reading.evidence:
                if evidence.every or evidence.choice == reading.otherwise:
                    continue
                for name in evidence.sends:
                    if (table := tables.get(name)) is not None:
                        self._note(reading, evidence, table, np.ones(len(table), bool))
                if own is not None and evidence.field in own.schema.names:
                    self._note(reading, evidence, own, self._inside(evidence, own.column(evidence.field)))

    def _note(self, reading: Reading, evidence: Evidence, table: pa.RecordBatch, rows: Array) -> None:
        rows = rows & numbers(table.column("trusted"))
        since = self._since.setdefault((reading.name, evidence.choice), np.full(1 << 16, _NEVER, np.uint64))
        np.minimum.at(since, senders(table)[rows], numbers(table.column("transfer"))[rows])

    def _inside(self, evidence: Evidence, column: pa.Array) -> Array:
        about = meaning(self._message, evidence.field)
        scale = next((found.scale for found in (about.note, about.part) if found is not None and found.scale), 1)
        values = numbers(column)
        inside = valid(column)
        if evidence.low is not None:
            inside = inside & (values >= float(evidence.low * scale))
        if evidence.stop is not None:
            inside = inside & (values < float(evidence.stop * scale))
        return inside

    def holds(self, only: Only, table: pa.RecordBatch) -> Array:
        """Return the rows whose node reads its field so."""
        reading, nodes = self._readings.get(only.reading), senders(table)
        if reading is None:
            return np.zeros(len(table), bool)
        transfer = numbers(table.column("transfer"))
        if only.choice == reading.otherwise:
            rows = np.ones(len(table), bool)
            for (name, _), since in self._since.items():
                if name == only.reading:
                    rows &= transfer < since[nodes]
        elif (found := self._since.get((only.reading, only.choice))) is not None:
            rows = transfer >= found[nodes]
        else:
            rows = np.zeros(len(table), bool)
        for node, choices in self._forced.items():
            mine = nodes & 0xFF == node
            wanted = [choice for choice in choices if choice in reading.choices]
            if wanted:
                rows = np.where(mine, wanted[0] == only.choice, rows)
        return rows


def doubtful(plots: Iterable[Plot], registry: Registry, forced: Mapping[int, Collection[str]]) -> dict[str, Readings]:
    """Return the readings that plots ask for, by table."""
    found = {}
    for plot in plots:
        if any(line.only for line in plot.lines) or any(states.only for states in plot.states):
            message = registry.message_of(plot.table)
            if message is not None:
                found[plot.table] = Readings(message, forced)
    return found


def senders(table: pa.RecordBatch) -> Array:
    """Return bus and node of each row as one number."""
    code: Array = numbers(table.column("bus")).astype(np.uint16) << np.uint16(8) | numbers(table.column("src"))
    return code
