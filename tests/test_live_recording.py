"""A recording of a live bus gives back what came, whatever ends it: row by row, and finding by finding."""

from __future__ import annotations

import fcntl
import gzip
import os
import signal
import subprocess
import sys
import termios
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest
import zstandard
from command import HOVER, LIMIT, environment, wait_until
from hypothesis import HealthCheck, example, given, settings
from hypothesis import strategies as st
from judged import registry
from live_pieces import MS, Lost, Note, Row, cut, made, sessions, stored, taken, traffic
from recorded import Fault, Frame, text

from analyzer.engine import Engine
from analyzer.live.recorded import AsRecorded
from analyzer.live.recording import Recorder, RecordingPlan
from analyzer.rules.catalogue import load
from analyzer.rules.judge import Judge
from analyzer.rules.settings import Settings
from analyzer.sinks import FORMS, form_of
from analyzer.sinks.atomic import TargetError
from analyzer.sources import Source
from analyzer.sources.native import rows as rows_of

if TYPE_CHECKING:
    from collections.abc import Iterable

    from analyzer._native import Piece

LAWS = settings(suppress_health_check=[HealthCheck.function_scoped_fixture], deadline=None)
SUFFIXES = (".log", ".mcap", ".pcapng", ".log.gz", ".pcapng.zst", ".mcap.gz")


def plan(path: Path, **more: Any) -> RecordingPlan:
    form, packing = form_of(path.name)
    return RecordingPlan(str(path), form, packing, **more)


def record(path: Path, pieces: Iterable[Piece], **more: Any) -> Recorder:
    """A recording of these pieces, finished."""
    with Recorder(plan(path, force=True), **more) as recorder:
        for piece in pieces:
            recorder.put(piece)
    return recorder


def as_recorded(pieces: Iterable[Piece]) -> list[Piece]:
    canonical = AsRecorded()
    return [canonical.of(piece) for piece in pieces]


@LAWS
@given(rows=sessions(), cuts=st.lists(st.integers(0, 25), max_size=4))
@example(rows=[Note(5, ""), Note(6, "# (1700000000.000000001) x"), Note(7, "\n\x1b")], cuts=[])
@example(rows=[Lost(5, "any", 1), Lost(6, "a,b", 2**32 - 1), Lost(7, "a'b", 1), Frame(8, "a_b")], cuts=[2])
def test_the_engine_gets_what_came(rows: list[Row], cuts: list[int]) -> None:
    """All but names and texts, which are made to fit, and no two names into one."""
    got = taken(as_recorded(cut(rows, cuts)))
    names: dict[str, str] = {}
    for row, came in zip(got, rows, strict=True):
        if isinstance(row, Note):
            assert isinstance(came, Note)
            assert row.t == came.t
            assert row.text.startswith(("#", ";"))
            continue
        assert not isinstance(came, Note)
        assert names.setdefault(came.bus, row.bus) == row.bus
        assert replace(row, bus=came.bus) == came
    assert len(set(names.values())) == len(names)


@pytest.mark.parametrize("suffix", SUFFIXES)
@settings(LAWS, max_examples=40)
@given(rows=sessions(), cuts=st.lists(st.integers(0, 25), max_size=4), other=st.lists(st.integers(0, 25), max_size=2))
def test_a_recording_gives_back_what_the_engine_got(
    suffix: str, rows: list[Row], cuts: list[int], other: list[int], tmp_path: Path
) -> None:
    path = tmp_path / f"a{suffix}"
    pieces = as_recorded(cut(rows, cuts))
    recorder = record(path, pieces)
    assert stored(path) == taken(pieces)
    assert (recorder.problem, recorder.lost, recorder.frames) == (None, 0, sum(isinstance(r, Frame) for r in rows))
    assert recorder.bytes == path.stat().st_size
    again = as_recorded(cut(rows, other))
    assert taken(again) == taken(pieces)


def judged(pieces: Iterable[bytes | Piece]) -> tuple[object, ...]:
    """Everything that the rules have to say."""
    judge, engine = Judge(registry(), Settings(select=tuple(load(registry())))), Engine(registry())
    for piece in pieces:
        for batch in engine.feed(piece):
            judge.feed(batch)
        judge.feed(engine.flush())
    judge.feed(engine.finish())
    outcome = judge.finish()
    return [(key, repr(run)) for key, run in outcome.runs], engine.buses, engine.stamps, engine.totals.verdicts


def flight() -> list[Row]:
    """A flight with what a bench may add: losses, error frames, marks, other buses, one of which appears late."""
    rows: list[Row] = [row for row in taken(text(HOVER.read_bytes()[:400_000])) if isinstance(row, Frame)]
    start = rows[0].t
    assert start is not None
    rows = [row for row in rows if not start + 1500 * MS < (row.t or 0) < start + 1520 * MS]
    rows = [replace(row, bus="virtual:a b" if n % 7 == 0 else row.bus) if isinstance(row, Frame) else row
            for n, row in enumerate(rows)]  # fmt: skip
    more: list[Row] = [
        Lost(start + 1521 * MS + 3, "can0", 17), Note(start + 2000 * MS, "mark 1"),
        Fault(start + 2100 * MS, "can0", 0x204, bytes([0, 12, 0, 0, 0, 0, 96, 135])),
        Fault(start + 2101 * MS, "virtual:a b", 4, bytes([0, 1, 0, 0, 0, 0, 0, 0])),
        Frame(start + 2200 * MS, "can0", 0x123, 8 | 16, bytes(64)), Frame(start + 2201 * MS, "can0", 0x123, 2, b"", 8),
        Frame(start + 2202 * MS, "late", 0x05040601, 1, bytes(8), 12), Lost(start + 2203 * MS, "later still", 1),
    ]  # fmt: skip
    return sorted([*rows, *more], key=lambda row: row.t or 0)


@pytest.mark.parametrize("form", FORMS)
def test_findings_of_the_session_are_those_of_its_recording(form: str, tmp_path: Path) -> None:
    rows = flight()
    pieces = as_recorded(cut(rows, range(0, len(rows), 97), names=["unused", "virtual:a b"]))
    path = tmp_path / f"a.{form if form != 'candump' else 'log'}"
    record(path, pieces)
    live = judged(pieces)
    assert len(live[0]) > 5
    assert judged(rows_of(Source(str(path)).chunks())) == live


CHILD = """
import sys
sys.path[:0] = sys.argv[2].split(":")
from pathlib import Path
from live_pieces import cut, traffic
from test_live_recording import as_recorded, plan
from analyzer.live.recording import Recorder
recorder = Recorder(plan(Path(sys.argv[1])))
n = 0
for line in sys.stdin:
    for piece in as_recorded(cut(traffic(int(line), first=n), [])):
        recorder.put(piece)
    n += int(line)
    print(n, flush=True)
"""


def child(path: Path, code: str = CHILD, **more: Any) -> subprocess.Popen[bytes]:
    folders = os.pathsep.join([str(Path(__file__).parent), str(Path(__file__).parents[1])])
    command = [sys.executable, "-c", code, str(path), folders]
    return subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, env=environment(), **more)


def frames_in(path: Path) -> list[Row]:
    """As far as a file can be read that may not have come to its end."""
    try:
        return stored(path, sound=False) if path.exists() else []
    except Exception:  # noqa: BLE001 - a reader may see half a file
        return []


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_what_is_killed_can_be_read(suffix: str, tmp_path: Path) -> None:
    """Up to the last half second, without the end that others write; only MCAP then lacks something."""
    path = tmp_path / f"a{suffix}"
    with child(path) as process:
        assert process.stdin is not None
        assert process.stdout is not None
        for total in (300, 301, 1301):
            process.stdin.write(b"%d\n" % (total - len(frames_in(path))))
            process.stdin.flush()
            process.stdout.readline()
            wait_until(lambda total=total: len(frames_in(path)) == total)  # type: ignore[misc]
        process.send_signal(signal.SIGKILL)
        process.wait(LIMIT)
    assert stored(path, sound=".mcap" not in suffix) == traffic(1301)


def test_packed_files_can_be_unpacked_whole_at_any_moment(tmp_path: Path) -> None:
    for suffix, unpack in (".gz", gzip.decompress), (".zst", unpacked):
        path = tmp_path / f"a.log{suffix}"
        with Recorder(plan(path), flushed=0.0) as recorder:
            for n in range(3):
                recorder.put(made(traffic(1, first=n)))
                wait_until(lambda n=n: recorder.frames == n + 1)  # type: ignore[misc]
                assert unpack(path.read_bytes()).count(b"\n") == n + 1


def unpacked(data: bytes) -> bytes:
    """Of zstd, which must come to its end."""
    out, rest = b"", data
    while rest:
        frame = zstandard.ZstdDecompressor().decompressobj()
        out += frame.decompress(rest)
        assert frame.eof
        rest = frame.unused_data
    return out


def test_an_mcap_file_that_was_killed_lacks_its_summary_only(tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"
    recorder = Recorder(plan(path), flushed=0.0)
    recorder.put(as_recorded([made(traffic(3))])[0])
    wait_until(lambda: len(frames_in(path)) == 3)
    source = Source(str(path))
    list(source.chunks())
    assert str(source.damage).endswith("MCAP data ends early")
    recorder.close()
    assert stored(path) == traffic(3)


FULL = """
import resource, signal
signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
resource.setrlimit(resource.RLIMIT_FSIZE, (20_000, 20_000))
import sys
sys.path[:0] = sys.argv[2].split(":")
from pathlib import Path
from command import wait_until
from live_pieces import cut, traffic
from test_live_recording import as_recorded, plan
from analyzer.live.recording import Recorder
recorder = Recorder(plan(Path(sys.argv[1])), flushed=0.0)
for n in range(0, 4000, 100):
    piece, = as_recorded(cut(traffic(100, first=n), []))
    recorder.put(piece)
    if recorder.problem is None:
        wait_until(lambda: recorder.frames == n + 100 or recorder.problem is not None)
recorder.close()
print(recorder.frames, recorder.lost, recorder.problem)
print(*recorder.notes(), sep="\\n")
"""


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
        recorder = Recorder(RecordingPlan("/dev/full", "candump"))
    except TargetError as error:
        pytest.fail(str(error))
    recorder.put(made(traffic(5)))
    recorder.close()
    assert recorder.problem == "/dev/full: No space left on device; recording ends with 0 frames"
    assert (recorder.frames, recorder.lost) == (0, 5)
    recorder.put(made(traffic(2)))
    assert recorder.lost == 7
    with pytest.raises(TargetError, match="/dev/full: No space left on device"):
        Recorder(RecordingPlan("/dev/full", "pcapng"))


def waiting_in(pipe: int) -> int:
    """Bytes that nobody has read yet."""
    answer = fcntl.ioctl(pipe, termios.FIONREAD, bytes(4))
    return int.from_bytes(answer, sys.byteorder)


def test_a_slow_reader_loses_what_is_told_to_be_lost(tmp_path: Path) -> None:
    """Nobody waits for it; behind the loss the recording says how much is missing, from when to when."""
    fifo, size = tmp_path / "slow.log", 1000
    os.mkfifo(fifo)
    holder = os.open(fifo, os.O_RDWR)
    recorder = Recorder(RecordingPlan(str(fifo), "candump"), most=3 * size, flushed=0.0)
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


def test_a_disk_that_never_answers_does_not_hold_the_session(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("analyzer.live.recording.PATIENCE", 0.1)
    fifo = tmp_path / "stuck.log"
    os.mkfifo(fifo)
    holder = os.open(fifo, os.O_RDWR)
    recorder = Recorder(RecordingPlan(str(fifo), "candump"), flushed=0.0)
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
    recorder = Recorder(RecordingPlan(str(fifo), "candump"), flushed=0.0)
    os.close(holder)
    recorder.put(made(traffic(10)))
    wait_until(lambda: recorder.problem is not None)
    assert recorder.problem == f"{fifo}: Broken pipe; recording ends with 0 frames"
    recorder.close()
    assert (recorder.frames, recorder.lost) == (0, 10)


def test_a_file_that_exists_is_safe(tmp_path: Path) -> None:
    path = tmp_path / "a.log"
    path.write_text("precious")
    with pytest.raises(TargetError, match=r"a\.log: exists \(--force writes over it\)"):
        Recorder(plan(path))
    assert path.read_text() == "precious"
    record(path, [made(traffic(1))])
    assert stored(path) == traffic(1)
    for bad, why in ((tmp_path, "Is a directory"), (tmp_path / "no" / "a.log", "No such file"), (Path("a\0b"), "null")):
        with pytest.raises(TargetError, match=why):
            Recorder(replace(plan(path), path=str(bad)))


def test_a_recording_is_there_at_once(tmp_path: Path) -> None:
    """It does not wait for more rows, and an empty one is what its format makes of nothing."""
    for suffix in (".log", ".mcap", ".pcapng"):
        path = tmp_path / f"a{suffix}"
        with Recorder(plan(path)) as recorder:
            assert path.exists()
            recorder.put(made(traffic(1)))
            wait_until(lambda path=path: frames_in(path) == traffic(1))  # type: ignore[misc]
        assert stored(path) == traffic(1)
        record(path, [])
        assert stored(path) == []


def test_rows_go_to_the_disk_by_time(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    synced: list[int] = []
    monkeypatch.setattr(os, "fsync", synced.append)
    with Recorder(plan(tmp_path / "a.log"), flushed=0.0, synced=0.05) as recorder:
        recorder.put(made(traffic(1)))
        wait_until(lambda: len(synced) == 1)
        recorder.put(made(traffic(1)))
        wait_until(lambda: len(synced) == 2)
    assert len(synced) == 3
