"""Laws of the MCAP reader on files of random structure: cut anywhere it is the same file, damage costs what it hits."""

from __future__ import annotations

import struct
from itertools import pairwise
from typing import Any

from hypothesis import given
from hypothesis import strategies as st
from kit.mcaps import COMPRESSIONS, LAYOUTS, Builder, Frame, Got, Layout, from_pieces
from kit.strategies import examples

OTHER = Layout(
    "x/msg/Speed", "ros2msg", b"float64 speed", "cdr", lambda frame: b"\0\1\0\0" + struct.pack("<q", frame.t)
)
KINDS = {name: layout for name, layout in LAYOUTS.items() if name != "idl"} | {"other": OTHER}

frame = st.builds(
    Frame,
    st.integers(1, 2**31 * 10**9 - 1),
    st.integers(0x800, 0x1FFF_FFFF),
    st.binary(max_size=8),
    st.sampled_from(["can0", "can1", "vcan-7"]),
)
step = st.one_of(
    st.tuples(
        st.just("add"), st.sampled_from(["/a", "/b/can_x", "/c/to_can_bus"]), st.sampled_from(list(KINDS)), frame
    ),
    st.tuples(st.just("flush")),
    st.tuples(st.just("attach"), st.binary(max_size=300)),
    st.tuples(st.just("meta"), st.text(max_size=9)),
)


@st.composite
def files(draw: st.DrawFn, **fixed: Any) -> tuple[bytes, list[Frame]]:
    """A file, and the rows that it holds."""
    builder = Builder(
        draw(st.sampled_from(list(COMPRESSIONS))),
        fixed.get("chunked", draw(st.booleans())),
        draw(st.integers(50, 2000)),
        {"enable_data_crcs": draw(st.booleans()), "enable_crcs": fixed.get("crcs", draw(st.booleans()))},
    )
    rows = []
    for kind, *what in draw(st.lists(step, max_size=40)):
        if kind == "add":
            topic, name, row = what
            builder.add(topic, KINDS[name], row)
            if name != "other":
                sent = 64 if topic.endswith("to_can_bus") else 0
                rows.append(Frame(row.t, row.id, row.data, row.bus, row.flags | sent))
        elif kind == "flush":
            builder.writer.flush()
        elif kind == "attach":
            builder.writer.add_attachment(0, 0, "name", "type", what[0])
        else:
            builder.writer.add_metadata(what[0], {"key": what[0]})
    return builder.bytes(), rows


def pieces(data: bytes, cuts: list[int]) -> list[bytes]:
    places = sorted({0, len(data), *(cut % (len(data) + 1) for cut in cuts)})
    return [data[start:end] for start, end in pairwise(places)]


CUTS = st.lists(st.integers(0, 1 << 20), max_size=30)


def same(one: Got, other: Got) -> bool:
    return (one.frames, one.texts, one.lines, one.damage) == (other.frames, other.texts, other.lines, other.damage)


@examples(60)
@given(files(), CUTS)
def test_every_message_is_a_row_however_the_bytes_are_cut(made: tuple[bytes, list[Frame]], cuts: list[int]) -> None:
    data, rows = made
    whole = from_pieces([data])
    assert (whole.frames, whole.told) == (rows, False)
    assert same(from_pieces(pieces(data, cuts)), whole)


@examples(60)
@given(files(), st.integers(8, 1 << 20), CUTS)
def test_what_stands_before_the_end_is_delivered(made: tuple[bytes, list[Frame]], size: int, cuts: list[int]) -> None:
    data, rows = made
    data = data[: min(size, len(data) - 1)]
    got = from_pieces([data])
    assert got.frames == rows[: len(got.frames)]
    assert got.damage.startswith(f"byte {len(data)}: MCAP data ends early")
    assert same(from_pieces(pieces(data, cuts)), got)


@examples(100)
@given(
    files(), st.lists(st.tuples(st.integers(8, 1 << 20), st.binary(max_size=12), st.integers(0, 12)), max_size=4), CUTS
)
def test_any_damage_is_survived(
    made: tuple[bytes, list[Frame]], edits: list[tuple[int, bytes, int]], cuts: list[int]
) -> None:
    """Bytes put in, taken out or changed: no exception, and the same however the bytes are cut."""
    data = made[0]
    for at, new, old in edits:
        at = 8 + at % (len(data) - 7)  # noqa: PLW2901
        data = data[:at] + new + data[at + old :]
    whole = from_pieces([data])
    assert same(from_pieces(pieces(data, cuts)), whole)
