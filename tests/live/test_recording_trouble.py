"""Disks that are full, slow, gone or taken: the session goes on, and what is missing is told."""

from __future__ import annotations

import errno
import fcntl
import os
import subprocess
import sys
import termios
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path
from threading import Event, Semaphore
from typing import TYPE_CHECKING

import pytest
from kit.command import LIMIT, wait_until
from kit.live import (
    MS,
    START,
    Lost,
    Note,
    as_recorded,
    child,
    cut,
    frames_in,
    made,
    plan,
    record,
    stored,
    traffic,
)
from kit.rows import Fault, Frame

from analyzer.live.recording import file_recorder as recording
from analyzer.live.recording.file_recorder import FileRecorder
from analyzer.live.recording.files import Files
from analyzer.live.recording.plan import RecordingPlan
from analyzer.sinks.atomic import TargetError

if TYPE_CHECKING:
    from collections.abc import Callable

    from analyzer._native import FrameBatch

FULL = """
import resource, signal, sys
signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
sys.dont_write_bytecode = True  # half a file of it
resource.setrlimit(resource.RLIMIT_FSIZE, (20_000, 20_000))
sys.path[:0] = sys.argv[2].split(":")
from pathlib import Path
from kit.command import wait_until
from kit.live import as_recorded, cut, plan, traffic
from analyzer.live.recording.file_recorder import FileRecorder
recorder = FileRecorder(plan(Path(sys.argv[1])), flushed=0.0)
for n in range(0, 4000, 100):
    piece, = as_recorded(cut(traffic(100, first=n), []))
    recorder.put(piece)
    if recorder.problem is None:
        wait_until(lambda: recorder.frames == n + 100 or recorder.problem is not None)
recorder.close()
print(recorder.frames, recorder.lost, recorder.problem)
print(*recorder.notes(), sep="\\n")
"""


@pytest.mark.slow
@pytest.mark.parametrize("suffix", [".log", ".mcap", ".pcapng", ".log.gz"])
def test_a_full_disk_ends_the_recording_and_nothing_else(suffix: str, tmp_path: Path) -> None:
    path = tmp_path / f"a{suffix}"
    with child(path, FULL) as process:
        out, _ = process.communicate(timeout=LIMIT)
    assert process.returncode == 0
    first, note = out.decode().splitlines()
    frames, lost, problem = first.split(" ", 2)
    assert problem == note == f"{path}: File too large; recording ends with {frames} frames"
    assert int(frames) > 100
    assert int(frames) + int(lost) == 4000
    assert path.stat().st_size <= 20_000
    assert stored(path, sound=suffix != ".mcap") == traffic(int(frames))


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="there is no /dev/full here")
def test_a_disk_without_any_room() -> None:
    try:
        recorder = FileRecorder(RecordingPlan("/dev/full", "candump"))
    except TargetError as error:
        pytest.fail(str(error))
    recorder.put(made(traffic(5)))
    recorder.close()
    assert recorder.problem == "/dev/full: No space left on device; recording ends with 0 frames"
    assert (recorder.frames, recorder.lost) == (0, 5)
    recorder.put(made(traffic(2)))
    assert recorder.lost == 7
    with pytest.raises(TargetError, match="/dev/full: No space left on device"):
        FileRecorder(RecordingPlan("/dev/full", "pcapng"))


def waiting_in(pipe: int) -> int:
    """Bytes that nobody has read yet."""
    answer = fcntl.ioctl(pipe, termios.FIONREAD, bytes(4))
    return int.from_bytes(answer, sys.byteorder)


def test_a_slow_reader_loses_what_is_told_to_be_lost(tmp_path: Path) -> None:
    """Nobody waits for it; behind the loss the recording says how much is missing, from when to when."""
    fifo, size = tmp_path / "slow.log", 1000
    os.mkfifo(fifo)
    holder = os.open(fifo, os.O_RDWR)
    recorder = FileRecorder(RecordingPlan(str(fifo), "candump"), most=3 * size, flushed=0.0)
    pieces = as_recorded(cut(traffic(20 * size), range(0, 20 * size, size)))[1:]
    for piece in pieces[:2]:
        recorder.put(piece)
    wait_until(lambda: waiting_in(holder) > 60_000)
    for piece in pieces[2:19]:
        recorder.put(piece)
    lost = recorder.lost
    assert lost >= 13 * size
    assert recorder.notes() == ["the disk is too slow: frames are missing in the recording"]
    copy = tmp_path / "copy.log"
    with copy.open("wb") as out, subprocess.Popen(["cat", str(fifo)], stdout=out) as cat:
        wait_until(lambda: recorder.frames + lost >= 19 * size)
        recorder.put(pieces[19])
        recorder.close()
        os.close(holder)
        cat.wait(LIMIT)
    rows = stored(copy)
    kept = [row for row in rows if isinstance(row, Frame)]
    drops = [row for row in rows if isinstance(row, Lost)]
    assert (recorder.lost, recorder.problem) == (lost, None)
    assert len(kept) + lost == 20 * size
    assert sum(drop.frames for drop in drops) == lost
    at = rows.index(drops[0])
    before, behind = rows[at - 1], rows[at + 2]
    assert drops == [Lost(before.t + MS, "can0", lost - 1), Lost(behind.t - MS, "can0", 1)]
    assert kept == [row for row in traffic(20 * size) if not before.t < (row.t or 0) < behind.t]


class Disk:
    """Takes as many pieces as it is allowed to, and tells of each that it is asked to take."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.allowed, self.asked = Semaphore(0), Semaphore(0)
        self._write = Files.write
        monkeypatch.setattr(Files, "write", self._taker())

    def _taker(self) -> Callable[[Files, FrameBatch], None]:
        def take(files: Files, piece: FrameBatch) -> None:
            self.asked.release()
            assert self.allowed.acquire(timeout=LIMIT)
            self._write(files, piece)

        return take


@pytest.mark.parametrize("suffix", [".log", ".mcap", ".pcapng"])
def test_what_was_received_and_what_was_dropped_is_what_was_sent(
    suffix: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Error frames and losses of the kernel are counted as frames are; what was said of the session stays."""
    disk, path = Disk(monkeypatch), tmp_path / f"a{suffix}"
    errors = [Fault(START + n * MS, "can0") for n in (100, 101, 102)]
    drops = [Lost(START + 110 * MS, "can0", 1000), Lost(START + 111 * MS, "can1", 50)]
    mark = Note(START + 112 * MS, "mark 1")
    with FileRecorder(plan(path), most=8) as recorder:
        recorder.put(made(traffic(8), ["can0", "can1"]))
        assert disk.asked.acquire(timeout=LIMIT)
        for rows in (errors, drops, [mark], [*traffic(2, first=120), replace(mark, text="mark 2")]):
            recorder.put(made(rows, ["can0", "can1"]))
        assert recorder.lost == 5
        assert recorder.notes().count("the disk is too slow: frames are missing in the recording") == 1
        disk.allowed.release(100)
        wait_until(lambda: recorder.frames == 8)
        recorder.put(made(traffic(1, first=130), ["can0", "can1"]))
    rows = stored(path)
    kept = [row for row in rows if isinstance(row, Frame)]
    assert [row.t for row in kept] == [START + n * MS for n in (*range(8), 130)]
    lost = {
        bus: sum(row.frames for row in rows if isinstance(row, Lost) and row.bus == bus) for bus in ("can0", "can1")
    }
    assert lost == {"can0": 3 + 1000 + 2, "can1": 50}
    assert [row.text.lstrip("# ") for row in rows if isinstance(row, Note)] == ["mark 1", "mark 2"]
    assert (recorder.lost, recorder.frames) == (5, 9)


def test_error_frames_that_stand_in_the_file_are_not_lost(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """When it fails later."""
    with FileRecorder(plan(tmp_path / "a.log"), flushed=0.0) as recorder:
        recorder.put(made([Fault(START, "can0"), *traffic(2)]))
        wait_until(lambda: recorder.frames == 2)
        monkeypatch.setattr(Files, "write", lambda *_: broken(0))
        recorder.put(made([Fault(START, "can0"), *traffic(3)]))
        wait_until(lambda: recorder.problem is not None)
        assert (recorder.frames, recorder.lost) == (2, 4)
        recorder.put(made([Fault(START, "can0")]))
        assert recorder.lost == 5


def test_a_slow_disk_is_waited_for_while_it_takes_something(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """At the end, each time that it has taken a piece."""
    disk, path = Disk(monkeypatch), tmp_path / "a.log"
    recorder = FileRecorder(plan(path))
    for n in range(5):
        recorder.put(made(traffic(10, first=10 * n)))
    join = recorder._thread.join

    def take_one(timeout: float) -> None:
        assert timeout == recording.PATIENCE
        waiting = recorder._waiting
        disk.allowed.release()
        wait_until(lambda: recorder._waiting < waiting)
        if not recorder._waiting:
            join()

    monkeypatch.setattr(recorder._thread, "join", take_one)
    recorder.close()
    assert (recorder.frames, recorder.lost, recorder.problem) == (50, 0, None)
    assert stored(path) == traffic(50)


def test_an_output_that_does_not_wait_is_waited_for(monkeypatch: pytest.MonkeyPatch) -> None:
    """Whoever shares a pipe may have told it not to."""
    reading, writing = os.pipe()
    os.set_blocking(writing, False)
    monkeypatch.setattr(os, "dup", lambda _: writing)
    recorder = FileRecorder(RecordingPlan("-", "candump"), flushed=0.0)
    recorder.put(made(traffic(10_000)))
    wait_until(lambda: waiting_in(reading) > 60_000)
    with os.fdopen(reading, "rb") as file, ThreadPoolExecutor(1) as other:
        read = other.submit(file.read)
        recorder.close()
        assert read.result(LIMIT).count(b"\n") == 10_000
    assert (recorder.frames, recorder.lost, recorder.problem) == (10_000, 0, None)


def test_a_disk_that_never_answers_does_not_hold_the_session(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("analyzer.live.recording.file_recorder.PATIENCE", 0.1)
    fifo = tmp_path / "stuck.log"
    os.mkfifo(fifo)
    holder = os.open(fifo, os.O_RDWR)
    recorder = FileRecorder(RecordingPlan(str(fifo), "candump"), flushed=0.0)
    recorder.put(made(traffic(10_000)))
    wait_until(lambda: waiting_in(holder) > 60_000)
    recorder.put(made(traffic(20)))
    recorder.close()
    assert recorder.problem == f"{fifo}: takes no more data; what follows is not recorded"
    assert (recorder.lost, recorder.frames) == (10_020, 0)
    os.read(holder, 1 << 20)  # lets the thread go
    os.close(holder)


def test_a_reader_that_goes_away(tmp_path: Path) -> None:
    fifo = tmp_path / "gone.log"
    os.mkfifo(fifo)
    holder = os.open(fifo, os.O_RDWR)
    recorder = FileRecorder(RecordingPlan(str(fifo), "candump"), flushed=0.0)
    os.close(holder)
    recorder.put(made(traffic(10)))
    wait_until(lambda: recorder.problem is not None)
    assert recorder.problem == f"{fifo}: nobody reads it any more; recording ends with 0 frames"
    recorder.close()
    assert (recorder.frames, recorder.lost) == (0, 10)


def test_a_file_that_exists_is_safe(tmp_path: Path) -> None:
    path = tmp_path / "a.log"
    path.write_text("precious")
    with pytest.raises(TargetError, match=r"a\.log: exists \(--force writes over it\)"):
        FileRecorder(plan(path))
    assert path.read_text() == "precious"
    record(path, [made(traffic(1))])
    assert stored(path) == traffic(1)
    for bad, why in ((tmp_path, "Is a directory"), (tmp_path / "no" / "a.log", "No such file"), (Path("a\0b"), "null")):
        with pytest.raises(TargetError, match=why):
            FileRecorder(replace(plan(path), path=str(bad)))


def test_a_disk_that_takes_its_time_does_not_hold_up_the_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """What the system has survives a kill, whether the disk has it or not."""
    asked, done = Event(), Event()

    def slowly(_: int) -> None:
        asked.set()
        assert done.wait(LIMIT)

    monkeypatch.setattr(os, "fsync", slowly)
    path = tmp_path / "a.log"
    with FileRecorder(plan(path), flushed=0.0, synced=0.0) as recorder:
        recorder.put(made(traffic(1)))
        assert asked.wait(LIMIT)
        for n in range(1, 4):
            recorder.put(made(traffic(1, first=n)))
            wait_until(lambda n=n: frames_in(path) == traffic(n + 1))  # type: ignore[misc]
        done.set()


def test_a_disk_that_has_lost_what_it_took(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "a.log"
    with FileRecorder(plan(path), flushed=0.0, synced=0.0) as recorder:
        monkeypatch.setattr(os, "fsync", broken)
        recorder.put(made(traffic(1)))
        wait_until(lambda: bool(recorder.put(made(traffic(1))) or recorder.problem))
        assert str(recorder.problem).startswith(f"{path}: Input/output error; recording ends with ")


def broken(_: int) -> None:
    raise OSError(errno.EIO, os.strerror(errno.EIO))


def test_rows_go_to_the_disk_by_time(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    synced: list[int] = []
    monkeypatch.setattr(os, "fsync", synced.append)
    with FileRecorder(plan(tmp_path / "a.log"), flushed=0.0, synced=0.05) as recorder:
        recorder.put(made(traffic(1)))
        wait_until(lambda: len(synced) == 1)
        recorder.put(made(traffic(1)))
        wait_until(lambda: len(synced) == 2)
    assert len(synced) == 3
