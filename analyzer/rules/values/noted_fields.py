"""The values that the notes of a dissector allow a field: limits, and codes with names."""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction
from typing import TYPE_CHECKING

import numpy as np

from dissectors.layout import ArrayType, PrimitiveType

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Mapping

    from dissectors.kit import Array
    from dissectors.layout import CompoundType, Type
    from dissectors.schema import Bits, Note

LIMITS, NAMES = "TYP-013", "TYP-014"
_MOST_NAMED = 8  # codes that a text lists
_SCALARS = ("uint", "int", "float")


@dataclass(frozen=True, slots=True)
class NotedColumn:
    """A column with what its note allows, in raw values; `scale` makes them those that the column shows."""

    name: str
    unit: str
    scale: Fraction
    whole: bool
    listed: bool
    special: tuple[int, ...]
    enum: Mapping[int, str]
    low: Fraction | None
    high: Fraction | None
    word: str = ""  # the field whose part it is, which `special` is about

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

    def wrong(self, shown: Array) -> Array:
        """Return which numbers have no name in the enumeration or, without one, are beyond the limits."""
        return self._nameless(shown) if self.enum else self._outside(shown)

    def _outside(self, shown: Array) -> Array:
        """Return which numbers are beyond the limits; NaN is not."""
        # Half a step lies between a limit and the next raw value, whatever a scaled number was rounded to.
        half, scale = Fraction(1, 2) if self.whole else Fraction(0), self.scale
        wrong = np.zeros(len(shown), bool)
        if self.low is not None:
            wrong |= shown < float((self.low - half) * scale)
        if self.high is not None:
            wrong |= shown > float((self.high + half) * scale)
        return wrong if self.word else wrong & ~self._in(shown, self.special)

    def _nameless(self, shown: Array) -> Array:
        return ~self._in(shown, self.enum if self.word else [*self.enum, *self.special])

    def _in(self, shown: Array, codes: Iterable[int]) -> Array:
        return np.isin(np.rint(shown / float(self.scale)), list(codes)) if codes else np.zeros(len(shown), bool)


def columns_of(name: str, note: Note, layout: CompoundType) -> Iterator[NotedColumn]:
    """Yield the columns of a field whose note says what is allowed: the field itself, and parts of its bits."""
    kind = layout.member(name)
    scalar = _scalar(kind)
    if scalar is None:
        return
    if note.enum or (note.low, note.high) != (None, None):
        yield NotedColumn(
            name, note.unit, note.scale or Fraction(1), scalar.kind != "float", isinstance(kind, ArrayType),
            tuple(note.special), note.enum, note.low, note.high,
        )  # fmt: skip
    if isinstance(kind, PrimitiveType):
        yield from (_part(name, note, bits) for bits in note.parts if bits.enum or _limited(bits))


def _part(name: str, note: Note, bits: Bits) -> NotedColumn:
    scale = bits.scale or Fraction(1)
    return NotedColumn(
        f"{name}.{bits.name}", bits.unit, scale, whole=True, listed=False, special=tuple(note.special),
        enum=bits.enum, low=bits.low_limit, high=bits.high_limit, word=name,
    )  # fmt: skip


def _limited(bits: Bits) -> bool:
    return not bits.flag and (bits.low_limit, bits.high_limit) != (None, None)


def _scalar(kind: Type | None) -> PrimitiveType | None:
    element = kind.element if isinstance(kind, ArrayType) else kind
    return element if isinstance(element, PrimitiveType) and element.kind in _SCALARS else None
