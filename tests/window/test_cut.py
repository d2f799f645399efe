"""Windows over what is not decoded, against a plain reading of the text; and picking rows of a piece."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from kit.command import CAPTURES

from analyzer._native import Reader
from analyzer.decode.core import LINES, Totals
from analyzer.sources.native import WORTH, rows
from analyzer.tables import EVENTS, raw_times
from analyzer.window.cut import FrameSelection, frame_tables
from analyzer.window.limits import Moment, Window

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator

    from analyzer._native import FrameBatch

TEXT = (CAPTURES / "faults.log").read_bytes()
START = Moment.parse("0")


def pieces(size: int) -> Iterator[FrameBatch]:
    reader = Reader("candump")
    for at in range(0, len(TEXT), size):
        reader.feed(TEXT[at : at + size])
        yield reader.take()
    reader.finish()
    yield reader.take()


def table(given: Iterable[FrameBatch]) -> tuple[list[tuple[Any, ...]], list[tuple[Any, ...]]]:
    """Frames (line, time, id, data) and events (line, kind, data, text); their counts add up."""
    frames: list[tuple[Any, ...]] = []
    events: list[tuple[Any, ...]] = []
    lines = dict.fromkeys(LINES, 0)
    for item in frame_tables(given):
        f, e = item.frames, item.events
        frames += zip(f["line"].to_pylist(), raw_times(f["t"]), f["id"].to_pylist(), f["data"].to_pylist(), strict=True)
        events += zip(*(e[name].to_pylist() for name in ("line", "kind", "data", "text")), strict=True)
        for name in LINES:
            lines[name] += item.batch.lines[name]
    assert Totals(lines).balanced
    assert (lines["frames"], len(events)) == (len(frames), sum(lines.values()) - lines["lines"] - len(frames))
    return frames, events


FRAMES, ALL_EVENTS = table(pieces(len(TEXT)))
FIRST, LAST = FRAMES[0][1], FRAMES[-1][1]


def before(event: tuple[Any, ...]) -> int:
    """Frames in front of an event."""
    return sum(line < event[0] for line, *_ in FRAMES)


@pytest.mark.sampled(2)
@pytest.mark.parametrize("size", [300, 5000, len(TEXT)])
@pytest.mark.parametrize(
    ("window", "low", "high"),
    [
        (Window(), FIRST, LAST),
        (Window(start=Moment.parse("1.5")), FIRST + 1_500_000_000, LAST),
        (Window(stop=Moment.parse("1.5")), FIRST, FIRST + 1_500_000_000),
        (Window(start=Moment.parse("0.5"), stop=Moment.parse("0.6")), FIRST + 500_000_000, FIRST + 600_000_000),
        (Window(last=250_000_000), LAST - 250_000_000, LAST),
        (Window(around=453, margin=8_000_000), FRAMES[452][1] - 8_000_000, FRAMES[452][1] + 8_000_000),
        (Window(around=Moment.parse("2"), margin=1000), FIRST + 1_999_999_000, FIRST + 2_000_001_000),
    ],
)
def test_windows_of_time(window: Window, low: int, high: int, size: int) -> None:
    selection = FrameSelection(window, lambda: pieces(size))
    frames, events = table(selection.cut(pieces(size)))
    assert selection.problem is None
    assert frames == [row for row in FRAMES if low <= row[1] <= high]
    for event in ALL_EVENTS:
        at = before(event)
        clear = [FRAMES[n][1] for n in (at - 1, at) if 0 <= n < len(FRAMES)]
        if all(low <= t <= high for t in clear):
            assert event in events
        elif not any(low <= t <= high for t in clear):
            assert event not in events


@pytest.mark.sampled(2)
@pytest.mark.parametrize("size", [300, len(TEXT)])
@pytest.mark.parametrize(("first", "last"), [(1, 1), (10, 500), (452, 454), (1966, 5000), (1, 10**12)])
def test_windows_of_numbers(first: int, last: int, size: int) -> None:
    frames, events = table(FrameSelection(Window(frames=(first, last))).cut(pieces(size)))
    assert frames == FRAMES[first - 1 : last]
    assert events == [event for event in ALL_EVENTS if first <= before(event) + 1 <= last]


def test_an_event_without_a_time_belongs_to_the_frame_before() -> None:
    """Or to the first one, if it stands in front of all."""
    reader = Reader("candump")
    reader.feed(b"# a\n(1.000000) can0 123#00\n# b\n(2.000000) can0 123#01\n# c\n(3.000000) can0 123#02\n# d\n")
    reader.finish()
    whole = reader.take()
    for low, high, numbers, texts in (("0.5", "1.5", [4], "c"), ("0", "1", [2, 4], "abc"), ("1", "2", [4, 6], "cd")):
        window = Window(start=Moment.parse(low), stop=Moment.parse(high))
        frames, events = table(FrameSelection(window).cut([whole]))
        assert [line for line, *_ in frames] == numbers
        assert "".join(text[-1] for *_, text in events) == texts


def test_a_capture_that_can_be_read_once_may_be_too_long(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("analyzer.window.selection.MOST_WAITING", 500)
    selection = FrameSelection(Window(last=3_000_000_000))
    assert list(selection.cut(pieces(300))) == []
    assert selection.problem == "the window is too wide for a pipe: save the capture to a file first"


@pytest.mark.parametrize("size", [100, 4096])
def test_what_a_pipe_gives_little_by_little_is_gathered(size: int) -> None:
    chunks = [TEXT[at : at + size] for at in range(0, len(TEXT), size)] * 20
    got = list(rows(iter(chunks)))
    assert all(isinstance(piece, bytes) or piece.frames >= WORTH - 300 for piece in got[:-1])
    assert sum(piece.frames for piece in got) == 20 * len(FRAMES)
    # Whenever nothing new has come, nothing waits any longer.
    got = list(rows(iter([*chunks[:3], b"", chunks[3], b""])))
    assert [piece if isinstance(piece, bytes) else piece.frames > 0 for piece in got[:-1]] == [True, b"", True, b""]


def test_picking_rows() -> None:
    whole = next(iter(pieces(len(TEXT))))
    picked = whole.pick(np.array([5, 3, 3, 10**6], np.uint32).tobytes(), np.array([1, 0], np.uint32).tobytes())
    frames, events = table([picked])
    assert frames == [FRAMES[5], FRAMES[3], FRAMES[3]]
    assert events == [ALL_EVENTS[1], ALL_EVENTS[0]]
    assert (picked.buses, picked.stamps, picked.lines["lines"]) == (whole.buses, whole.stamps, 5)
    kinds = {EVENTS[kind] for _, kind, *_ in ALL_EVENTS}
    assert kinds >= {"error frame", "unreadable"}
    with pytest.raises(ValueError, match="Slop"):
        whole.pick(b"abc", b"")
