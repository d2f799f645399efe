"""What a session shows comes at once; where judging takes long, it is judged in longer batches, and nothing is lost."""

from __future__ import annotations

import json
import threading
from contextlib import ExitStack
from itertools import islice
from typing import TYPE_CHECKING, Any

import can
import pytest
from cli.test_live_waiting import NS, Clocked
from kit.command import CAPTURES, wait_until
from kit.live import Frame, cut, stored
from kit.waiting import Clock

from analyzer.app.judged import JudgedRun
from analyzer.app.live import gathered
from analyzer.app.live.batch_interval import BatchInterval
from analyzer.app.live.gathered import Gathered
from analyzer.app.live.session import LiveSession
from analyzer.app.live.session_recording import SessionRecording
from analyzer.cli import main
from analyzer.cli.commands import parser
from analyzer.cli.live import Wanted
from analyzer.decode.engine import Engine

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence
    from pathlib import Path

    from analyzer.decode.engine import Batch
    from analyzer.report.newest import Change
    from analyzer.rules.checking import Measured

pytestmark = pytest.mark.usefixtures("no_can_configuration")
FAULTY = CAPTURES / "mission-8-faults.log"
STEP = 100  # frames that come together


def pieces(count: int, engine: Engine | None = None) -> Iterator[Batch]:
    engine = engine or Engine()
    lines = FAULTY.read_bytes().splitlines(keepends=True)
    for k in range(count):
        yield from engine.feed(b"".join(lines[k * STEP : (k + 1) * STEP]))
        yield engine.flush()


def test_batches_are_judged_together_when_it_is_time() -> None:
    clock = Clock()
    some = Gathered(BatchInterval(0.5, 4.0), clock.now)
    found: list[int] = []
    for batch in pieces(30):
        clock.seconds += 0.2
        some.add(batch)
        if some.due:
            for one in some.take():
                found.append(len(one.frames))
                clock.seconds += 0.05  # judging takes more than it may
    rest = sum(len(one.frames) for one in some.take())
    assert found[0] == 3 * STEP
    assert found[-1] > found[0]
    assert sum(found) + rest == 30 * STEP


def test_what_is_judged_quickly_is_judged_as_it_comes() -> None:
    clock = Clock()
    some = Gathered(BatchInterval(0.2, 4.0), clock.now)
    for batch in pieces(5):
        clock.seconds += 0.21
        some.add(batch)
        assert some.due
        assert [*some.take()] == [batch]


def test_without_an_interval_each_is_judged_at_once() -> None:
    some = Gathered(None, Clock().now)
    assert not some.due
    for batch in pieces(3):
        some.add(batch)
        assert some.due
        assert [*some.take()] == [batch]
        assert not some.due


def test_what_is_gathered_is_bounded(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(gathered, "BATCH_ROWS", 5 * STEP)
    some = Gathered(BatchInterval(4.0, 4.0), Clock().now)
    due = []
    for batch in pieces(5):
        some.add(batch)
        due.append(some.due)
    assert due == [False] * 4 + [True]


class Seen:
    """A view that writes down how many frames it is shown, and which findings it is told."""

    failed = False

    def __init__(self) -> None:
        self.shown: list[int] = []
        self.told: list[str] = []
        self.order: list[str] = []

    def batch(self, measured: Measured) -> None:
        assert len(measured.bits) == len(measured.batch.frames)
        self.shown.append(len(measured.batch.frames))
        self.order.append("batch")

    def found(self, changes: Sequence[Change]) -> None:
        self.told += [change.finding.rule for change in changes]
        self.order.append("found")

    def note(self, text: str) -> None: ...

    def look(self, session: LiveSession) -> None: ...


def run_session(record: Path, judging: BatchInterval | None) -> tuple[Seen, LiveSession, Any]:
    """A session of a capture with faults, after it has run; its clock is that of the frames."""
    rows = [row for row in stored(FAULTY, sound=False) if isinstance(row, Frame)]
    wanted = Wanted(parser().parse_args(["live", "virtual:here", "-w", str(record), "--force"]))
    view = Seen()
    with ExitStack() as stack:
        recording = SessionRecording(wanted.request.plan, stack)
        loop = Clocked(cut(rows, range(STEP, len(rows), STEP)), [row.t or 0 for row in rows[::STEP]], recording)
        made = LiveSession(
            loop, recording, "", wanted.criteria, [view], BatchInterval(0, 0), loop.now, judging=judging  # type: ignore[arg-type, list-item]
        )  # fmt: skip
        made.run()
        recording.close()
        taken = made.conclude()
    assert sum(view.shown) == len(rows)
    assert rows[-1].t is not None
    assert loop.now() * NS <= rows[-1].t
    return view, made, None if taken is None else wanted.criteria.report([taken])


def test_what_is_found_is_the_same(tmp_path: Path) -> None:
    at_once, _, plain = run_session(tmp_path / "x.log", None)
    later, made, report = run_session(tmp_path / "x.log", BatchInterval(3.0, 4.0))
    assert not made.problems
    assert later.shown == at_once.shown
    assert 0 < later.order.count("found") < at_once.order.count("found")
    assert later.order[:5] == ["batch"] * 5
    assert plain.findings == report.findings
    assert len(report.findings) > 10
    assert set(later.told) <= {one.rule for one in report.findings}


def fails(*_: object) -> Iterator[Measured]:
    raise ZeroDivisionError("by a rule")
    yield


@pytest.mark.parametrize(("whose", "name"), [(JudgedRun, "feed"), (gathered, "joined")])
def test_what_comes_is_shown_though_judging_has_failed(
    whose: object, name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(whose, name, lambda *given: next(fails(*given)))
    view, made, report = run_session(tmp_path / "x.log", BatchInterval(3.0, 4.0))
    assert view.told == []
    assert report is None
    assert ["judging has ended" in one and "ZeroDivisionError" in one for one in made.problems] == [True]


def test_a_list_is_ended_though_judging_has_failed(
    capfd: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    with can.LogReader(FAULTY) as log:
        frames = list(islice((message for message in log if not message.is_error_frame), 300))

    def send() -> None:
        with can.Bus("gathered", interface="virtual", ignore_config=True, preserve_timestamps=True) as bus:
            wait_until(lambda: len(bus.channel) == 2)
            for message in frames:
                bus.send(message)

    monkeypatch.setattr(JudgedRun, "feed", fails)
    thread = threading.Thread(target=send)
    thread.start()
    main(["live", "virtual:gathered", "-c", str(len(frames)), "-T", "json"])
    thread.join()
    out, told = capfd.readouterr()
    assert len(json.loads(out)) > 10
    assert "judging has ended" in told


def test_in_silence_it_is_judged_what_was_gathered(tmp_path: Path) -> None:
    view, clock = Seen(), Clock()
    wanted = Wanted(parser().parse_args(["live", "virtual:here", "-w", str(tmp_path / "x.log"), "--force"]))
    with ExitStack() as stack:
        recording = SessionRecording(wanted.request.plan, stack)
        loop = Clocked([], [0], recording)
        made = LiveSession(
            loop, recording, "", wanted.criteria, [view], BatchInterval(0, 0), clock.now,  # type: ignore[arg-type, list-item]
            judging=BatchInterval(60.0, 60.0),
        )  # fmt: skip
        for batch in pieces(60, made.reading.engine):
            made._take(batch)
        made._look()
        assert (view.shown, view.told) == ([STEP] * 60, [])
        clock.seconds += 2.5
        made._look()
        assert not made.problems
        assert "CAN-002" in view.told
        recording.close()


@pytest.mark.parametrize(
    ("more", "at_once"),
    [
        ([], False),
        (["-Y", "RawCommand"], False),
        (["-Y", "finding.rule"], True),
        (["-l"], True),
        (["-a", "finding:CAN-002"], True),
        (["--exec", "true"], True),
        (["-w", "x.log", "--trigger", "CAN-002"], True),
    ],
)
def test_findings_do_not_wait_where_somebody_waits_for_them(more: list[str], at_once: bool) -> None:
    assert Wanted(parser().parse_args(["live", "virtual:here", *more])).request.at_once is at_once
