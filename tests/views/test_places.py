"""Every bit of a payload has one place, and reading a place gives the value back."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from kit import VECTORS, encode
from kit.strategies import MESSAGES, SERVICES, examples, fields_of

from analyzer.views.places import FieldPlace, fixed, places, raw_bits, span
from analyzer.views.rows import TransferRows
from dissectors.schema import ArrayType, CompoundType, Member, PrimitiveType

if TYPE_CHECKING:
    from collections.abc import Callable

    from dissectors import Registry

NAMES = [*MESSAGES, *(f"{name}.{half}" for name in SERVICES for half in ("Request", "Response"))]
BYTE, PAIR = PrimitiveType("uint", 8), PrimitiveType("uint", 2)


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
        rows = TransferRows(batch, registry)
        for part in rows.typed:
            layout = part.of.layout
            for at, row in zip(part.at, part.table.to_pylist(), strict=True):
                payload = rows.column("payload")[at]
                found = places(layout, row, row["layout"])
                assert covered(found) + row["bits_left"] == 8 * len(payload), part.name
                for place in (p for p in found if p.role == "value"):
                    values += 1
                    value, note = leaf(row, place.path), part.of.notes.get(place.path)
                    if note is not None and note.scale is not None:
                        value = round(value / note.scale)
                    assert read_back(payload, place) == same_kind(value), (part.name, place)
    return values


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


@pytest.mark.parametrize(
    ("layout", "known"),
    [
        (
            CompoundType("a", (Member("x", PAIR), Member("", BYTE), Member("y", ArrayType(BYTE, 3, dynamic=False)))),
            True,
        ),
        (CompoundType("a", (Member("x", ArrayType(BYTE, 3, dynamic=True)),)), False),
        (CompoundType("a", (Member("x", BYTE), Member("y", PAIR)), union=True), False),
        (ArrayType(CompoundType("a", (Member("x", PAIR), Member("y", BYTE)), union=True), 2, dynamic=False), False),
    ],
)
def test_places_that_are_the_same_for_every_row(layout: CompoundType, known: bool) -> None:
    assert fixed(layout) == known
    if known:
        assert places(layout, None, 0) == places(layout, {"x": 1, "y": [1, 2, 3]}, 2)
