"""What a session shows comes at once; where judging takes long, it is judged in longer batches, and nothing is lost."""

from __future__ import annotations

from contextlib import ExitStack
from typing import TYPE_CHECKING, Any

import pytest
from cli.test_live_waiting import NS, Clocked
from kit.command import CAPTURES
from kit.live import Frame, cut, stored

from analyzer.app.judged import JudgedRun
from analyzer.app.live import gathered
from analyzer.app.live.batch_interval import BatchInterval
from analyzer.app.live.gathered import Gathered
from analyzer.app.live.session import LiveSession
from analyzer.app.live.session_recording import SessionRecording
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


def pieces(count: int) -> Iterator[Batch]:
    engine = Engine()
    lines = FAULTY.read_bytes().splitlines(keepends=True)
    for k in range(count):
        yield from engine.feed(b"".join(lines[k * STEP : (k + 1) * STEP]))
        yield engine.flush()


class Clock:
    def __init__(self) -> None:
        self.time = 0.0

    def __call__(self) -> float:
        return self.time


def test_batches_are_judged_together_when_it_is_time() -> None:
    clock = Clock()
    some = Gathered(BatchInterval(0.5, 4.0), clock)
    found: list[tuple[float, int]] = []
    for batch in pieces(30):
        clock.time += 0.2
        some.add(batch)
        if some.due:
            for one in some.take():
                found.append((round(clock.time, 1), len(one.frames)))
                clock.time += 0.05  # judging takes 25 times as long as it may
    (*_, last), rest = found, sum(len(one.frames) for one in some.take())
    assert found[0] == (0.8, 4 * STEP)
    assert last[1] > found[0][1]
    assert sum(rows for _, rows in found) + rest == 30 * STEP


def test_without_an_interval_each_is_judged_at_once() -> None:
    some = Gathered(None, Clock())
    assert not some.due
    for batch in pieces(3):
        some.add(batch)
        assert some.due
        assert [*some.take()] == [batch]
        assert not some.due


def test_what_is_gathered_is_bounded(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(gathered, "BATCH_ROWS", 5 * STEP)
    some = Gathered(BatchInterval(4.0, 4.0), Clock())
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


def session(record: Path, judging: BatchInterval | None) -> tuple[Seen, LiveSession, Any]:
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
    at_once, _, plain = session(tmp_path / "x.log", None)
    later, made, report = session(tmp_path / "x.log", BatchInterval(3.0, 4.0))
    assert not made.problems
    assert later.shown == at_once.shown
    assert 0 < later.order.count("found") < at_once.order.count("found")
    assert later.order[:5] == ["batch"] * 5
    assert plain.findings == report.findings
    assert len(report.findings) > 10
    assert set(later.told) <= {one.rule for one in report.findings}


def test_what_comes_is_shown_though_judging_has_failed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def fails(*_: object) -> Iterator[Measured]:
        raise ZeroDivisionError("by a rule")
        yield

    monkeypatch.setattr(JudgedRun, "feed", fails)
    view, made, report = session(tmp_path / "a.log", BatchInterval(3.0, 4.0))
    assert view.told == []
    assert report is None
    assert ["judging has ended" in one and "ZeroDivisionError" in one for one in made.problems] == [True]
