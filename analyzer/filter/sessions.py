"""Filters asked of all transfers of a session at once: of one type, from one node to another."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pyarrow as pa

from analyzer.decode.engine import Batch
from analyzer.filter.context import BatchContext
from analyzer.filter.nodes import Junction, Negation
from analyzer.filter.rowsets import TransferSet
from analyzer.tables import EVENT_ROWS, FRAMES, KINDS, SETTLED, TRANSFERS, empty
from dissectors.records import replace

if TYPE_CHECKING:
    from analyzer.filter.fields import FieldRef
    from analyzer.filter.memory import FilterMemory
    from analyzer.filter.nodes import Condition
    from dissectors.kit import Array

_BROADCASTS = KINDS.index("message"), KINDS.index("anonymous")
_SHARED = ("kind", "type_id", "src", "dst", "type")  # columns in which transfers of a session do not differ
_EMPTY = Batch(
    empty(FRAMES), empty(TRANSFERS), empty(EVENT_ROWS), {}, empty(SETTLED), first_frame=0, first_transfer=0, buses=()
)


def may_select(condition: Condition, memory: FilterMemory, session: tuple[int, int, int, int]) -> bool:
    """Return whether a transfer of a session (kind, data type ID, source, destination) may be selected.

    A CRC alone tells types with one ID apart, so that a session may be of each of them.
    """
    rows = _one_of_each_type(memory, *session)
    return bool(_limits(condition, rows)[0].any())


def _limits(condition: Condition, rows: TransferSet) -> tuple[Array, Array]:
    """Return for each type whether a transfer may be selected, and whether every one is."""
    if isinstance(condition, Negation):
        some, every = _limits(condition.parts[0], rows)
        return ~every, ~some
    if isinstance(condition, Junction):
        join = np.logical_and if condition.both else np.logical_or
        parts = [_limits(part, rows) for part in condition.parts]
        return join.reduce([some for some, _ in parts]), join.reduce([every for _, every in parts])
    if all(_shared(ref, rows) for ref in condition.fields()):
        found = condition.test(rows)
        return found, found
    return np.ones(rows.size, bool), np.zeros(rows.size, bool)


def _shared(ref: FieldRef, rows: TransferSet) -> bool:
    """Return whether all transfers of a session have the same value of a field."""
    if ref.origin == "type":
        return all(rows.context.memory.registry.message_of(table) is not None for table in ref.tables)
    return ref.origin in ("node", "label") or (ref.origin == "transfer" and ref.column in _SHARED)


def _one_of_each_type(memory: FilterMemory, kind: int, type_id: int, src: int, dst: int) -> TransferSet:
    """Return a transfer of a session for each type that it may be of."""
    types = 1
    while memory.registry.message(kind, type_id, types) is not None:
        types += 1
    row = {"kind": kind, "type_id": type_id, "src": src, "dst": None if kind in _BROADCASTS else dst}
    columns = [field for field in TRANSFERS if field.name in row or field.name == "variant"]
    made = pa.RecordBatch.from_pylist([{**row, "variant": one} for one in range(types)], schema=pa.schema(columns))
    return TransferSet(BatchContext(replace(_EMPTY, transfers=made), memory))
