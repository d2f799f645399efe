"""`tailbyte replay`: what arrives is what the capture holds, at its times."""

from __future__ import annotations

import sys
import threading
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

import can
import pytest
from cli.test_progress import Terminal
from kit.command import HOVER, LIMIT
from kit.libraries import WRITERS, library_file
from kit.live import Arrival, got
from kit.rows import EXTENDED, FD, REMOTE, Fault, Frame, records, text
from kit.waiting import SECOND, START, Clock, frames, log, replays_wait_by, standard_input

from analyzer.cli import reading
from analyzer.cli.progress import Progress
from analyzer.live.replay import outlet

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable

    Command = Callable[..., tuple[int, str, str]]

pytestmark = pytest.mark.usefixtures("no_can_configuration", "clock")


@pytest.fixture(autouse=True)
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.fixture
def clock(monkeypatch: pytest.MonkeyPatch) -> Clock:
    return replays_wait_by(Clock(), monkeypatch)


def held(found: Iterable[Frame | Fault]) -> list[Arrival]:
    """What of it can arrive."""
    return [
        (f.id, bool(f.flags & EXTENDED), bool(f.flags & REMOTE), f.data) for f in found if isinstance(f, Frame)
    ]  # fmt: skip


@pytest.mark.parametrize(
    "way",
    [
        ["virtual:here"],
        ["-i", "virtual:here"],
        ["--interface", "virtual", "--channel", "here"],
        ["here", "--interface", "virtual"],
    ],
)
def test_what_arrives_is_what_the_capture_holds(command: Command, receiver: can.BusABC, way: list[str]) -> None:
    wanted = held(records(text(HOVER.read_bytes())))
    status, out, err = command("replay", HOVER, *way)
    assert (status, out) == (0, "")
    name = way[0] if way[0] != "here" else "virtual:here"
    shown = name if name.startswith("virtual") else "virtual:here"
    assert err == f"-- 1,868 frames, 2.0 s sent on {shown}; 1868 lines = 1868 frames\n"
    assert got(receiver) == wanted


@pytest.mark.sampled(2)
@pytest.mark.parametrize("suffix", [".candump", ".log.gz", ".mcap", ".pcapng", *WRITERS])
def test_captures_of_every_format(command: Command, receiver: can.BusABC, suffix: str) -> None:
    found = [f for f in records(text(HOVER.read_bytes())) if isinstance(f, Frame)][:300]
    name = f"x{suffix}"
    if suffix in WRITERS:
        Path(name).write_bytes(library_file(suffix, found))
    else:
        assert command("convert", log("x.log", found), name)[0] == 0
    assert command("replay", name, "virtual:here")[0] == 0
    assert got(receiver) == held(found)


def test_times_are_those_of_the_capture(command: Command, clock: Clock, monkeypatch: pytest.MonkeyPatch) -> None:
    """By the clock of the sender; the first frame takes as long as a bus needs for it."""
    clock.over = 50_000
    begin, seen = clock.passed, list[int]()
    send = outlet.Outlet.send
    monkeypatch.setattr(outlet.Outlet, "send", lambda *a, **k: seen.append(clock.passed - begin) or send(*a, **k))
    found = [f for f in records(text(HOVER.read_bytes())) if isinstance(f, Frame) and f.t is not None]
    for speed, factor in (("1", 1), ("0.5", 2)):
        seen.clear()
        begin = clock.passed
        assert command("replay", HOVER, "virtual:x", "--speed", speed)[0] == 0
        late = [at - (f.t - found[0].t) * factor for at, f in zip(seen, found, strict=True)]  # type: ignore[operator]
        assert all(0 <= each <= 200_000 for each in late)
        assert max(late[-100:]) <= 50_000 + 131_000
    begin = clock.passed
    assert command("replay", HOVER, "virtual:x", "--speed", "100")[0] == 0
    assert clock.passed - begin == pytest.approx(2 * SECOND / 100, rel=0.01)


def test_as_fast_as_it_goes(command: Command, receiver: can.BusABC, clock: Clock) -> None:
    for speed in ("max", "0"):
        assert command("replay", HOVER, "virtual:here", "--speed", speed)[0] == 0
        assert len(got(receiver)) == 1868
    assert clock.slept == []


def test_frames_of_a_pipe_go_on_as_they_come(command: Command, receiver: can.BusABC) -> None:
    lines = Path(log("x.log", frames(1, 2, 3))).read_bytes().splitlines(keepends=True)
    arrived = []

    def feed() -> None:
        for line in lines:
            pipe.write(line)
            message = receiver.recv(LIMIT)
            arrived.append(message and message.arbitration_id)
        pipe.close()

    with standard_input() as pipe:
        feeder = threading.Thread(target=feed)
        feeder.start()
        status, _, err = command("replay", "-", "virtual:here")
        feeder.join()
    assert (status, err) == (0, "-- 3 frames, 0.0 s sent on virtual:here; 3 lines = 3 frames\n")
    assert arrived == [1, 2, 3]
    with standard_input() as pipe:
        said = "tailbyte replay: - can be read only once: --loop needs a file\n"
        assert command("replay", "-", "virtual:here", "--loop", "2") == (2, "", said)


@pytest.mark.slow
def test_windows_filters_and_counts(command: Command, receiver: can.BusABC) -> None:
    found = frames(*range(0x100, 0x164), flags=0)
    capture = log("x.log", found)
    for options, wanted in (
        (("--frames", "11-20"), range(10, 20)),
        (("--from", "0.05", "--to", "0.059"), range(50, 60)),
        (("--last", "9ms"), range(90, 100)),
        (("-f", "110:7FC"), range(16, 20)),
        (("-f", "110:7FC,102:7FF"), (2, *range(16, 20))),
        (("-f", "100~700", "-f", "150:7F0", "--frames", "-82"), (80, 81)),
        (("-c", "7"), range(7)),
        (("--frames", "1-3", "--loop", "3"), (0, 1, 2) * 3),
        (("--frames", "1-3", "--loop", "inf", "-c", "7"), (0, 1, 2, 0, 1, 2, 0)),
    ):
        status, _, err = command("replay", capture, "virtual:here", *options)
        assert status == 0, err
        assert [number - 0x100 for number, *_ in got(receiver)] == [*wanted]
        assert err.startswith(f"-- {len([*wanted])} frames, ")
        assert err.endswith("; 100 lines = 100 frames\n")


def test_maps(command: Command, receiver: can.BusABC) -> None:
    found = [f for pair in zip(frames(1, 2), frames(3, 4, bus="can1"), strict=True) for f in pair]
    capture = log("x.log", found)
    with can.Bus("there", interface="virtual", ignore_config=True) as other:
        status, _, err = command("replay", capture, "virtual:here=can1", "virtual:there=can0")
        assert (status, err) == (
            0, "-- 4 frames, 0.0 s sent on virtual:here (2) and virtual:there (2); 4 lines = 4 frames\n"
        )  # fmt: skip
        assert [[number for number, *_ in got(bus)] for bus in (receiver, other)] == [[3, 4], [1, 2]]
        assert command("replay", "-i", "virtual:here=can0", "virtual:here=can1", "virtual:there=can1", capture)[0] == 0
        assert [[number for number, *_ in got(bus)] for bus in (receiver, other)] == [[1, 3, 2, 4], [3, 4]]
        status, _, err = command("replay", capture, "virtual:here=can1")
        assert err.splitlines()[1] == "-- not sent: frames of can0, which no map names (2)"
        assert [number for number, *_ in got(receiver)] == [3, 4]
        for way, reason in (
            (["virtual:here"], "several buses (can0, can1, ...): name what goes where, as in vcan0=can0"),
            (["virtual:here=can2"], "no frames of can2 (there is can0, can1)"),
        ):
            assert command("replay", capture, *way) == (2, "", f"tailbyte: {capture}: {reason}\n")
            assert got(receiver) == []
        assert command("replay", capture, "virtual:here", "--frames", "2")[0] == 0
        assert [number for number, *_ in got(receiver)] == [3]


def test_can_fd_goes_where_it_is_taken(command: Command, receiver: can.BusABC, monkeypatch: pytest.MonkeyPatch) -> None:
    capture = log("x.log", [Frame(START, data=bytes(64), flags=FD), Frame(START, data=b"x")])
    assert command("replay", capture, "virtual:here")[0] == 0
    assert [len(data) for *_, data in got(receiver)] == [64, 1]
    monkeypatch.setattr(outlet, "_takes_fd", lambda *_: False)
    status, _, err = command("replay", capture, "virtual:here")
    assert (status, [len(data) for *_, data in got(receiver)]) == (0, [1])
    assert err.splitlines()[1:] == ["-- not sent: CAN FD frames (1)"]
    status, _, err = command("replay", capture, "virtual:here", "--frames", "1")
    assert (status, err.splitlines()[-1]) == (2, "tailbyte: x.log: nothing of it was sent")


def test_times_that_are_missing_or_run_backwards(command: Command, receiver: can.BusABC) -> None:
    Path("x.log").write_text(
        "(1700000000.000000) can0 001#\n(1700000005.000000) can0 002#\n"
        "(1699999000.000000) can0 003#\n(1699999001.000000) can0 004#\n"
    )
    status, _, err = command("replay", "x.log", "virtual:here")
    assert (status, [number for number, *_ in got(receiver)]) == (0, [1, 2, 3, 4])
    assert err.splitlines() == [
        "-- 4 frames, 6.0 s sent on virtual:here; 4 lines = 4 frames",
        "-- with a time before that of the one before, sent right behind it: 1",
    ]
    assert command("convert", log("y.log", [Frame(None, id=7), Frame(None, id=8)]), "y.pcapng")[0] == 0
    status, _, err = command("replay", log("y.log", [Frame(None, id=7), Frame(None, id=8)]), "virtual:here")
    assert [number for number, *_ in got(receiver)] == [7, 8]
    assert (status, err.splitlines()[-1]) == (0, "-- without a time, sent right behind the one before: 2")


def test_silences(command: Command, clock: Clock) -> None:
    capture = log("x.log", frames(1, 2, 3, step=3600 * SECOND))
    begin = clock.passed
    status, _, err = command("replay", capture, "virtual:x")
    assert (status, clock.passed - begin) == (0, 7200 * SECOND)
    assert err.splitlines()[0] == "tailbyte: a silence of 3,600 s is kept (--max-gap 5s shortens it)"
    begin = clock.passed
    status, _, err = command("replay", capture, "virtual:x", "--max-gap", "5s", "--speed", "5")
    assert (status, clock.passed - begin) == (0, 2 * SECOND)
    assert err == "-- 3 frames, 10.0 s sent on virtual:x; 3 lines = 3 frames\n"


@pytest.mark.parametrize(
    ("options", "drawn"),
    [
        (("--speed", "2"), " 40% [############..................] 2.0 x real time  0:06 left"),
        (("--loop", "inf", "-c", "5"), "2 frames  0:06"),
    ],
)
def test_progress_shows_in_silences_too(
    command: Command, clock: Clock, monkeypatch: pytest.MonkeyPatch, options: tuple[str, ...], drawn: str
) -> None:
    capture = log(
        "x.log", frames(1, 2, 3, 4, 5, step=6 * SECOND) if "-c" in options else frames(*range(11), step=2 * SECOND)
    )
    terminal = Terminal()
    monkeypatch.setenv("TERM", "xterm")
    monkeypatch.setattr(sys, "stderr", terminal)
    monkeypatch.setattr(reading, "Progress", partial(Progress, clock=lambda: clock.passed / SECOND))
    assert command("replay", capture, "virtual:x", *options)[0] == 0
    lines = terminal.text.split("\r\x1b[K")
    assert any(line.startswith(drawn) for line in lines), lines
    assert len(lines) > 50
    assert lines[-1].startswith("-- ")
