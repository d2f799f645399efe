"""The values of a column, or of a member of a structure in one, by the dotted name that people write."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from analyzer.facts.meaning import meaning
from dissectors.kit.cells import pylist, step_into

if TYPE_CHECKING:
    from collections.abc import Collection, Sequence

    import pyarrow as pa

    from analyzer.views.rows import MessagePart
    from dissectors.schema import Bits


def cells(part: MessagePart, column: str) -> list[Any]:
    """Return values of a column; a member of a structure by its dotted name, physical like every column.

    Raises `KeyError` for a column that the table does not have.
    """
    names = part.table.schema.names
    if column in names:
        return pylist(part.table.column(part.own(column)))
    outer, dot, last = column.rpartition(".")
    if not dot:
        raise KeyError(column)
    bits = meaning(part.of, column).part
    if bits is not None:
        special = owner.special if (owner := meaning(part.of, outer).note) is not None else ()
        return [_each(value, bits, special) for value in cells(part, outer)]
    kind = _type_of(part.table, outer)
    if kind is None or last not in kind:
        raise KeyError(column)
    return step_into(cells(part, outer), last)


def _type_of(table: pa.RecordBatch, column: str) -> Sequence[str] | None:
    """Return names of the members of a structure, or of the structures in a list."""
    head, *steps = column.split(".")
    if head not in table.schema.names:
        return None
    kind = table.schema.field(head).type
    for step in [*steps, None]:
        while hasattr(kind, "value_type"):
            kind = kind.value_type
        names = [kind.field(k).name for k in range(kind.num_fields)]
        if step is None:
            return names
        if step not in names:
            return None
        kind = kind.field(names.index(step)).type
    return None


def _each(value: Any, bits: Bits, special: Collection[int]) -> Any:
    """Return a bit part of a word that is nested in a structure; a special value has none."""
    if isinstance(value, list):
        return [_each(cell, bits, special) for cell in value]
    if value is None or value in special:
        return None
    raw = value >> bits.low & (1 << bits.width) - 1
    if bits.scale is not None:
        return float(raw * bits.scale)
    return bool(raw) if bits.flag else raw
