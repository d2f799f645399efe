"""`tailbyte live -Y 'finding.*'`: rows wait for findings, and are those of `decode` on the recording."""

from __future__ import annotations

import threading
from contextlib import ExitStack
from typing import TYPE_CHECKING

import can
import pytest
from kit.command import CAPTURES, wait_until
from kit.live import Frame, cut, stored

from analyzer._native import AsRecorded
from analyzer.app.live.batch_interval import BatchInterval
from analyzer.app.live.session import LiveSession
from analyzer.app.live.session_recording import SessionRecording
from analyzer.app.live.waiting import MOST_FRAMES, PATIENCE, WaitingList
from analyzer.cli import main
from analyzer.cli.commands import parser
from analyzer.cli.live import Wanted
from analyzer.live.capture_loop import SessionControl
from analyzer.rules.named_frames import RecentNames

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence
    from pathlib import Path

    from analyzer._native import FrameBatch
    from analyzer.report.newest import Change

    Command = Callable[..., tuple[int, str, str]]

pytestmark = pytest.mark.usefixtures("no_can_configuration")
FIELDS = ("-T", "fields", "-e", "frame.number", "-e", "dronecan.type")
FAULTY = CAPTURES / "mission-8-faults.log"
NS = 1_000_000_000


class Clocked:
    """A capture loop that gives one piece after the other, when its time has come; it records them."""

    def __init__(self, pieces: Sequence[FrameBatch], starts: Sequence[int], recording: SessionRecording) -> None:
        self._pieces, self._starts = list(pieces), [t / NS for t in starts]
        self._recording, self._recorded = recording, AsRecorded()
        self.control, self.time = SessionControl(), self._starts[0]

    def now(self) -> float:
        return self.time

    @property
    def behind(self) -> float:
        return 0.0

    @property
    def ended(self) -> bool:
        return not self._pieces

    def take(self, seconds: float) -> list[FrameBatch]:
        assert seconds >= 0
        if not self._pieces:
            return []
        self.time = self._starts.pop(0)
        piece = self._recorded.apply(self._pieces.pop(0))
        assert self._recording.recorder is not None
        self._recording.recorder.put(piece)
        return [piece]

    def take_findings(self, changes: Sequence[Change]) -> None: ...

    def notes(self) -> list[str]:
        return []


class Printed:
    """A printer that keeps what it is given, and when."""

    problem, gone, lost, behind = None, False, 0, 0.0

    def __init__(self) -> None:
        self.texts: list[str] = []

    def put(self, text: str) -> None:
        self.texts += text.splitlines()


def listed(path: Path, record: Path, text: str, step: int) -> tuple[list[str], list[int]]:
    """The rows of a live list, and how many rows there were at the start of each piece of `step` frames."""
    rows = [row for row in stored(path, sound=False) if isinstance(row, Frame)]
    starts = [row.t or 0 for row in rows[::step]]
    args = ["live", "virtual:here", "-w", str(record), "--force", *FIELDS, "-Y", text]
    wanted, printed, counts = Wanted(parser().parse_args(args)), Printed(), list[int]()
    chosen, criteria, names = wanted.request.filter, wanted.criteria, RecentNames()
    assert chosen is not None
    severities = {rule: page.severity for rule, page in criteria.pages.items()}
    with ExitStack() as stack:
        recording = SessionRecording(wanted.request.plan, stack)
        loop = Clocked(cut(rows, range(step, len(rows), step)), starts, recording)
        view = WaitingList(
            wanted.request.view, criteria.registry, printed, several=False, say=lambda _: None, now=loop.now,
            matcher=chosen.matcher(named=names, severities=severities), names=names,
        )  # fmt: skip
        usual = view.batch

        def batch(measured: object) -> None:
            counts.append(len(printed.texts))
            usual(measured)  # type: ignore[arg-type]

        view.batch = batch  # type: ignore[method-assign]
        session = LiveSession(loop, recording, "", criteria, [view], BatchInterval(0, 0), loop.now, named=names)  # type: ignore[arg-type]
        session.run()
        recording.close()
        taken = session.conclude()
        assert taken is not None
        assert not session.problems
        view.end(criteria.report([taken]).findings)
    return printed.texts, counts


@pytest.mark.sampled(4)
@pytest.mark.parametrize("step", [500, 100_000])
@pytest.mark.parametrize("name", ["mission-8-faults.log", "reordering.log", "services.log"])
def test_the_rows_are_those_of_the_recording(name: str, step: int, command: Command, tmp_path: Path) -> None:
    for text in ("finding.rule", 'finding.severity == "error" && !RawCommand'):
        rows, _ = listed(CAPTURES / name, tmp_path / "x.log", text, step)
        _, out, _ = command("decode", tmp_path / "x.log", *FIELDS, "-Y", text)
        assert sorted(rows) == sorted(out.splitlines()), text


@pytest.mark.slow
def test_they_come_when_they_have_waited(tmp_path: Path) -> None:
    """A flight of 20 s: what is found at its start is listed long before its end, what comes too late is not."""
    path = CAPTURES / "esc-failure.mcap"
    rows, counts = listed(path, tmp_path / "x.log", "finding.rule", 200)
    starts = [row.t or 0 for row in stored(path) if isinstance(row, Frame)][::200]
    assert 0 < counts[-1] < len(rows)
    for now, count in zip(starts, counts, strict=True):
        came = [starts[(int(row.split("\t")[0]) - 1) // 200] for row in rows[:count]]
        assert all(t <= now - PATIENCE * NS for t in came)


@pytest.mark.slow
def test_what_waits_is_bounded(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    assert MOST_FRAMES > 100_000
    monkeypatch.setattr("analyzer.app.live.waiting.MOST_FRAMES", 500)
    every, late = listed(FAULTY, tmp_path / "x.log", "finding.rule", 400)
    assert late[-1] > 0
    assert len(every) > 10


def test_names_are_forgotten() -> None:
    from dissectors.kit import Occurrence  # noqa: PLC0415

    names = RecentNames()
    for frame in range(0, 1000, 10):
        names.feed(Occurrence("TRF-003", 0, 0, 5, "ESCStatus", (frame,), {}))
    assert names.between(0, 2000) == {}
    names.keep([("TRF-003", 0, 5)])
    assert list(names.between(0, 2000)) == list(range(0, 1000, 10))
    names.forget(980)
    names.feed(Occurrence("TRF-003", 0, 0, 5, "ESCStatus", (3, 985), {}))
    assert names.between(0, 2000) == {980: ["TRF-003"], 985: ["TRF-003"], 990: ["TRF-003"]}


@pytest.mark.sampled(4)
@pytest.mark.parametrize("form", ["text", "jsonl"])
def test_on_a_bus(form: str, tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    with can.LogReader(FAULTY) as log:
        frames = [message for message in log if not message.is_error_frame]

    def send() -> None:
        with can.Bus("waiting", interface="virtual", ignore_config=True, preserve_timestamps=True) as bus:
            wait_until(lambda: len(bus.channel) == 2)
            for message in frames:
                bus.send(message)

    thread = threading.Thread(target=send)
    thread.start()
    record, text = tmp_path / "x.log", 'finding.rule == "TRF-003"'
    main(["live", "virtual:waiting", "-c", str(len(frames)), "-w", str(record), "-Y", text, "-T", form])
    thread.join()
    shown = capfd.readouterr().out
    main(["decode", str(record), "-Y", text, "-T", form])
    out = capfd.readouterr().out
    assert sum(isinstance(row, Frame) for row in stored(record)) == len(frames)
    assert shown.count("\n") == out.count("\n") > 0
    assert form == "text" or shown == out


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ('finding.rule == "TRF-3"', "no rule is called 'TRF-3'; did you mean TRF-003?"),
        ("finding.rule == trf003", "no rule is called 'trf003'; did you mean TRF-003?"),
        ('node.label == "front"', "node.label is what a vehicle file calls a node: give one with --vehicle FILE.toml"),
    ],
)
def test_what_does_not_exist_is_told_before_anything_is_opened(text: str, said: str, command: Command) -> None:
    status, out, err = command("live", "virtual:here", "-Y", text)
    assert (status, out) == (2, "")
    assert err.startswith(f"tailbyte live: {said}\n")
