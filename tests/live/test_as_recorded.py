"""The form of a recording, made of columns, is row by row what the text of a recording gives when it is read."""

from __future__ import annotations

from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st
from kit.live import START, Lost, Note, Row, cut, made, sessions
from kit.rows import BRS, ESI, EXTENDED, FD, REMOTE, RX, TX, Frame
from kit.strategies import examples

from analyzer._native import AsRecorded, FrameBatch, Reader, Rows, Writer

TIMES = st.sampled_from([None, -1, -START, 0, 1, 10**17, START, (1 << 63) - 1])
# What means nothing beside something else, as no reader gives it.
ODD = st.sampled_from([0, TX | RX, BRS | ESI, FD | REMOTE, REMOTE | BRS, 4, EXTENDED | TX | RX])


def all_of(batch: FrameBatch) -> tuple[object, ...]:
    return *batch.columns(), batch.lines, batch.buses, batch.stamps


def same(batches: list[FrameBatch]) -> AsRecorded:
    """Compare both ways, batch by batch."""
    direct, writer, reader = AsRecorded(), Writer("candump", recording=True), Reader("candump")
    for batch in batches:
        reader.feed(writer.write(batch))
        assert all_of(direct.apply(batch)) == all_of(reader.take())
    assert direct.lost == writer.lost
    return direct


@st.composite
def rows(draw: st.DrawFn) -> list[Row]:
    """Draw a session whose rows have any time, and whose frames have flags that do not go together."""
    found: list[Row] = []
    for row in draw(sessions()):
        odd = replace(row, t=draw(TIMES)) if draw(st.booleans()) else row
        if isinstance(odd, Frame) and draw(st.booleans()):
            odd = replace(odd, flags=odd.flags | draw(ODD), code=draw(st.integers(0, 15)))
        found.append(odd)
    return found


@pytest.mark.slow
@examples(400)
@given(rows(), st.lists(st.integers(0, 25), max_size=3))
def test_a_recording_gives_back_the_same_rows(found: list[Row], cuts: list[int]) -> None:
    same(cut(found, cuts))


def test_lines_of_drop_counts_and_comments() -> None:
    """A comment may look as if it had a time, be too long for a line, or have colours."""
    texts = [
        "# (1700000000.123456789) x",
        "(1700000000.123456789) x",
        "; y",
        "\x1b[31mred",
        "\tz",
        "x" * 70_000,
        " ",
        "",
    ]
    notes: list[Row] = [Note(t, text) for text in texts for t in (None, START)]
    lost: list[Row] = [Lost(t, bus, 3) for bus in ("can0", "any", "a'b") for t in (None, -1, START)]
    direct = same([made(notes), made(lost), made([*lost, *notes])])
    assert direct.lost == {"interface names, changed to fit": 2, "times before 1970": 6}


def test_what_is_unreadable_is_left_out() -> None:
    odd = Rows()
    odd.frame(START, "can0", 1, 0, b"")
    odd.unreadable("no frame")
    odd.frame(START, "can1", 2, RX, b"")
    (batch,) = (odd.take(),)
    assert batch.lines["unreadable"] == 1
    same([batch])


def test_a_capture_of_many_buses() -> None:
    """Buses are numbered as they appear, and names that are made to fit stay different."""
    names = [f"{'n' * 62}{number}" for number in range(100, 140)] + [" ", "  ", "\n"]
    same(cut([Frame(START, name, 1) for name in reversed(names)], [20], names))
