"""The values that the notes of a dissector allow a field: limits, and codes with names."""

from __future__ import annotations

from fractions import Fraction
from typing import TYPE_CHECKING, Self

import numpy as np

from analyzer.rules.field_tests import farthest
from analyzer.rules.limits import NOTHING, outside
from dissectors.layout import ArrayType, CompoundType, PrimitiveType
from dissectors.records import dataclass

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

    from dissectors.kit import Array, Worst
    from dissectors.layout import Type
    from dissectors.schema import Bits, Note

LIMITS, NAMES = "TYP-013", "TYP-014"
_WIDEST = 2  # bytes of numbers that are looked up in a table
_MOST_NAMED = 8  # codes that a text lists
_SCALARS = ("uint", "int", "float", "bool")


@dataclass(frozen=True, slots=True)
class NotedColumn:
    """A column with what its note allows, in raw values; `scale` makes them those that the column shows.

    `inner` are numbers in lists or structures. A part of bits, from `low_bit` on, names its `word`, which `special` is
    about. `only` are rows in which a field has a raw value; their numbers are in another column, `read`.
    """

    name: str
    unit: str
    scale: Fraction
    float_bits: int  # 0 of whole numbers
    inner: bool
    special: tuple[int, ...]
    enum: Mapping[int, str]
    low: Fraction | None
    high: Fraction | None
    word: str = ""
    low_bit: int = 0
    bits: int = 0
    only: tuple[str, int] | None = None
    read: str = ""

    @property
    def rule(self) -> str:
        """The rule that judges it: names go before limits."""
        return NAMES if self.enum else LIMITS

    @property
    def allowed(self) -> str:
        """The values that would have been right, in words."""
        if self.enum:
            named = [f"{code} {text}" for code, text in list(self.enum.items())[:_MOST_NAMED]]
            return f"named are {', '.join(named)}{', ...' if len(self.enum) > _MOST_NAMED else ''}"
        low, high = (None if limit is None else f"{float(limit * self.scale):g}" for limit in (self.low, self.high))
        if low is None or high is None:
            return f"at most {high} allowed" if low is None else f"at least {low} allowed"
        return f"{low} to {high} allowed"

    @property
    def worst(self) -> Worst:
        """The kind of number that is worst beyond the limits."""
        kind = farthest(self.low, self.high)
        return kind if isinstance(kind, str) else kind * float(self.scale)

    def part_of(self, words: Array) -> Array:
        """Return this part of words, scaled."""
        part: Array = (words >> words.dtype.type(self.low_bit)) & words.dtype.type((1 << self.bits) - 1)
        return part if self.scale == 1 else part * float(self.scale)


class NotedTest:
    """A column with what it takes to find numbers in it that its note does not allow."""

    def __init__(self, column: NotedColumn) -> None:
        self.column = column
        low, high = column.low, column.high
        self._low = -np.inf if low is None else _limit(low, -1, column.float_bits, column.scale)
        self._high = np.inf if high is None else _limit(high, 1, column.float_bits, column.scale)
        special = () if column.word else column.special
        self._codes = (*column.enum, *special)  # of limits what is right beyond them
        self._tables: dict[int, Array] = {}  # by bytes of a number, of each whether it is one of the codes

    def __deepcopy__(self, _memo: object) -> Self:
        """Share it: nothing but its tables is added, which are the same for everybody."""
        return self

    def wrong(self, shown: Array) -> Array:
        """Return the places of numbers without a name in the enumeration or, if there is none, beyond the limits."""
        if self.column.enum:
            named = self._named(shown)
            return NOTHING if named.all() else (~named).nonzero()[0]
        places = outside(shown, self._low, self._high)
        return places[~self._named(shown[places])] if len(places) and self._codes else places

    def _named(self, shown: Array) -> Array:
        size = shown.dtype.itemsize
        if shown.dtype.kind == "u" and size <= _WIDEST and self.column.scale == 1:
            if size not in self._tables:
                self._tables[size] = np.isin(np.arange(1 << 8 * size), self._codes)
            return self._tables[size][shown]
        return np.isin(np.rint(shown / float(self.column.scale)), self._codes)


def _limit(raw: Fraction, side: int, float_bits: int, scale: Fraction) -> float:
    """Return a limit as a column would show it, beyond which numbers are wrong on one side."""
    if float_bits:  # as a sender rounds it; the column rounds once more where it is scaled
        sent = float(np.dtype(f"f{float_bits // 8}").type(float(raw)))
        return sent if scale == 1 else float(np.nextafter(sent * float(scale), side * np.inf))
    # Half a step lies between a limit and the next raw value, whatever a scaled number was rounded to.
    return float((raw + Fraction(side, 2)) * scale)


def columns_of(name: str, note: Note, layout: CompoundType) -> Iterator[NotedColumn]:
    """Yield the columns of a field whose note says what is allowed: the field itself, and parts of its bits.

    A dotted name is that of a member in a structure, or in each of a list of them.
    """
    kind, inner = _reach(layout, name)
    scalar = _scalar(kind)
    if scalar is None:
        return
    inner = inner or isinstance(kind, ArrayType)
    bits = scalar.bits if scalar.kind == "float" else 0
    if note.enum or (note.low, note.high) != (None, None):
        yield NotedColumn(
            name, note.unit, note.scale or Fraction(1), bits, inner, tuple(note.special), note.enum, note.low, note.high
        )
    if isinstance(kind, PrimitiveType):
        yield from (_part(name, note, part, inner=inner) for part in note.parts if part.enum or _limited(part))
    if note.unit_by is not None and not inner:
        for code, one in note.unit_by.table.items():
            if one.high is not None:
                yield NotedColumn(
                    name, one.unit, one.scale or Fraction(1), bits, inner, (), {}, None, one.high,
                    only=(note.unit_by.field, code), read=f"{name}.value",
                )  # fmt: skip


def _reach(layout: CompoundType, name: str) -> tuple[Type | None, bool]:
    """Return the type of a field by its dotted name, and whether it is inside of another one."""
    kind: Type | None = layout
    for step in name.split("."):
        kind = kind.element if isinstance(kind, ArrayType) else kind
        kind = kind.member(step) if isinstance(kind, CompoundType) else None
    return kind, "." in name


def _part(name: str, note: Note, part: Bits, *, inner: bool) -> NotedColumn:
    return NotedColumn(
        f"{name}.{part.name}", part.unit, part.scale or Fraction(1), 0, inner, tuple(note.special), part.enum,
        part.low_limit, part.high_limit, word=name, low_bit=part.low, bits=part.width,
    )  # fmt: skip


def _limited(bits: Bits) -> bool:
    return not bits.flag and (bits.low_limit, bits.high_limit) != (None, None)


def _scalar(kind: Type | None) -> PrimitiveType | None:
    element = kind.element if isinstance(kind, ArrayType) else kind
    return element if isinstance(element, PrimitiveType) and element.kind in _SCALARS else None
