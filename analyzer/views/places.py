"""Places of values in the payload: the layout walked once more, with the lengths and tags that were decoded."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from analyzer.decode.prefix import BYTE_PREFIX, TAIL
from dissectors.records import dataclass
from dissectors.schema import ArrayType, CompoundType, PrimitiveType

if TYPE_CHECKING:
    from collections.abc import Iterator

    from dissectors.schema import Type

USUAL = 1
_TAIL_ELEMENT_BITS = 8


@dataclass(frozen=True, slots=True)
class FieldPlace:
    """Some bits of a payload and what they are.

    `path` is like `cmd[3]` or `value.integer_value`. `role` is value, length (of the array `path`), tag (of the union
    `path`) or padding. `start` counts bits from the first byte's most significant bit.
    """

    path: str
    role: str
    start: int
    bits: int
    type: PrimitiveType | None = None

    @property
    def first_byte(self) -> int:
        """The byte that `start` is in, from 0."""
        return self.start // 8

    @property
    def last_byte(self) -> int:
        """The byte of the last bit, from 0."""
        return (self.start + max(self.bits, 1) - 1) // 8

    def words(self) -> str:
        """Write bytes from 1, as the document counts them, and bits (7 is a byte's first) where they are not whole."""
        first, last = f"{self.first_byte + 1}", f"{self.last_byte + 1}"
        if self.start % 8 == 0 and self.bits % 8 == 0:
            return f"byte {first}" if first == last else f"bytes {first}-{last}"
        high, low = 7 - self.start % 8, 7 - (self.start + self.bits - 1) % 8
        if first == last:
            return f"byte {first} bit {high}" if self.bits == 1 else f"byte {first} bits {high}-{low}"
        return f"byte {first} bit {high} to byte {last} bit {low}"


def places(layout: Type, values: Any, code: int = TAIL) -> list[FieldPlace]:
    """Give every bit of one value, in wire order and without overlap.

    Args:
        layout: of a whole message, or of anything in it (with `code` 1).
        values: the decoded row: structures as mappings, lists in full; of a union the active member is not None.
        code: layout code of the row, as in the message tables.

    A value that is None, and a list with fewer elements than its type has, was not all there: its bits are still
    given, so that they reach behind the payload. Nothing is given behind a union whose tag named no member.
    """
    walk = _Walk()
    walk.visit(layout, values, "", code)
    return walk.found


def fixed(layout: Type) -> bool:
    """Return whether all values of a layout have their bits at the same places: no list and no union is in it."""
    if isinstance(layout, ArrayType):
        return not layout.dynamic and fixed(layout.element)
    return isinstance(layout, PrimitiveType) or (not layout.union and all(fixed(one.type) for one in layout.fields))


class _Walk:
    def __init__(self) -> None:
        self.at = 0
        self.lost = False
        self.found: list[FieldPlace] = []

    def visit(self, kind: Type, value: Any, path: str, code: int) -> None:
        if self.lost:
            return
        if isinstance(kind, PrimitiveType):
            self._take(path, "padding" if kind.kind == "void" else "value", kind.bits, kind)
        elif isinstance(kind, ArrayType):
            self._array(kind, value, path, code)
        elif kind.union:
            self._union(kind, value, path, code)
        else:
            for member in kind.fields:
                inner = value.get(member.name) if isinstance(value, Mapping) and member.name else None
                last = member is kind.fields[-1]
                self.visit(member.type, inner, _join(path, member.name), code if last else USUAL)

    def _array(self, kind: ArrayType, value: Any, path: str, code: int) -> None:
        cells = value if isinstance(value, (list, tuple)) else []
        count, inner = kind.max, code
        if kind.dynamic:
            count = len(cells)
            own, inner = (code, USUAL) if kind.element.min_bits >= _TAIL_ELEMENT_BITS else (USUAL, code)
            if own != TAIL:
                self._take(path, "length", 8 if own == BYTE_PREFIX else kind.length_bits, None)
        for k in range(count):
            cell = cells[k] if k < len(cells) else None
            self.visit(kind.element, cell, f"{path}[{k}]", inner if k == count - 1 else USUAL)

    def _union(self, kind: CompoundType, value: Any, path: str, code: int) -> None:
        self._take(path, "tag", kind.tag_bits, None)
        cells = value if isinstance(value, Mapping) else {}
        active = next((m for m in kind.fields if cells.get(m.name) is not None), None)
        if active is None:
            self.lost = True
        else:
            self.visit(active.type, cells[active.name], _join(path, active.name), code)

    def _take(self, path: str, role: str, bits: int, kind: PrimitiveType | None) -> None:
        if bits:
            self.found.append(FieldPlace(path, role, self.at, bits, kind))
        self.at += bits


def below(found: list[FieldPlace], path: str) -> Iterator[FieldPlace]:
    """Return the places of one field, whatever is nested in it."""
    for place in found:
        if place.path == path or place.path.startswith((f"{path}.", f"{path}[")):
            yield place


def span(found: list[FieldPlace], path: str, start: int = 0) -> FieldPlace | None:
    """Return all bits of one field as one place, `start` bits further on; None if it has none."""
    own = list(below(found, path))
    if not own:
        return None
    end = own[-1].start + own[-1].bits
    return FieldPlace(path, "value", own[0].start + start, end - own[0].start, own[0].type if len(own) == 1 else None)


def raw_bits(payload: bytes, place: FieldPlace) -> int | None:
    """Return the raw unsigned number at a place, as DroneCAN orders its bits; None if the payload ends before."""
    if place.start + place.bits > len(payload) * 8:
        return None
    word = int.from_bytes(payload[place.first_byte : place.last_byte + 1], "big")
    shift = (place.last_byte + 1) * 8 - place.start - place.bits
    bits = word >> shift & (1 << place.bits) - 1
    # The low-order byte came first; what is left of a byte came last.
    whole, rest = divmod(place.bits, 8)
    value = bits & (1 << rest) - 1
    for k in range(whole):
        value = value << 8 | bits >> rest + 8 * k & 0xFF
    return value


def _join(path: str, name: str) -> str:
    return f"{path}.{name}" if path and name else path or name
