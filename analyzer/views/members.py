"""The values of a column, or of a member of a structure in one, by the dotted name that people write."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import pyarrow as pa

from analyzer.facts.meaning import meaning
from dissectors.kit.cells import pylist, step_into
from dissectors.records import dataclass
from dissectors.schema import PrimitiveType

if TYPE_CHECKING:
    from collections.abc import Callable, Collection, Sequence

    from analyzer.views.rows import MessagePart
    from analyzer.views.sheets import SheetColumns, Template
    from dissectors.schema import Bits, Message, Note, Packet, Type

# Of a number in a template: how its scale is undone, the lowest of how many bits, their scale, whether it is a flag.
Take = tuple[tuple[float, float, bool] | None, tuple[int, int] | None, tuple[float, float] | None, bool]
PLAIN: Take = (None, None, None, False)
ALL = 1 << 31  # as many as there are
NOTHING: Template = ("text", "")


def whole(value: float) -> float:
    """Return a number without a fraction as an integer, as cases of templates have it."""
    return int(value) if value == int(value) else value


def unscaled(kind: Type, note: Note | None) -> Take:
    """Return how the raw number of a field is taken from its column, which holds raw * scale."""
    if note is None or note.scale is None:
        return PLAIN
    rounded = not (isinstance(kind, PrimitiveType) and kind.kind == "float")
    return (float(note.scale.numerator), float(note.scale.denominator), rounded), None, None, False


def part_of(bits: Bits, word: Take = PLAIN) -> Take:
    """Return how a bit part is taken from a word."""
    scale = None if bits.scale is None or bits.enum else (float(bits.scale.numerator), float(bits.scale.denominator))
    return word[0], (bits.low, bits.width), scale, bits.flag


@dataclass(frozen=True, slots=True)
class CellTemplates:
    """How a view writes cells: a `single` value of an Arrow type, `each` of a list, what stands for `missing` ones."""

    missing: str
    single: Callable[[pa.DataType, Take], Template]
    each: Callable[[Template], Template]

    def column(self, of: Message | Packet | None, columns: SheetColumns, name: str) -> Template:
        """Return a template of a column; of a member of a structure by its dotted name, physical like every column.

        Raises `KeyError` for a column that the table does not have.
        """
        return self._path(of, columns, name, self.cell)

    def cell(self, kind: pa.DataType, take: Take = PLAIN) -> Template:
        """Return a template of a cell."""
        inner = self.each(self.cell(kind.value_type, take)) if pa.types.is_list(kind) else self.single(kind, take)
        return ("or", self.missing, inner)

    def _path(
        self, of: Message | Packet | None, columns: SheetColumns, name: str, finish: Callable[[pa.DataType], Template]
    ) -> Template:
        if name in columns:
            return columns.of(columns.own(name), finish(columns.schema.field(columns.own(name)).type))
        outer, _, last = name.rpartition(".")
        if not outer:
            raise KeyError(name)
        bits = meaning(of, name).part
        owner = meaning(of, outer).note if bits is not None else None
        special = [(value, ("text", self.missing)) for value in (owner.special if owner is not None else ())]

        def inside(kind: pa.DataType) -> Template:
            if pa.types.is_list(kind):
                return ("or", self.missing, self.each(inside(kind.value_type)))
            if bits is not None:
                found = self.single(pa.bool_() if bits.flag else pa.int64(), part_of(bits))
                return ("or", self.missing, ("switch", PLAIN, special, found))
            place = kind.get_field_index(last) if pa.types.is_struct(kind) else -1
            if place < 0:
                raise KeyError(name)
            return ("or", self.missing, ("of", place, finish(kind.field(place).type)))

        return self._path(of, columns, outer, inside)


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
