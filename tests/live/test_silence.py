"""Findings that wait for frames which do not come: the clock releases them, and so does the end of a session."""

from __future__ import annotations

from contextlib import ExitStack
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import pytest
from kit.command import CAPTURES
from kit.live import Frame, Note, cut, stored

from analyzer._native import AsRecorded
from analyzer.app.live.batch_interval import BatchInterval
from analyzer.app.live.session import SILENCE, LiveSession
from analyzer.app.live.session_recording import SessionRecording
from analyzer.cli.commands import parser
from analyzer.cli.live import Wanted
from analyzer.live.capture_loop import SessionControl

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from analyzer._native import FrameBatch
    from analyzer.report.newest import Change

pytestmark = pytest.mark.usefixtures("no_can_configuration")

# BUS-007 and TRF-016 there are known when the capture has come to its end.
LOSS = CAPTURES / "command-loss.log"
SLICE = 0.5


@dataclass
class Clock:
    now: float = 0.0


@dataclass
class Falling:
    """A capture loop whose bus falls silent, for so many slices."""

    pieces: list[FrameBatch]
    recording: SessionRecording
    clock: Clock
    silent: int
    control: SessionControl = field(default_factory=SessionControl)
    told: list[tuple[float, Change]] = field(default_factory=list)

    def __post_init__(self) -> None:
        self._recorded = AsRecorded()

    @property
    def ended(self) -> bool:
        return not self.pieces and self.silent <= 0

    def take(self, _seconds: float) -> list[FrameBatch]:
        self.clock.now += SLICE
        if not self.pieces:
            self.silent -= 1
            return []
        piece = self._recorded.apply(self.pieces.pop(0))
        if self.recording.recorder is not None:
            self.recording.recorder.put(piece)
        return [piece]

    def take_findings(self, changes: Sequence[Change]) -> None:
        self.told += [(self.clock.now, one) for one in changes]
        self.recording.autostop.take_findings(changes)
        if self.recording.recorder is not None:
            self.recording.recorder.take_findings(changes)

    def notes(self) -> list[str]:
        return []


def lived(silent: int, *options: object, breaks: bool = False) -> tuple[Falling, LiveSession, bool]:
    """A session over `LOSS` and so many slices of silence, and whether it would have ended itself before its end."""
    wanted = Wanted(parser().parse_args(["live", "virtual:here", "-q", *map(str, options)]))
    clock = Clock()
    with ExitStack() as stack:
        recording = SessionRecording(wanted.request.plan, stack)
        loop = Falling(cut(stored(LOSS), [1000, 2000]), recording, clock, silent)
        session = LiveSession(loop, recording, "", wanted.criteria, [], BatchInterval(0, 0), lambda: clock.now)  # type: ignore[arg-type]
        if breaks:
            session.newest._judge._rules.append(Uncopied())  # type: ignore[attr-defined]
        session.run()
        enough = recording.autostop.due()
        recording.end()
        assert session.conclude() is not None
        recording.close()
    return loop, session, enough


class Uncopied:
    rules = ("TRF-001",)

    def __init__(self) -> None:
        self.opened = memoryview(b"")

    def feed(self, _: object) -> tuple[()]:
        return ()

    finish = feed


def names(told: Sequence[tuple[float, Change]]) -> list[str]:
    return [change.finding.rule for _, change in told if change.fresh and change.finding.severity != "note"]


@pytest.mark.slow
def test_silence_releases_what_waits() -> None:
    """Once a silence, and what comes true is not told again; what the end of a recording means is not told before."""
    slices = round(SILENCE / SLICE)
    until, _, _ = lived(slices - 1)
    before, _, _ = lived(slices - 2)
    early = [(t, one) for t, one in until.told if t == until.clock.now]
    assert "BUS-007" in names(early)
    assert "BUS-007" in names(before.told)  # at the end
    longer, session, _ = lived(20)
    assert names(longer.told).count("BUS-007") == 1
    assert {t for t, one in longer.told if one.finding.rule == "BUS-007"} == {3 * SLICE + SILENCE}
    assert not session.problems
    final = {(one.rule, one.first, one.severity) for one in session.newest.all}
    told = {(one.finding.rule, one.finding.first, one.finding.severity) for _, one in longer.told}
    assert told == final


@pytest.mark.slow
def test_a_finding_ends_the_session_in_silence() -> None:
    assert not lived(1, "-a", "finding:BUS-007")[2]
    assert lived(20, "-a", "finding:BUS-007")[2]


@pytest.mark.sampled(4)
@pytest.mark.parametrize("silent", [0, 20], ids=["the session ends", "the bus falls silent"])
def test_a_dashcam_records_what_is_known_late(tmp_path: Path, silent: int) -> None:
    path = tmp_path / "a.log"
    lived(silent, "-w", path, "--trigger", "BUS-007", "--pre", "0.2s")
    rows = stored(path)
    texts = [row.text for row in rows if isinstance(row, Note)]
    assert any("trigger 1: BUS-007 (error)" in text for text in texts)
    assert "trigger's window ends" in texts[-1]
    assert [row.data for row in rows if isinstance(row, Frame)]


def test_a_rule_that_cannot_be_copied_waits_for_frames() -> None:
    loop, session, _ = lived(20, breaks=True)
    assert {t for t, one in loop.told if one.finding.rule == "BUS-007"} == {loop.clock.now}
    assert not session.problems
