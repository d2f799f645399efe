"""The tree that a filter is read to: what stands where, before anybody knows what the names mean."""

from __future__ import annotations

from typing import TYPE_CHECKING

from dissectors.records import dataclass, field

if TYPE_CHECKING:
    from fractions import Fraction

Span = tuple[int, int]
_NOWHERE: Span = (0, 0)


@dataclass(frozen=True, slots=True)
class BareWord:
    """A name with dots, of a field or a type, or a value in plain letters."""

    text: str
    span: Span = field(default=_NOWHERE, compare=False)


@dataclass(frozen=True, slots=True)
class Number:
    """A number as it is written, and its value: an `int` or, with a point or exponent, a fraction.

    `unit` is what stands behind it.
    """

    text: str
    value: int | Fraction
    unit: str = ""
    span: Span = field(default=_NOWHERE, compare=False)


@dataclass(frozen=True, slots=True)
class QuotedText:
    """Text between quotes, as it is written; a `raw` one has no escapes."""

    text: str
    raw: bool = False
    span: Span = field(default=_NOWHERE, compare=False)


@dataclass(frozen=True, slots=True)
class Octets:
    """Bytes in hexadecimal with colons."""

    value: bytes
    span: Span = field(default=_NOWHERE, compare=False)


@dataclass(frozen=True, slots=True)
class ValueRange:
    """From `low` to `high`, both included."""

    low: Syntax
    high: Syntax
    span: Span = field(default=_NOWHERE, compare=False)


@dataclass(frozen=True, slots=True)
class Members:
    """Values and intervals in braces."""

    items: tuple[Syntax, ...]
    span: Span = field(default=_NOWHERE, compare=False)


@dataclass(frozen=True, slots=True)
class SlicePiece:
    """Of bytes, text or a list: `length` places from `start` on (None: to the end), or those up to `end` included.

    Negative places count from the end. `single` is one place without a length.
    """

    start: int
    length: int | None = None
    end: int | None = None
    single: bool = False


@dataclass(frozen=True, slots=True)
class Slice:
    """Pieces of something, one after the other."""

    of: Syntax
    pieces: tuple[SlicePiece, ...]
    span: Span = field(default=_NOWHERE, compare=False)


@dataclass(frozen=True, slots=True)
class Call:
    """A function and what it is given."""

    name: str
    given: tuple[Syntax, ...]
    span: Span = field(default=_NOWHERE, compare=False)


@dataclass(frozen=True, slots=True)
class Sign:
    """A minus in front of something."""

    of: Syntax
    span: Span = field(default=_NOWHERE, compare=False)


@dataclass(frozen=True, slots=True)
class Arithmetic:
    """`op` is one of `+ - * / % &`."""

    op: str
    left: Syntax
    right: Syntax
    span: Span = field(default=_NOWHERE, compare=False)


@dataclass(frozen=True, slots=True)
class Comparison:
    """`op` is one of `== != < <= > >= contains matches in`.

    With `every` all values of a row have to hold, otherwise one is enough.
    """

    op: str
    left: Syntax
    right: Syntax
    every: bool = False
    span: Span = field(default=_NOWHERE, compare=False)


@dataclass(frozen=True, slots=True)
class Not:
    """The rows that something does not hold for."""

    of: Syntax
    span: Span = field(default=_NOWHERE, compare=False)


@dataclass(frozen=True, slots=True)
class Logic:
    """`op` is `and` or `or`."""

    op: str
    terms: tuple[Syntax, ...]
    span: Span = field(default=_NOWHERE, compare=False)


Syntax = (
    BareWord
    | Number
    | QuotedText
    | Octets
    | ValueRange
    | Members
    | Slice
    | Call
    | Sign
    | Arithmetic
    | Comparison
    | Not
    | Logic
)
