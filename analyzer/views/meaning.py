"""What a column means: its unit and the names of its values, looked up by the column's dotted name."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from analyzer.views.cells import pylist, step_into

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    import pyarrow as pa

    from analyzer.views.rows import Part
    from dissectors.schema import Bits, Message, Note, Packet


@dataclass(frozen=True, slots=True)
class Meaning:
    """Of one column. `texts` name values of its cells, `note` belongs to a field and `part` to a bit part of one."""

    unit: str = ""
    texts: Mapping[float, str] = field(default_factory=dict)
    clause: str = ""
    note: Note | None = None
    part: Bits | None = None


def meaning(of: Message | Packet | None, column: str) -> Meaning:
    """The meaning of `field`, `field.part`, `field.member` or a derived column; an empty one if nothing is said."""
    if of is None:
        return Meaning()
    note = of.notes.get(column)
    if note is not None:
        texts: dict[float, str] = {raw: text for table in (note.enum, note.special) for raw, text in table.items()}
        if note.scale is not None:
            texts = {raw * note.scale.numerator / note.scale.denominator: text for raw, text in texts.items()}
        return Meaning(note.unit, texts, note.clause, note)
    outer, _, last = column.rpartition(".")
    owner = of.notes.get(outer)
    for part in owner.parts if owner is not None else ():
        if part.name == last:
            named: dict[float, str] = {raw: text for raw, text in part.enum.items()}  # noqa: C416 - int keys to float
            return Meaning(part.unit, named, part.clause, part=part)
    for derived in of.derived:
        if derived.name == column:
            return Meaning(derived.unit, {}, derived.clause)
    return Meaning()


def cells(part: Part, column: str) -> list[Any]:
    """Values of a column; a member of a structure by its dotted name, physical like every column.

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
        return [_each(value, bits) for value in cells(part, outer)]
    kind = _type_of(part.table, outer)
    if kind is None or last not in kind:
        raise KeyError(column)
    return step_into(cells(part, outer), last)


def _type_of(table: pa.RecordBatch, column: str) -> Sequence[str] | None:
    """Names of the members of a structure, or of the structures in a list."""
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


def _each(value: Any, bits: Bits) -> Any:
    """A bit part of a word that is nested in a structure."""
    if isinstance(value, list):
        return [_each(cell, bits) for cell in value]
    if value is None:
        return None
    raw = value >> bits.low & (1 << bits.width) - 1
    if bits.scale is not None:
        return float(raw * bits.scale)
    return bool(raw) if bits.flag else raw
