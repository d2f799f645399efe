"""The memory of a filter, from batch to batch."""

from __future__ import annotations

from functools import cached_property
from typing import TYPE_CHECKING, Protocol

import numpy as np

from analyzer.filter.channels import ChannelsOf
from analyzer.filter.deltas import RowDeltas
from analyzer.filter.fields import FieldRef, Kind
from analyzer.filter.history import FrameHistory
from analyzer.filter.values import CodedWords
from analyzer.tables import KINDS
from analyzer.window.numbering import Numbering
from dissectors.kit.cells import numbers, valid

if TYPE_CHECKING:
    from collections.abc import Collection, Mapping, Sequence

    import pyarrow as pa

    from analyzer.decode.engine import Batch
    from dissectors import Registry
    from dissectors.kit import Array

UNIT = "unit"  # the column in which a profile gives people's number of a power unit


class NamesFrames(Protocol):
    """Knows which rules name frames."""

    def between(self, first: int, last: int) -> Mapping[int, Sequence[str]]:
        """Return the rules that name frames from the first place to the last, from 0, by place."""


class FilterMemory:
    """Frames that transfers may still name, the first time, channels of nodes, and what others have found out.

    Args:
        registry: the types.
        numbering: of frames; the capture's own if not given, then fed here.
        zero: the time that relative ones count from; that of the first frame if not given.
        labels: what nodes are called, by node ID.
        named: the rules that name frames; `severities` of rules.
        frame_list: rows are frames.
        columns: of frames, which are kept for transfers that end later.
    """

    def __init__(
        self, registry: Registry, *, numbering: Numbering | None, zero: int | None, labels: Mapping[int, str],
        named: NamesFrames | None, severities: Mapping[str, str], frame_list: bool, columns: Collection[str],
    ) -> None:  # fmt: skip
        self.registry, self.zero, self.labels = registry, zero, labels
        self.named, self.severities = named, severities
        self._own_numbering = numbering is None
        self.numbering = numbering or Numbering()
        self.history = FrameHistory(columns)
        self.channels = ChannelsOf(registry)
        self.deltas = RowDeltas(frame_list=frame_list)
        self._codes: dict[str, list[tuple[int, int, int]]] = {}

    def feed(self, batch: Batch) -> None:
        """Take the next batch."""
        if self._own_numbering:
            self.numbering.picked = batch.places
            self.numbering.feed(batch.first_frame, batch.frames, batch.events)
        if self.zero is None:
            self.zero = batch.zero
        if self.zero is None and len(batch.frames):
            column = batch.frames.column("t")
            known = valid(column)
            if known.any():
                self.zero = int(numbers(column)[int(np.argmax(known))])
        self.history.feed(batch)

    @cached_property
    def unit_fields(self) -> list[tuple[FieldRef, FieldRef]]:
        """The fields that name a unit, of packets wherever they are, and those that they are computed from."""
        carriers = [message.table for message in self.registry.carriers()]
        sources = {
            f"{carrier}.{packet.name}": derived.source
            for family in self.registry.families()
            for packet in family.packets
            for derived in packet.derived
            for carrier in carriers
            if derived.name == UNIT
        }
        return [(_number(UNIT, table), _number(source, table)) for table, source in sources.items()]

    def codes(self, table: str) -> list[tuple[int, int, int]]:
        """Return kind, data type ID and variant of a table's transfers."""
        if table not in self._codes:
            message = self.registry.message_of(table)
            found = []
            if message is not None:
                kinds = (0, 1) if message.kind == "message" else (KINDS.index(message.kind),)
                for kind in kinds:
                    for variant in range(256):
                        one = self.registry.message(kind, message.type_id, variant)
                        if one is None:
                            break
                        if one.table == table:
                            found.append((kind, message.type_id, variant))
            self._codes[table] = found
        return self._codes[table]

    def type_names(self, transfers: pa.RecordBatch) -> tuple[CodedWords, Array]:
        """Return what the types of transfers are called, and which have a name."""
        if not len(transfers):
            return CodedWords(np.zeros(0, np.int64), []), np.zeros(0, bool)
        kind, type_id, variant = (
            numbers(transfers.column(name)).astype(np.int64) for name in ("kind", "type_id", "variant")
        )
        codes, inverse = np.unique(variant << 24 | kind << 16 | type_id, return_inverse=True)
        found = [self.registry.message(c >> 16 & 0xFF, c & 0xFFFF, c >> 24) for c in codes.tolist()]
        known = np.array([message is not None for message in found])[inverse]
        return CodedWords(inverse, ["" if message is None else message.name for message in found]), known


def _number(column: str, table: str) -> FieldRef:
    return FieldRef(column, "table", Kind("number"), column, (table,))
