"""Where the bits are: the layout of a data type, as DSDL alone gives it.

Sizes are in bits. Dynamic arrays follow UAVCAN v0: a length field that counts up to the maximum, left out when tail
array optimisation applies.
"""

from __future__ import annotations

from typing import Literal

from dissectors.records import dataclass, field

PrimitiveKind = Literal["uint", "int", "float", "bool", "void"]
PlanToken = tuple[str, int, int]


@dataclass(frozen=True, slots=True)
class PrimitiveType:
    """A scalar of `bits` bits; a `void` is padding that has no name and no value."""

    kind: PrimitiveKind
    bits: int
    saturated: bool = True

    @property
    def min_bits(self) -> int:
        """The same as `bits`: a scalar has one size."""
        return self.bits

    @property
    def max_bits(self) -> int:
        """The same as `bits`: a scalar has one size."""
        return self.bits


@dataclass(frozen=True, slots=True)
class ArrayType:
    """`max` elements, or up to `max` of them if `dynamic`; elements are never arrays themselves."""

    element: PrimitiveType | CompoundType
    max: int
    dynamic: bool

    @property
    def length_bits(self) -> int:
        """Width of the length field, 0 for a static array."""
        return self.max.bit_length() if self.dynamic else 0

    @property
    def min_bits(self) -> int:
        """Without the length field, which tail array optimisation may leave out."""
        return 0 if self.dynamic else self.max * self.element.min_bits

    @property
    def max_bits(self) -> int:
        """All elements and the length field."""
        return self.length_bits + self.max * self.element.max_bits


@dataclass(frozen=True, slots=True)
class Member:
    """One field of a compound, in wire order; padding has an empty name."""

    name: str
    type: Type


@dataclass(frozen=True, slots=True)
class CompoundType:
    """A structure, or a tagged union of its fields. `name` is the full DSDL name."""

    name: str
    fields: tuple[Member, ...]
    union: bool = False
    min_bits: int = field(init=False, compare=False)
    max_bits: int = field(init=False, compare=False)

    def __post_init__(self) -> None:
        """Compute sizes once: a nested type is asked for them many times."""
        low = [member.type.min_bits for member in self.fields] or [0]
        high = [member.type.max_bits for member in self.fields] or [0]
        object.__setattr__(self, "min_bits", self.tag_bits + min(low) if self.union else sum(low))
        object.__setattr__(self, "max_bits", self.tag_bits + max(high) if self.union else sum(high))

    @property
    def tag_bits(self) -> int:
        """Width of a union's tag: the smallest that counts its fields."""
        return (len(self.fields) - 1).bit_length() if self.union else 0

    def member(self, name: str) -> Type | None:
        """Return the type of a named field."""
        return next((member.type for member in self.fields if member.name and member.name == name), None)


Type = PrimitiveType | ArrayType | CompoundType


def plan(layout: Type) -> list[PlanToken]:
    """Return preorder tokens of a layout.

    `("struct", n, 0)` and `("union", n, tag_bits)` are followed by n nodes, `("array", count, 0)` and
    `("list", max, length_bits)` by one; `("uint" | "int" | "float" | "bool" | "void", bits, 0)` stand alone.
    """
    if isinstance(layout, PrimitiveType):
        return [(layout.kind, layout.bits, 0)]
    if isinstance(layout, ArrayType):
        return [("list" if layout.dynamic else "array", layout.max, layout.length_bits), *plan(layout.element)]
    tokens: list[PlanToken] = [("union" if layout.union else "struct", len(layout.fields), layout.tag_bits)]
    for member in layout.fields:
        tokens.extend(plan(member.type))
    return tokens


def wire_bits(layout: Type, *, tail: bool) -> tuple[int, int]:
    """Return the least and most bits on the wire; with `tail` the value ends a payload with tail array optimisation."""
    if isinstance(layout, PrimitiveType):
        return layout.bits, layout.bits
    if isinstance(layout, ArrayType):
        inner, last = wire_bits(layout.element, tail=False), wire_bits(layout.element, tail=tail)
        if not layout.dynamic:
            return (layout.max - 1) * inner[0] + last[0], (layout.max - 1) * inner[1] + last[1]
        if tail and layout.element.min_bits >= 8:
            return 0, layout.max * inner[1]
        return layout.length_bits, layout.length_bits + (layout.max - 1) * inner[1] + last[1]
    if layout.union:
        sizes = [wire_bits(member.type, tail=tail) for member in layout.fields]
        return layout.tag_bits + min(low for low, _ in sizes), layout.tag_bits + max(high for _, high in sizes)
    sizes = [wire_bits(member.type, tail=tail and member is layout.fields[-1]) for member in layout.fields]
    return sum(low for low, _ in sizes), sum(high for _, high in sizes)
