"""Windows: which transfers `--from --to --last --around --frames` let through, and what they need a capture to have."""

from __future__ import annotations

import time
from typing import TYPE_CHECKING

import pytest
from kit import encode
from kit.command import START, commands, log

from analyzer.cli.arguments import options
from analyzer.cli.commands import parser
from analyzer.decode.engine import Engine
from analyzer.window import selection as windows
from analyzer.window.limits import Moment, duration
from analyzer.window.selection import TransferSelection
from dissectors.times import SECOND

if TYPE_CHECKING:
    from collections.abc import Iterator

    from analyzer.decode.engine import Batch
    from dissectors import Registry

MS = 1_000_000
DAY = 86_400 * SECOND


class Flow:
    """A capture as batches of a few lines each, that says how often it was read."""

    def __init__(self, registry: Registry, text: bytes, lines: int = 10) -> None:
        self._registry, self._lines = registry, lines
        self._text = text.splitlines(keepends=True)
        self.readings = 0

    def batches(self) -> Iterator[Batch]:
        self.readings += 1
        engine = Engine(self._registry)
        for at in range(0, len(self._text), self._lines):
            yield from engine.feed(b"".join(self._text[at : at + self._lines]))
            yield engine.flush()
        yield engine.finish()


class Shown:
    """What a window given as options shows of a flow: numbers of first frames from 1, zeros, the problem."""

    def __init__(self, flow: Flow, *args: str, pipe: bool = False) -> None:
        window = options.window(parser().parse_args(["decode", "x", *args]))
        self.selection = TransferSelection(window, lambda: None if pipe else flow.batches())
        self.frames: list[int] = []
        self.zeros = set[int | None]()
        self.most_waiting = 0
        for batch, rows, zero in self.selection.apply(self._watched(flow.batches())):
            self.frames += [batch.transfers.column("frame")[row][0].as_py() + 1 for row in rows.tolist()]
            self.zeros.add(zero)

    def _watched(self, batches: Iterator[Batch]) -> Iterator[Batch]:
        for batch in batches:
            yield batch
            self.most_waiting = max(self.most_waiting, len(self.selection._waiting))

    @property
    def problem(self) -> str | None:
        return self.selection.problem


@pytest.fixture
def steady(registry: Registry) -> Flow:
    """100 transfers, one each 10 ms; frame n at (n - 1) * 10 ms."""
    return Flow(registry, log(commands(*(k * 10 * MS for k in range(100)))))


@pytest.fixture
def utc(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    monkeypatch.setenv("TZ", "UTC")
    time.tzset()
    yield
    monkeypatch.undo()
    time.tzset()


@pytest.mark.sampled(2)
@pytest.mark.parametrize(
    ("args", "first", "last"),
    [
        ([], 1, 100),
        (["--from", "0.5"], 51, 100),
        (["--from", "0.500000001"], 52, 100),
        (["--from", "500ms"], 51, 100),
        (["--to", "0.5"], 1, 51),
        (["--to", "0.499999999"], 1, 50),
        (["--from", "0.2", "--to", "0.3"], 21, 31),
        (["--from", "1773475330.2", "--to", "1773475330.3"], 21, 31),
        (["--from", "2026-03-14T08:02:10.2Z", "--to", "2026-03-14T09:02:10.3+01:00"], 21, 31),
        (["--from", "08:02:10.2", "--to", "08:02:10.3"], 21, 31),
        (["--from", "08:02"], 1, 100),
        (["--from", "99999999999999999999"], 1, 0),
        (["--last", "100ms"], 90, 100),
        (["--last", "99ms"], 91, 100),
        (["--last", "0.1"], 90, 100),
        (["--last", "1h"], 1, 100),
        (["--last", "99999999999999999999999h"], 1, 100),
        (["--around", "51±20ms"], 49, 53),
        (["--around", "51+-20ms"], 49, 53),
        (["--around", "0.5±20ms"], 49, 53),
        (["--around", "08:02:10.5±20ms"], 49, 53),
        (["--around", "1.01±30ms"], 99, 100),
        (["--around", "1"], 1, 100),
        (["--around", "100±0s"], 100, 100),
        (["--frames", "10-20"], 10, 20),
        (["--frames", "-20"], 1, 20),
        (["--frames", "90-"], 90, 100),
        (["--frames", "42"], 42, 42),
        (["--frames", "90-99999999999999999999999"], 90, 100),
        (["--frames", "200-300"], 1, 0),
        (["--frames", "10-60", "--from", "0.4", "--to", "0.8"], 41, 60),
        (["--last", "500ms", "--to", "0.6"], 50, 61),
        (["--around", "51±20ms", "--frames", "51-"], 51, 53),
    ],
)
@pytest.mark.usefixtures("utc")
def test_what_a_window_lets_through(steady: Flow, args: list[str], first: int, last: int) -> None:
    got = Shown(steady, *args)
    assert got.frames == list(range(first, last + 1))
    assert got.problem is None


def test_a_transfer_counts_with_all_its_frames(registry: Registry) -> None:
    """Three frames of one transfer: the window may end or begin between them."""
    fields = dict.fromkeys(("error_count", "voltage", "current", "temperature", "rpm", "power_rating_pct"), 0)
    sent = encode.transfer("ESCStatus", {**fields, "esc_index": 0}, 9).frames(START, 10 * MS)
    flow = Flow(registry, log(sent))
    for args in (["--to", "0.005"], ["--from", "0.015"], ["--frames", "2"], ["--frames", "3-"], ["--around", "2±1ms"]):
        assert Shown(flow, *args).frames == [1], args
    for args in (["--from", "0.021"], ["--frames", "4-"]):
        assert Shown(flow, *args).frames == [], args


def test_relative_times_count_from_the_anchor(steady: Flow) -> None:
    assert Shown(steady, "--around", "51±20ms").zeros == {START + 500 * MS}
    assert Shown(steady, "--around", "0.505±20ms").zeros == {START + 505 * MS}
    assert Shown(steady, "--from", "0.3").zeros == {START}


@pytest.mark.parametrize("args", [["--last", "300ms"], ["--around", "60±300ms"], ["--around", "0.59±300ms"]])
def test_a_wide_window_is_read_twice_rather_than_kept(
    steady: Flow, args: list[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    kept = Shown(steady, *args)
    assert steady.readings == 1
    assert len(kept.frames) >= 31
    monkeypatch.setattr(windows, "MOST_WAITING", 15)
    again = Shown(steady, *args)
    assert (again.frames, again.zeros, again.problem) == (kept.frames, kept.zeros, None)
    assert steady.readings == 3
    assert again.most_waiting <= 2
    piped = Shown(steady, *args, pipe=True)
    assert "too wide for a pipe" in (piped.problem or "")
    assert set(piped.frames) < set(kept.frames)


def test_a_narrow_window_keeps_no_more_than_it_needs(steady: Flow, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(windows, "MOST_WAITING", 40)
    got = Shown(steady, "--last", "50ms")
    assert got.frames == list(range(95, 101))
    assert got.most_waiting <= 3
    assert steady.readings == 1


def test_a_frame_that_is_not_there(steady: Flow) -> None:
    got = Shown(steady, "--around", "101")
    assert (got.frames, got.problem) == ([], "no frame 101: the capture has 100")
    assert Shown(steady, "--around", "99999999999999999999999").frames == []


@pytest.mark.parametrize("args", [["--from", "0"], ["--to", "99"], ["--last", "1s"], ["--around", "1.5"]])
def test_captures_without_times_have_no_windows_by_time(registry: Registry, args: list[str]) -> None:
    text = b"  can0  1F040601   [8]  00 00 00 00 00 00 00 C0\n" * 3
    got = Shown(Flow(registry, text), *args)
    assert got.frames == []
    assert got.problem == "without times: only --frames and -c can choose a part of it"


def test_a_frame_without_a_time_has_no_neighbours(registry: Registry) -> None:
    timeless = b"  can0  1F040601   [8]  00 00 00 00 00 00 00 C0\n"
    flow = Flow(registry, log(commands(0)) + timeless)
    assert "frame 2 has no time" in (Shown(flow, "--around", "2").problem or "")
    assert Shown(flow, "--from", "0").frames == [1]
    assert Shown(flow, "--last", "99999999999999h").frames == [1]
    assert Shown(flow, "--frames", "2").frames == [2]


@pytest.mark.parametrize("args", [["--from", "08:00"], ["--to", "1773475331"], ["--around", "2026-03-14T08:02:10"]])
def test_relative_captures_have_no_dates(registry: Registry, args: list[str]) -> None:
    text = b"".join(b" (00%d.000000)  can0  1F040601   [8]  00 00 00 00 00 00 00 C%d\n" % (k, k) for k in range(5))
    flow = Flow(registry, text)
    got = Shown(flow, *args)
    assert (got.frames, got.problem) == ([], "its times are relative: give seconds from the first frame")
    assert Shown(flow, "--from", "1.5", "--to", "3").frames == [3, 4]


@pytest.mark.usefixtures("utc")
def test_times_of_day_go_on_after_midnight(registry: Registry) -> None:
    """A flight from 23:59:00 to 00:01:00, a frame each 10 s."""
    before = 16 * 3600 * SECOND - (2 * 60 + 10) * SECOND - 60 * SECOND  # from 08:02:10 to 23:59:00
    flow = Flow(registry, log(commands(*(before + k * 10 * SECOND for k in range(13)))))
    assert Shown(flow, "--from", "23:59:50", "--to", "00:00:10").frames == [6, 7, 8]
    assert Shown(flow, "--around", "00:00:00±10s").frames == [6, 7, 8]
    assert Shown(flow, "--from", "23:30").frames == list(range(1, 14))
    assert Shown(flow, "--from", "00:00:30").frames == [10, 11, 12, 13]


@pytest.mark.parametrize(("zone", "hour"), [("UTC", "08"), ("Asia/Tokyo", "17"), ("XYZ-5", "13")])
def test_times_of_day_are_local(steady: Flow, monkeypatch: pytest.MonkeyPatch, zone: str, hour: str) -> None:
    monkeypatch.setenv("TZ", zone)
    time.tzset()
    try:
        assert Shown(steady, "--from", f"{hour}:02:10.98").frames == [99, 100]
        assert Shown(steady, "--from", f"2026-03-14T{hour}:02:10.98").frames == [99, 100]
    finally:
        monkeypatch.undo()
        time.tzset()


@pytest.mark.parametrize(
    ("text", "ns"),
    [("10", 10 * SECOND), ("10s", 10 * SECOND), ("250ms", 250 * MS), ("1.5min", 90 * SECOND), ("2 h", 7200 * SECOND),
     ("7us", 7000), ("7ns", 7), ("0.0000000019", 1), ("0", 0)],
)  # fmt: skip
def test_durations(text: str, ns: int) -> None:
    assert duration(text) == ns


@pytest.mark.parametrize("text", ["", "s", "1e9", "-1s", "1.", ".5", "1 parsec", "1s2", "±", "9" * 5000, "inf", "nan"])
def test_what_is_no_duration(text: str) -> None:
    with pytest.raises(ValueError, match="is not a duration"):
        duration(text)


@pytest.mark.parametrize(
    "text", ["", "-5", "noon", "25:00", "12:60", "2026-13-01", "12:00Z", "12:00+02:00", "0001-01-01T00:00", "\0", "1e3"]
)
def test_what_is_no_time(text: str) -> None:
    with pytest.raises(ValueError, match="is not a time"):
        Moment.parse(text)


def test_a_day_with_a_clock_change_keeps_its_hours(monkeypatch: pytest.MonkeyPatch) -> None:
    """Central Europe, 2026-03-29: 02:00 becomes 03:00, so 04:00 is 3 h behind midnight."""
    monkeypatch.setenv("TZ", "CET-1CEST,M3.5.0,M10.5.0/3")
    time.tzset()
    try:
        midnight = 1_774_738_800 * SECOND  # 2026-03-28 23:00 UTC
        assert Moment.parse("04:00").at(midnight + 60 * SECOND) == midnight + 3 * 3600 * SECOND
    finally:
        monkeypatch.undo()
        time.tzset()
