"""A payload read bit by bit along its layout, for what no column keeps: wrong tags and lengths, and void bits.

Only for the rare payloads that the native core found odd.
"""

from __future__ import annotations

from contextlib import suppress
from typing import TYPE_CHECKING, NoReturn

from dissectors.records import dataclass, field
from dissectors.schema import ArrayType, CompoundType, PrimitiveType

if TYPE_CHECKING:
    from dissectors.schema import Type

# Codes of a message table's column `layout`.
TAIL, PREFIX, BYTE_PREFIX = range(3)
_MOST_VOIDS = 16


@dataclass(slots=True)
class Walked:
    """Oddities of a payload.

    `tag` is the first union tag that names no member: field, tag, members. `many` is the first length above its
    maximum: field, elements, most. `voids` are the void fields that are not 0, as bits and value, the first 16.
    """

    tag: tuple[str, int, int] | None = None
    many: tuple[str, int, int] | None = None
    voids: list[tuple[int, int]] = field(default_factory=list)


class _LostError(Exception):
    """The rest has no known place."""


class _Walk:
    def __init__(self, payload: bytes, code: int) -> None:
        self._bits = int.from_bytes(payload, "big")
        self._left = 8 * len(payload)
        self._code = code
        self.found = Walked()

    def read(self, layout: Type, name: str, *, tail: bool) -> None:
        if isinstance(layout, PrimitiveType):
            value = self._number(layout.bits)
            if layout.kind == "void" and value and len(self.found.voids) < _MOST_VOIDS:
                self.found.voids.append((layout.bits, value))
        elif isinstance(layout, ArrayType):
            self._array(layout, name, tail=tail)
        elif layout.union:
            self._union(layout, name, tail=tail)
        else:
            last = len(layout.fields) - 1
            for at, member in enumerate(layout.fields):
                self.read(member.type, _joined(name, member.name), tail=tail and at == last)

    def _array(self, layout: ArrayType, name: str, *, tail: bool) -> None:
        count = layout.max
        if layout.dynamic:
            bare = tail and layout.element.min_bits >= 8
            if bare and self._code == TAIL:
                while self._left >= layout.element.min_bits:
                    self.read(layout.element, name, tail=False)
                return
            count = self._number(8 if bare and self._code == BYTE_PREFIX else layout.length_bits)
            if count > layout.max:
                self.found.many = (name, count, layout.max)
                raise _LostError
            tail = tail and not bare
        for at in range(count):
            self.read(layout.element, name, tail=tail and at == count - 1)

    def _union(self, layout: CompoundType, name: str, *, tail: bool) -> None:
        tag = self._number(layout.tag_bits)
        if tag >= len(layout.fields):
            self.found.tag = (name or "union", tag, len(layout.fields))
            raise _LostError
        member = layout.fields[tag]
        self.read(member.type, _joined(name, member.name), tail=tail)

    def _number(self, width: int) -> int:
        """Read a number: whole low-order bytes first, then the high bits that remain."""
        if width > self._left:
            self._end()
        value = 0
        for low in range(0, width, 8):
            size = min(8, width - low)
            self._left -= size
            value |= (self._bits >> self._left & (1 << size) - 1) << low
        return value

    def _end(self) -> NoReturn:
        self._left = 0
        raise _LostError


def walk(layout: CompoundType, payload: bytes, code: int) -> Walked:
    """Read a payload as far as it goes; `code` is that of the table's column `layout`."""
    made = _Walk(payload, code)
    with suppress(_LostError):
        made.read(layout, "", tail=True)
    return made.found


def _joined(outer: str, inner: str) -> str:
    return f"{outer}.{inner}" if outer and inner else outer or inner
