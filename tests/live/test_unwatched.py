"""Sessions that nobody watches: the state in a file, a command for findings, a line a day, memory that levels off."""

from __future__ import annotations

import json
import sys
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from kit.command import LIMIT, wait_until
from kit.reports import START, change
from kit.waiting import Clock
from live.test_autostop import RULES

from analyzer.app.live import hook, status_file
from analyzer.app.live.hook import FindingHook, parse_command
from analyzer.app.live.status import DAY, Status
from analyzer.app.live.status_file import StatusFile
from analyzer.board.snapshot import RecordingState
from analyzer.live.interfaces.hub import InterfaceCounts
from analyzer.rules import drops, events
from analyzer.rules.drops import Drops
from analyzer.rules.events import EventTimes
from analyzer.sinks.atomic import TargetError
from dissectors.kit import JointLosses

if TYPE_CHECKING:
    from pathlib import Path

    from analyzer.report.newest import Change

PYTHON = f"'{sys.executable}' -c "
COPY = "import sys, pathlib; pathlib.Path(sys.argv[1]).write_text('|'.join(sys.argv[2:]) + chr(10) + sys.stdin.read())"


@pytest.fixture(autouse=True)
def no_hurry(monkeypatch: pytest.MonkeyPatch) -> None:
    """However slow the machine is."""
    for module in (hook, status_file):
        monkeypatch.setattr(module, "PATIENCE", LIMIT)


def session(*found: Change, frames: int = 100) -> Any:
    """A session as far as views look at it."""
    counts = {"can0": InterfaceCounts(90, 7, 3, 2)}
    loop = SimpleNamespace(frames=frames, behind=0.04, unjudged=5, hub=SimpleNamespace(counts=counts))
    newest = SimpleNamespace(all=[one.finding for one in found])
    return SimpleNamespace(loop=loop, newest=newest, problems=["can1: is gone"])


def hooked(text: str, *wanted: str) -> tuple[FindingHook, list[str]]:
    command = parse_command(text, wanted, RULES)
    assert command is not None
    told: list[str] = []
    return FindingHook(command, told.append), told


def test_a_command_gets_the_finding(tmp_path: Path) -> None:
    """As words of its own, whatever is in them, and as JSON."""
    path = tmp_path / "told"
    words = f"""{PYTHON}"{COPY}" '{path}' {{rule}} --node={{node}} "{{text}}" {{}} """
    one, told = hooked(words)
    text = "x; rm -rf / $(id) '\x1b[2J"
    one.found([change(text=text, node=22, t=START), change(severity="warning"), change(fresh=False)])
    one.close()
    one.look(session())
    shown, _, found = path.read_text().partition("\n")
    title = json.loads(found)["title"]
    assert shown == f"TRF-010|--node=22|{title}: x; rm -rf / $(id) '\\x1b[2J|{{}}"
    assert json.loads(found) == json.loads(found) | {"rule": "TRF-010", "node": 22, "text": text, "severity": "error"}
    assert told == []


def test_commands_are_bounded_and_nobody_waits(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Those that hang keep the others from running, which is told; at the end they are ended."""
    monkeypatch.setattr(hook, "WAITING", 3)
    monkeypatch.setattr(hook, "PATIENCE", 0.1)
    running = f"import sys, pathlib, time; pathlib.Path(r'{tmp_path}', sys.argv[1]).touch(); time.sleep(1000)"
    one, told = hooked(f'{PYTHON}"{running}" {{node}}', "warning")
    for number in range(hook.MOST):
        one.found([change(node=number)])
        wait_until(lambda number=number: (tmp_path / str(number)).exists())
    one.found([change(node=number) for number in range(20, 40)])
    one.look(session())
    assert told == ["--exec: not run, as too many wait: 17 findings"]
    one.close()
    assert len(list(tmp_path.iterdir())) == hook.MOST
    for thread in one._threads:
        thread.join()


@pytest.mark.parametrize(
    ("code", "said"), [("raise SystemExit(3)", "ends with status 3"), ("import sys; sys.stdin.close()", "")]
)
def test_a_command_that_fails_is_told(code: str, said: str) -> None:
    one, told = hooked(f'{PYTHON}"{code}"')
    one.found([change(), change(text="x" * 1_000_000)])
    one.close()
    one.look(session())
    one.look(session())
    assert told == ([f"--exec: {sys.executable} {said}"] if said else [])


@pytest.mark.parametrize(
    ("text", "wanted", "why"),
    [
        (None, ["error"], "--exec-on is of no use without --exec"),
        ("", [], "--exec: no command"),
        ("'", [], "--exec: No closing quotation"),
        ("no-such-program {rule}", [], "--exec: no-such-program: there is no such program"),
        (f"{PYTHON} {{rules}}", [], "--exec: {rules} stands for nothing (there is rule, severity, "),
        (f"{PYTHON} x", ["XYZ-1"], "--exec-on XYZ-1: no such rule"),
    ],
)
def test_commands_that_are_none(text: str | None, wanted: list[str], why: str) -> None:
    with pytest.raises(ValueError, match=r".") as refused:
        parse_command(text, wanted, RULES)
    assert str(refused.value).startswith(why)
    assert parse_command(None, [], RULES) is None


def test_the_state_is_in_a_file(tmp_path: Path) -> None:
    """Whole at any time, and told once if it cannot be written."""
    clock, told, path = Clock(), list[str](), tmp_path / "folder" / "state.json"
    path.parent.mkdir()
    recording = RecordingState("a.log", 1000, 90, 1, "")
    state = StatusFile(str(path), told.append, lambda: recording, clock.now, lambda: START + 10**9)
    assert json.loads(path.read_text())["state"] == "starting"
    error = change(t=START, node=22, text="is\x1b wrong")
    state.found([error, change(severity="note", t=START)])
    state.look(session(error))
    wait_until(lambda: json.loads(path.read_text())["state"] == "running")
    found = json.loads(path.read_text())
    assert found.pop("pid") > 0
    assert found == {
        "schema": "tailbyte.live/1", "state": "running", "started": "2026-03-14T08:02:11Z",
        "time": "2026-03-14T08:02:11Z", "frames": 100, "behind_s": 0.0, "unjudged": 5,
        "interfaces": {"can0": {"received": 90, "errors": 2, "dropped": 7, "lost": 3}},
        "findings": {"error": 1, "warning": 0, "note": 0},
        "newest": {
            "time": "2026-03-14T08:02:10Z", "severity": "error", "rule": "TRF-010", "bus": "can0", "node": 22,
            "text": f"{error.finding.title}: is\\x1b wrong",
        },
        "recording": {"file": "a.log", "bytes": 1000, "frames": 90, "lost": 1, "problem": ""},
        "problems": ["can1: is gone"],
    }  # fmt: skip
    state.look(session(frames=200))
    clock.seconds += status_file.EVERY
    state.look(session(frames=300))
    wait_until(lambda: json.loads(path.read_text())["frames"] == 300)
    path.unlink()
    path.parent.rmdir()
    clock.seconds += status_file.EVERY
    state.look(session())
    wait_until(lambda: bool(state._file.problem))
    state.look(session())
    state.look(session())
    assert [line.startswith("--status-file: ") for line in told] == [True]
    path.parent.mkdir()
    state.end(session(frames=400))
    found = json.loads(path.read_text())
    assert (found["state"], found["frames"]) == ("ended", 400)
    with pytest.raises(TargetError):
        StatusFile(str(tmp_path / "none" / "x"), told.append, lambda: None)


def test_a_line_a_day() -> None:
    clock, lines = Clock(), list[str]()
    status = Status(DAY, lines.append, str, clock.now, span="in the last day")
    for _ in range(48):
        clock.seconds += DAY / 24
        status.look(session(frames=round(clock.seconds)))
    assert [line.partition(", ")[0] for line in lines] == [
        "running for 24 h 0 min; in the last day: 86,400 frames (1/s)",
        "running for 48 h 0 min; in the last day: 86,400 frames (1/s)",
    ]


@pytest.mark.slow
def test_losses_that_go_on_for_a_week_are_forgotten(monkeypatch: pytest.MonkeyPatch) -> None:
    """The latest are what explains something."""
    monkeypatch.setattr(events, "LATEST", 100)
    monkeypatch.setattr(events, "SPARE", 10)
    monkeypatch.setattr(drops, "MOST_JOINT", 100)
    told, inferred = EventTimes(), Drops(1, 1)
    for t in range(0, 100_000, 10):
        told.add(0, t)
        inferred.add(JointLosses(*(np.array([cell]) for cell in (0, t, t + 1, 0, 1, 3, 1, 0))))
    assert 100 <= len(told._times[0]) <= 110
    assert told.near(0, 99_000, 99_000)
    assert not told.near(0, 90_000, 98_000)
    assert inferred._joint[0].shape == (2, 100)
    assert inferred._near(*np.array([[0], [99_990], [99_990]])) == [True]
