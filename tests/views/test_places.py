"""Every bit of a payload has one place, reading it gives the value back, and details name it: by a walk of its own."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from kit import VECTORS, encode
from kit.strategies import MESSAGES, SERVICES, examples, fields_of

from analyzer.views.details.tree import Tree
from analyzer.views.rows import TransferRows
from analyzer.views.times import TimeFormat
from dissectors.schema import ArrayType, CompoundType, Member, PrimitiveType

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from dissectors import Registry
    from dissectors.schema import Type

NAMES = [*MESSAGES, *(f"{name}.{half}" for name in SERVICES for half in ("Request", "Response"))]
TAIL, USUAL, BYTE_PREFIX = 0, 1, 2
TAIL_ELEMENT_BITS = 8
BYTE, PAIR = PrimitiveType("uint", 8), PrimitiveType("uint", 2)


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
            own, inner = (code, USUAL) if kind.element.min_bits >= TAIL_ELEMENT_BITS else (USUAL, code)
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


def covered(found: list[FieldPlace]) -> int:
    """Number of bits, after checking that they are in order, each once."""
    at = 0
    for place in found:
        assert (place.start, place.bits > 0) == (at, True)
        at += place.bits
    return at


def leaf(value: Any, path: str) -> Any:
    for step in path.replace("[", ".[").split("."):
        value = value[int(step[1:-1])] if step.startswith("[") else value[step]
    return value


def check(got: Any, registry: Registry) -> int:
    """Checks every message row of a decoded capture; gives the number of values read back."""
    values = 0
    for batch in got.batches:
        rows, details = TransferRows(batch, registry), list(Tree(registry, TimeFormat()).texts(batch))
        for part in rows.typed:
            layout = part.of.layout
            for at, row in zip(part.at, part.table.to_pylist(), strict=True):
                payload = rows.column("payload")[at]
                found = places(layout, row, row["layout"])
                named(details[at], part.of, row, found)
                assert covered(found) + row["bits_left"] == 8 * len(payload), part.name
                for place in (p for p in found if p.role == "value"):
                    values += 1
                    value, note = leaf(row, place.path), part.of.notes.get(place.path)
                    if note is not None and note.scale is not None:
                        value = round(value / note.scale)
                    assert read_back(payload, place) == same_kind(value), (part.name, place)
    return values


def named(details: str, of: Any, row: dict[str, Any], found: list[FieldPlace]) -> None:
    """Checks that details give every field that is there its bytes and bits."""
    lines = details.splitlines()
    for member in (m for m in of.layout.fields if m.name and row.get(m.name) is not None):
        place = span(found, member.name)
        own = re.compile(rf" {{8}}(\w+ \({member.name}\)|{member.name})(:|  |$)")
        (line,) = [line for line in lines if own.match(line)]
        if place is not None:
            assert f"  {place.words()}  " in f"{line}  ", member.name


def read_back(payload: bytes, place: FieldPlace) -> Any:
    raw = raw_bits(payload, place)
    kind = place.type
    assert raw is not None
    if kind.kind == "float":
        code = {16: "<e", 32: "<f", 64: "<d"}[kind.bits]
        return np.frombuffer(raw.to_bytes(kind.bits // 8, "little"), code).astype(np.float64).tobytes()
    return raw - (1 << kind.bits) if kind.kind == "int" and raw >> kind.bits - 1 else raw


def same_kind(value: Any) -> Any:
    """Floats by their bits, so that -0.0 is not 0.0."""
    if not isinstance(value, float):
        return value
    return NAN if np.isnan(value) else np.float64(value).tobytes()


class _Nan:
    """Equal to any NaN, whatever its payload."""

    def __eq__(self, other: object) -> bool:
        return isinstance(other, bytes) and bool(np.isnan(np.frombuffer(other, np.float64)[0]))

    __hash__ = None


NAN = _Nan()


@pytest.mark.parametrize("name", ["tm_golden", "tm_golden_fd", "neighbours"])
def test_golden_payloads_are_covered_bit_by_bit(decode: Callable[..., Any], registry: Registry, name: str) -> None:
    assert check(decode((VECTORS / f"{name}.log").read_bytes()), registry) > 20


@examples(60)
@given(data=st.data())
def test_any_message_is_covered_bit_by_bit(decode: Callable[..., Any], registry: Registry, data: st.DataObject) -> None:
    name = data.draw(st.sampled_from(NAMES))
    fields, fd = data.draw(fields_of(name)), data.draw(st.booleans())
    more = {"dst": 9} if encode.TYPES[name].kind != "message" else {}
    frames = encode.transfer(name, fields, 10, fd=fd, **more).frames(1_700_000_000 * 10**9)
    got = decode("".join(encode.log_line(f) + "\n" for f in frames).encode())
    assert [row["status"] for row in got.transfers] == ["ok"]
    check(got, registry)


def test_lengths_follow_the_layout_code() -> None:
    layout = CompoundType("t", (Member("head", BYTE), Member("data", ArrayType(BYTE, 100, dynamic=True))))
    row = {"head": 1, "data": [7, 8]}
    shapes = {code: [(p.path, p.role, p.start, p.bits) for p in places(layout, row, code)] for code in (0, 1, 2)}
    head, cells = ("head", "value", 0, 8), ["data[0]", "data[1]"]
    assert shapes[0] == [head, *((path, "value", 8 + 8 * k, 8) for k, path in enumerate(cells))]
    assert shapes[1] == [head, ("data", "length", 8, 7), *((p, "value", 15 + 8 * k, 8) for k, p in enumerate(cells))]
    assert shapes[2] == [head, ("data", "length", 8, 8), *((p, "value", 16 + 8 * k, 8) for k, p in enumerate(cells))]


def test_short_elements_keep_their_length_at_the_tail() -> None:
    layout = CompoundType("t", (Member("data", ArrayType(PAIR, 3, dynamic=True)),))
    assert [p.role for p in places(layout, {"data": [1]}, 0)] == ["length", "value"]


def test_unions_padding_and_missing_values() -> None:
    union = CompoundType(
        "u", (Member("small", PAIR), Member("large", BYTE), Member("none", CompoundType("e", ()))), union=True
    )
    layout = CompoundType("t", (Member("", PrimitiveType("void", 3)), Member("u", union), Member("after", BYTE)))
    found = places(layout, {"u": {"small": None, "large": 5, "none": None}, "after": None})
    assert [(p.path, p.role, p.bits) for p in found] == [
        ("", "padding", 3), ("u", "tag", 2), ("u.large", "value", 8), ("after", "value", 8),
    ]  # fmt: skip
    # A tag without member: nothing behind it has a known place.
    lost = places(layout, {"u": dict.fromkeys(("small", "large", "none")), "after": None})
    assert [p.role for p in lost] == ["padding", "tag"]


def test_byte_and_bit_numbers_are_those_of_the_document() -> None:
    assert FieldPlace("", "value", 0, 32).words() == "bytes 1-4"
    assert FieldPlace("", "value", 32, 8).words() == "byte 5"
    assert FieldPlace("", "value", 80, 18).words() == "byte 11 bit 7 to byte 13 bit 6"
    assert FieldPlace("", "value", 105, 5).words() == "byte 14 bits 6-2"
    assert FieldPlace("", "value", 7, 1).words() == "byte 1 bit 0"


def test_span_joins_what_is_nested() -> None:
    found = [FieldPlace("a", "length", 3, 5), FieldPlace("a[0].x", "value", 8, 4), FieldPlace("ab", "value", 12, 4)]
    assert span(found, "a", 8) == FieldPlace("a", "value", 11, 9)
    assert span(found, "c") is None


def test_a_place_behind_the_payload_has_no_value() -> None:
    assert raw_bits(b"\x01", FieldPlace("", "value", 4, 8)) is None
    assert raw_bits(b"", FieldPlace("", "value", 0, 1)) is None
