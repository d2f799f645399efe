"""The layout of a type, as far as rules about any type ask for it."""

from __future__ import annotations

from typing import TYPE_CHECKING

from dissectors.records import dataclass
from dissectors.schema import ArrayType, CompoundType, PrimitiveType, wire_bits

if TYPE_CHECKING:
    from collections.abc import Iterator

    from dissectors.kit import DecodedTable, View
    from dissectors.schema import Message, Type

BYTE = 8


@dataclass(frozen=True, slots=True)
class Tail:
    """The array that ends a payload without a length: column, its elements' fewest and most bits, and how many."""

    field: str
    bits: tuple[int, int]
    most: int


@dataclass(frozen=True, slots=True)
class Shape:
    """A type, as far as the rules ask for it.

    `floats` are widths by dotted name, `float_fields` the outer fields that have them, `lists` the outer arrays that
    have a length. `numbers` are `least`, `most`, bits of an element of `tail` if all have as many and it is no array
    inside, and as 0 or 1 whether there are void bits, lengths that may be wrong, and such lengths in a payload without
    that of the tail.
    """

    message: Message
    least: tuple[int, int]
    most: int
    tail: Tail | None
    floats: dict[str, int]
    float_fields: tuple[str, ...]
    lists: dict[str, int]
    numbers: tuple[int, ...]

    @classmethod
    def of(cls, message: Message) -> Shape:
        """Return the shape of a type."""
        parts = list(_parts(message.layout, ""))
        dynamic = [part for _, part in parts if isinstance(part, ArrayType) and part.dynamic]
        outer = {m.name: m.type for m in message.layout.fields} if not message.layout.union else {}
        least, most = (message.min_bytes, message.min_bytes_with_length), message.max_bytes
        tail = _tail(message.layout)
        element = tail.bits[0] if tail is not None and tail.bits[0] == tail.bits[1] and "." not in tail.field else 0
        voids = any(isinstance(part, PrimitiveType) and part.kind == "void" for _, part in parts)
        # Numbers without a length, and nothing else that has one: how many there are is all that can be wrong.
        bare = tail is not None and [isinstance(part.element, PrimitiveType) for part in dynamic] == [True]
        floats = {name: part.bits for name, part in parts if isinstance(part, PrimitiveType) and part.kind == "float"}
        return cls(
            message=message,
            least=least,
            most=most,
            tail=tail,
            floats=floats,
            float_fields=tuple(dict.fromkeys(path.partition(".")[0] for path in floats)),
            lists={name: kind.max for name, kind in outer.items() if isinstance(kind, ArrayType) and kind.dynamic},
            numbers=(*least, most, element, voids, bool(dynamic), bool(dynamic) and not bare),
        )


def shape_of(shapes: dict[str, Shape], view: View, table: DecodedTable) -> Shape:
    """Return the shape of a message table, and keep it in `shapes`."""
    found = shapes.get(table.name)
    if found is None:
        message = view.definition(table.name)
        assert message is not None  # noqa: S101 - others are no message tables
        found = shapes[table.name] = Shape.of(message)
    return found


def column_of(table: DecodedTable, field: str) -> str:
    """Return the column of a field: one that is called like a column about the transfer has another name."""
    return f"{field}.field" if f"{field}.field" in table else field


def dsdl_name(path: str) -> str:
    """Return the name in the definition."""
    head, _, rest = path.partition(".")
    return f"{head}{rest.removeprefix('field')}" if rest.startswith("field") else path


def _parts(layout: Type, name: str) -> Iterator[tuple[str, Type]]:
    """Yield every type in a layout with its dotted name, that of an array also for its elements."""
    yield name, layout
    if isinstance(layout, ArrayType):
        yield from _parts(layout.element, name)
    elif isinstance(layout, CompoundType):
        for member in layout.fields:
            yield from _parts(member.type, f"{name}.{member.name}".lstrip("."))


def _tail(layout: Type, name: str = "") -> Tail | None:
    """Return the array that has no length on classic CAN; none where a union decides."""
    if isinstance(layout, CompoundType) and layout.fields and not layout.union:
        last = layout.fields[-1]
        return _tail(last.type, f"{name}.{last.name}".lstrip("."))
    if isinstance(layout, ArrayType) and layout.dynamic and layout.element.min_bits >= BYTE:
        return Tail(name, wire_bits(layout.element, tail=False), layout.max)
    return None
