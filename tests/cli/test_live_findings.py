"""What a live session finds is what `check` finds in its recording, however the bus is cut and whatever happens."""

from __future__ import annotations

import json
from contextlib import ExitStack
from dataclasses import replace
from typing import TYPE_CHECKING

import pytest
from hypothesis import given
from hypothesis import strategies as st
from kit.command import CAPTURES
from kit.live import Fault, Frame, Lost, Note, Row, cut, stored
from kit.strategies import examples

from analyzer._native import AsRecorded
from analyzer.app.live import run as live_run
from analyzer.app.live.batch_interval import BatchInterval
from analyzer.app.live.session import LiveSession
from analyzer.app.live.session_recording import RecordingOptions, SessionPlan, SessionRecording
from analyzer.app.live.source import LiveSource
from analyzer.cli.commands import parser
from analyzer.cli.live import Wanted
from analyzer.live.capture_loop import SessionControl
from analyzer.sources.native import rows

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence
    from pathlib import Path

    from analyzer._native import FrameBatch
    from analyzer.report.newest import Change

    Command = Callable[..., tuple[int, str, str]]

pytestmark = pytest.mark.usefixtures("no_can_configuration")
ROWS = 700
NOTHING = RecordingOptions(None, None, None, False, (), (), None, (), None, None)


def bus(name: str, log: str, count: int | None = ROWS) -> list[Row]:
    """The first rows of a capture, on a bus of this name."""
    return [replace(row, bus=name) for row in stored(CAPTURES / log)[:count] if isinstance(row, Frame)]


def flown() -> list[Row]:
    """Two buses with faults, by time."""
    both = [*bus("can0", "mission-8-faults.log"), *bus("can1", "reordering.log")]
    start = {name: min(row.t for row in both if row.bus == name) for name in ("can0", "can1")}
    moved = [replace(row, t=row.t - start[row.bus] + start["can0"]) for row in both]
    return sorted(moved, key=lambda row: row.t)


FLOWN = flown()
OWN = """
[rule.ACME-1]
title = "A state"
when = "ESCStatus.voltage > 10 && RawCommand.cmd[0] >= 0"
for = "50 ms"
[rule.ACME-2]
title = "A demand"
when = "RawCommand.cmd[0] >= 0"
then = "ESCStatus.esc_index == 0 && ESCStatus.rpm >= RawCommand.cmd[1]"
within = "20 ms"
[rule.ACME-3]
title = "A step"
when = "ESCStatus.voltage != lag(ESCStatus.voltage, 20 ms)"
"""


class Steps:
    """A capture loop that records and gives one piece after the other."""

    def __init__(self, pieces: Sequence[FrameBatch], recording: SessionRecording) -> None:
        self._pieces, self._recording, self._recorded = list(pieces), recording, AsRecorded()
        self.control = SessionControl()

    @property
    def ended(self) -> bool:
        return not self._pieces

    def take(self, seconds: float) -> list[FrameBatch]:
        assert seconds >= 0
        if not self._pieces:
            return []
        piece = self._recorded.apply(self._pieces.pop(0))
        assert self._recording.recorder is not None
        self._recording.recorder.put(piece)
        return [piece]

    def take_findings(self, changes: Sequence[Change]) -> None: ...

    def notes(self) -> list[str]:
        return []


class Told:
    """What views are told."""

    def __init__(self) -> None:
        self.begun: list[tuple[object, ...]] = []
        self.failed = False

    def batch(self, measured: object) -> None: ...

    def found(self, changes: Sequence[Change]) -> None:
        self.begun += [
            (one.finding.rule, one.finding.bus, one.finding.node, one.finding.type, one.finding.key, one.finding.first)
            for one in changes
            if one.fresh
        ]

    def note(self, text: str) -> None: ...

    def look(self, session: LiveSession) -> None: ...


def lived(pieces: Sequence[FrameBatch], path: Path, *more: str) -> tuple[list[dict], Told]:
    """The findings of a session that is given these pieces and records them."""
    wanted = Wanted(parser().parse_args(["live", "virtual:here", "-q", "-w", str(path), "--force", *more]))
    told = Told()
    with ExitStack() as stack:
        recording = SessionRecording(wanted.request.plan, stack)
        session = LiveSession(Steps(pieces, recording), recording, "", wanted.criteria, [told], BatchInterval(0, 0))  # type: ignore[arg-type,list-item]
        session.run()
        recording.close()
        taken = session.conclude()
        assert taken is not None
        assert not session.problems
        report = wanted.criteria.report([taken])
    from analyzer.report.json import render  # noqa: PLC0415

    return json.loads(render(report))["findings"], told


# What happens, at which row, on which bus.
HAPPENS = st.tuples(
    st.integers(0, len(FLOWN) - 1),
    st.sampled_from(["can0", "can1"]),
    st.one_of(
        st.builds(Lost, st.none(), st.just(""), st.integers(1, 300)),
        st.builds(Fault, st.none(), st.just(""), st.sampled_from([1, 2, 4, 8, 0x20, 0x40, 0x80]),
                  st.binary(min_size=8, max_size=8)),
        st.builds(Note, st.none(), st.sampled_from(["mark 1", "can0: link down", "x" * 200])),
    ),
)  # fmt: skip


def with_events(events: Sequence[tuple[int, str, Row]]) -> list[Row]:
    """The flight, with losses, error frames and marks in it."""
    mixed = list(FLOWN)
    for at, name, event in events:
        named = event if isinstance(event, Note) else replace(event, bus=name)
        mixed.insert(at, replace(named, t=mixed[at].t))
    return mixed


@given(
    st.lists(HAPPENS, max_size=6),
    st.lists(st.integers(0, len(FLOWN)), max_size=40),
    st.sampled_from(["log", "mcap", "pcapng"]),
)
@examples(20)
def test_any_cut_and_any_format(
    tmp_path_factory: pytest.TempPathFactory, events: list[tuple[int, str, Row]], places: list[int], form: str
) -> None:
    """Law: batches make no difference, nor does the way through the recording; what begins is told once."""
    folder = tmp_path_factory.mktemp("cut")
    (folder / "vehicle.toml").write_text(OWN)
    own = "--vehicle", str(folder / "vehicle.toml")
    found, told = lived(cut(with_events(events), places), folder / f"x.{form}", *own)
    from analyzer.cli import main  # noqa: PLC0415

    assert main(["check", str(folder / f"x.{form}"), "-o", str(folder / "check.json"), *own]) in {0, 1, 4}
    checked = json.loads((folder / "check.json").read_bytes())["findings"]
    assert json.dumps(found) == json.dumps(checked)
    assert len(told.begun) == len(set(told.begun))
    assert len(found) > 3
    assert {one["rule"] for one in found} >= {"ACME-1", "ACME-2", "ACME-3"}


def test_what_is_recorded_can_be_read_again(tmp_path: Path) -> None:
    """A session is a source like others: its rows exist only once if nothing is recorded."""
    wanted = Wanted(parser().parse_args(["live", "virtual:here", "-q", "-w", str(tmp_path / "x.mcap")]))
    with ExitStack() as stack:
        recording = SessionRecording(wanted.request.plan, stack)
        steps = Steps(cut(FLOWN, [100, 300]), recording)
        source = LiveSource(steps, recording, "here", BatchInterval(0, 0), lambda: None)  # type: ignore[arg-type]
        given = sum(batch.frames for batch in rows(source.chunks()) if not isinstance(batch, bytes))
        recording.close()
    path = str(tmp_path / "x.mcap")
    assert (source.live, source.name, [part.name for part in source.parts]) == (False, path, [path])
    again = sum(batch.frames for batch in rows(source.again().chunks()) if not isinstance(batch, bytes))
    assert given == again == len(FLOWN)
    unrecorded = SessionRecording(SessionPlan(NOTHING, (), ""), ExitStack())
    nothing = LiveSource(steps, unrecorded, "here", BatchInterval(0, 0), lambda: None)  # type: ignore[arg-type]
    assert (nothing.live, nothing.name, nothing.parts) == (True, "here", [])


class Fed:
    """A receiver that has these pieces, and then nothing more."""

    failed: str | None = None

    def __init__(self, name: str, pieces: Sequence[FrameBatch]) -> None:
        self.name, self._pieces = name, list(pieces)

    def receive(self, seconds: float) -> FrameBatch | None:
        assert seconds > 0
        return self._pieces.pop(0) if self._pieces else None

    def finish(self) -> list[FrameBatch]:
        return []

    def wake(self) -> None: ...

    def notes(self) -> list[str]:
        return []

    def close(self) -> None: ...


@pytest.mark.slow
@pytest.mark.parametrize("name", ["x.log", "x.mcap", "x.pcapng", "x.log.gz", "x.log.zst"])
def test_two_interfaces_that_lose_and_complain(
    name: str, command: Command, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    sent = {one: [row for row in FLOWN if row.bus == one] for one in ("can0", "can1")}
    t = sent["can0"][200].t
    sent["can0"][200:200] = [Lost(t, "can0", 7), Fault(t, "can0", 0x20, bytes(8))]
    fed = {one: Fed(one, cut(mine, range(50, 700, 90))) for one, mine in sent.items()}
    monkeypatch.setattr(live_run, "open_receiver", lambda interface, *_, **__: fed[interface.name])
    frames = sum(isinstance(row, Frame) for mine in sent.values() for row in mine)
    record, live, check = tmp_path / name, tmp_path / "live.json", tmp_path / "check.json"
    status, _, err = command("live", "can0", "can1", "-q", "-c", frames, "-w", record, "--json", live)
    assert "-- can0: 707 frames = 700 received + 7 dropped; 1 error frame received" in err
    assert command("check", record, "--json", check)[0] == status
    found = json.loads(live.read_bytes())["findings"]
    assert json.dumps(found) == json.dumps(json.loads(check.read_bytes())["findings"])
    assert {one["bus"] for one in found} >= {"can0", "can1"}
    assert any(one["rule"] == "CAP-004" for one in found)


def test_the_recording_ends_behind_the_last_finding(
    command: Command, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    """What is only known at the end opens a window, too."""
    sent = bus("can0", "command-loss.log", None)
    fed = Fed("can0", cut(sent, [1000]))
    monkeypatch.setattr(live_run, "open_receiver", lambda *_, **__: fed)
    path = tmp_path / "a.log"
    _, _, err = command("live", "can0", "-q", "-c", len(sent), "-w", path, "--trigger", "BUS-007", "--pre", "0.2s")
    rows = stored(path)
    assert f"recorded: {sum(isinstance(row, Frame) for row in rows)} frames" in err.replace(",", "")
    assert any("trigger 1: BUS-007 (error)" in row.text for row in rows if isinstance(row, Note))
    assert isinstance(rows[-2], Frame)
    assert "not recorded" not in err
