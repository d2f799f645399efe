"""A rule or a view that fails ends its own part of a session, and is told; the bus goes on being recorded."""

from __future__ import annotations

import json
import re
import threading
import time
from typing import TYPE_CHECKING, Any

import can
import pytest
from kit.command import CAPTURES, wait_until

from analyzer.app.live import list as live_list
from analyzer.app.live import run as live_run
from analyzer.rules.judge import Judge

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator
    from pathlib import Path

pytestmark = pytest.mark.usefixtures("no_can_configuration")
FRAMES = 2000
SPEED = 4  # times that of the flight


@pytest.fixture
def sending() -> Iterator[None]:
    """Frames of a flight for whoever listens on `virtual:failing`."""

    def work() -> None:
        with can.LogReader(CAPTURES / "hover-4.log") as log, can.Bus("failing", interface="virtual") as bus:
            wait_until(lambda: len(bus.channel) == 2)
            for message, _ in zip(log, range(FRAMES), strict=False):
                bus.send(message)

    thread = threading.Thread(target=work)
    thread.start()
    yield
    thread.join()


def frames_of(path: Path) -> int:
    return sum(line.startswith(b"(") for line in path.read_bytes().splitlines())


@pytest.mark.usefixtures("sending")
def test_a_rule_that_fails(command: Callable[..., Any], tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(*_: object) -> None:
        raise ZeroDivisionError("of a rule")

    monkeypatch.setattr(Judge, "feed", fail)
    status, out, err = command("live", "virtual:failing", "-q", "-c", FRAMES, "-w", tmp_path / "x.log")
    assert (status, out) == (3, "")
    assert (
        err.count("judging has ended: ZeroDivisionError: of a rule: please report this as a bug") == 2
    )  # when, and why 3
    assert frames_of(tmp_path / "x.log") == FRAMES
    assert "Traceback" not in err


@pytest.mark.usefixtures("sending")
def test_a_view_that_fails(command: Callable[..., Any], tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(*_: object) -> None:
        raise ZeroDivisionError("of a list")

    monkeypatch.setattr(live_list.TransferList, "batch", fail)
    status, _, err = command(
        "live", "virtual:failing", "--list", "-c", FRAMES, "-w", tmp_path / "x.log", "--least", "transfers=1,seconds=0"
    )
    assert status == 3
    assert "what is shown has ended: ZeroDivisionError: of a list" in err
    assert "findings" in err or "PASS" in err  # the verdict is there all the same
    assert frames_of(tmp_path / "x.log") == FRAMES


@pytest.mark.slow
def test_what_is_settled_without_new_frames_is_judged(
    command: Callable[..., Any], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A frame whose verdict comes only with the end of everything."""
    monkeypatch.setattr(live_run, "_INTERVALS", {"quiet": (0.05, 0.05)})

    def work() -> None:
        with can.Bus("late", interface="virtual") as bus:
            wait_until(lambda: len(bus.channel) == 2)
            bus.send(can.Message(arbitration_id=0x123, is_extended_id=True, data=b"\xff"))

    thread = threading.Thread(target=work)
    thread.start()
    record, live, checked = tmp_path / "x.log", tmp_path / "live.json", tmp_path / "check.json"
    command("live", "virtual:late", "-q", "-a", "duration:0.6", "-w", record, "--json", live)
    thread.join()
    command("check", record, "--json", checked)
    found = [json.loads(path.read_bytes())["findings"] for path in (live, checked)]
    assert [one["rule"] for one in found[1]] == ["CAN-018"]
    assert found[0] == found[1]


@pytest.mark.slow
def test_the_end_says_what_happened(command: Callable[..., Any], tmp_path: Path) -> None:
    """As `check` does of the recording; its page draws the flight."""
    path, page, count = tmp_path / "x.log", tmp_path / "x.html", frames_of(CAPTURES / "propeller-lost.log")

    def send() -> None:
        with (
            can.LogReader(CAPTURES / "propeller-lost.log") as log,
            can.Bus("crash", interface="virtual") as bus,
        ):
            wait_until(lambda: len(bus.channel) == 2)
            start, first = time.monotonic(), None
            for message in log:
                first = message.timestamp if first is None else first
                due = start + (message.timestamp - first) / SPEED
                while time.monotonic() < due:  # a flight takes its time
                    time.sleep(max(0.0, due - time.monotonic()))
                bus.send(message)

    thread = threading.Thread(target=send)
    thread.start()
    _, out, err = command("live", "virtual:crash", "-q", "-c", count, "-w", path, "--html", page)
    thread.join()
    lanes = re.findall(r'class="course-lane"[^>]* aria-label="([^",]*)', page.read_text())
    assert [lane for lane in lanes if lane.startswith("ch")] == [f"ch{k} node {10 + k}" for k in range(1, 5)]
    told = [line for line in out.splitlines() if line.startswith("      Triage: ")]
    assert len(told) == 1, err
    assert [line for line in command("check", path)[1].splitlines() if line.startswith("      Triage: ")] == told
    assert f"        tailbyte triage {path}\n" in out
