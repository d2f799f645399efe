"""Files of a recording that somebody moves away or deletes: a new one begins, and it is told."""

from __future__ import annotations

import os
import shutil
import signal
from typing import TYPE_CHECKING

import pytest
from kit.command import LIMIT, wait_until
from kit.live import cut, plan, stored, traffic

from analyzer.app.live import run as live_run
from analyzer.live.capture_loop import SessionControl
from analyzer.live.recording.file_recorder import FileRecorder
from analyzer.live.recording.ring import RingPlan

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

ROWS = traffic(30)
FIRST, SECOND, THIRD = cut(ROWS, [10, 20])


def written(recorder: FileRecorder, count: int) -> None:
    wait_until(lambda: recorder.frames == count)


@pytest.mark.parametrize("name", ["a.log", "a.mcap", "a.pcapng", "a.log.gz"])
def test_a_file_that_is_moved_away_is_finished(name: str, tmp_path: Path) -> None:
    path, moved = tmp_path / name, tmp_path / f"moved-{name}"
    with FileRecorder(plan(path), flushed=0.0) as recorder:
        recorder.put(FIRST)
        written(recorder, 10)
        path.rename(moved)
        recorder.begin_anew()
        wait_until(path.exists)
        recorder.put(SECOND)
        written(recorder, 20)
        notes = recorder.notes()
    assert notes == [f"{path}: a new file begins"]
    assert (stored(moved), stored(path)) == (ROWS[:10], ROWS[10:20])
    assert (recorder.files, recorder.begun_anew, recorder.problem) == ([str(path)], True, None)


def test_a_file_that_was_not_moved_goes_on(tmp_path: Path) -> None:
    path = tmp_path / "a.log"
    notes: list[str] = []
    with FileRecorder(plan(path), flushed=0.0) as recorder:
        recorder.put(FIRST)
        recorder.begin_anew()
        wait_until(lambda: notes.extend(recorder.notes()) or bool(notes))
        recorder.put(SECOND)
    assert notes == [f"{path}: is there, and goes on: move it away, then a new one begins"]
    assert stored(path) == ROWS[:20]
    assert not recorder.begun_anew


def test_the_next_file_of_a_ring_begins(tmp_path: Path) -> None:
    with FileRecorder(plan(tmp_path / "a.log", ring=RingPlan(frames=1000)), flushed=0.0) as recorder:
        recorder.put(FIRST)
        written(recorder, 10)
        recorder.begin_anew()
        wait_until(lambda: len(recorder.files) == 2)
        recorder.put(SECOND)
    first, second = recorder.files
    assert (stored(first), stored(second)) == (ROWS[:10], ROWS[10:20])
    assert not recorder.begun_anew


def test_a_file_that_is_deleted_begins_anew(tmp_path: Path) -> None:
    path = tmp_path / "a.log"
    with FileRecorder(plan(path), flushed=0.0, synced=0.0) as recorder:
        recorder.put(FIRST)
        written(recorder, 10)
        path.unlink()
        recorder.put(SECOND)
        written(recorder, 20)
        wait_until(path.exists)
        recorder.put(THIRD)
        written(recorder, 30)
        (note,) = recorder.notes()
    assert note.startswith(f"{path}: has been deleted, with ")
    assert recorder.begun_anew
    assert recorder.problem is None
    assert stored(path)[-10:] == ROWS[20:]


def test_a_folder_that_vanishes_ends_the_recording(tmp_path: Path) -> None:
    path = tmp_path / "folder" / "a.log"
    path.parent.mkdir()
    with FileRecorder(plan(path), flushed=0.0, synced=LIMIT) as recorder:
        recorder.put(FIRST)
        written(recorder, 10)
        shutil.rmtree(path.parent)
        recorder.begin_anew()
        wait_until(lambda: recorder.problem is not None)
    assert recorder.problem == f"{path}: No such file or directory; recording ends with 10 frames"


def test_a_file_that_is_deleted_at_last_is_missed(tmp_path: Path) -> None:
    path = tmp_path / "a.log"
    with FileRecorder(plan(path), flushed=0.0, synced=LIMIT) as recorder:
        recorder.put(FIRST)
        written(recorder, 10)
        path.unlink()
    assert recorder.problem == f"{path}: has been deleted; recording ends with 10 frames"


@pytest.mark.parametrize(
    ("recorded", "terminals", "renewals"),
    [(True, [True, True], 1), (True, [False, False], 1), (True, [True, False], 0), (False, [False, False], 0)],
    ids=["asked for", "a daemon", "the terminal is gone", "nothing is recorded"],
)
def test_sighup(recorded: bool, terminals: list[bool], renewals: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """It renews the files if it can be meant so, else it ends the session."""
    monkeypatch.setattr(live_run, "_has_terminal", lambda: terminals.pop(0))
    control = SessionControl()
    with live_run.signals(control, recorded=recorded):
        os.kill(os.getpid(), signal.SIGHUP)
    assert (control.renewals, control.stopped) == (renewals, not renewals)


@pytest.mark.usefixtures("no_can_configuration")
def test_a_recording_that_failed_is_told_whatever_was_found(
    command: Callable[..., tuple[int, str, str]], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Exit status 3, not that of the findings."""
    from cli.test_live_findings import Fed, bus  # noqa: PLC0415

    monkeypatch.setattr(FileRecorder, "close", _full)
    sent = bus("can0", "command-loss.log", None)
    monkeypatch.setattr(live_run, "open_receiver", lambda *_, **__: Fed("can0", cut(sent, [])))
    status, _, err = command("live", "can0", "-q", "-c", len(sent), "-w", tmp_path / "a.log")
    assert status == 3
    assert "No space left on device; recording ends with" in err
    assert "BUS-007" in err


_CLOSE = FileRecorder.close


def _full(recorder: FileRecorder) -> None:
    recorder._fail("a.log: No space left on device; recording ends with 0 frames")
    _CLOSE(recorder)
