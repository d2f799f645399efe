"""A recording of a live bus gives back what came, whatever ends it: row by row, and finding by finding."""

from __future__ import annotations

import gzip
import signal
from dataclasses import replace
from typing import TYPE_CHECKING

import pytest
import zstandard
from hypothesis import example, given
from hypothesis import strategies as st
from kit.command import HOVER, LIMIT, wait_until
from kit.judged import registry
from kit.live import (
    MS,
    Lost,
    Note,
    Row,
    as_recorded,
    child,
    cut,
    frames_in,
    made,
    plan,
    record,
    sessions,
    stored,
    taken,
    traffic,
)
from kit.rows import Fault, Frame, text
from kit.strategies import examples

from analyzer.decode.engine import Engine
from analyzer.live.recording.file_recorder import FileRecorder
from analyzer.rules.catalogue import load
from analyzer.rules.judge import Judge
from analyzer.rules.settings import Settings
from analyzer.sinks import FORMS
from analyzer.sources import Source
from analyzer.sources.native import rows as rows_of

if TYPE_CHECKING:
    from collections.abc import Iterable
    from pathlib import Path

    from analyzer._native import FrameBatch

SUFFIXES = (".log", ".mcap", ".pcapng", ".log.gz", ".pcapng.zst", ".mcap.gz")


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


@pytest.mark.sampled(4)
@pytest.mark.parametrize("suffix", SUFFIXES)
@examples(40)
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


def judged(pieces: Iterable[bytes | FrameBatch]) -> tuple[object, ...]:
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


@pytest.mark.slow
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
from kit.live import as_recorded, cut, plan, traffic
from analyzer.live.recording.file_recorder import FileRecorder
recorder = FileRecorder(plan(Path(sys.argv[1])))
n = 0
for line in sys.stdin:
    for piece in as_recorded(cut(traffic(int(line), first=n), [])):
        recorder.put(piece)
    n += int(line)
    print(n, flush=True)
"""


@pytest.mark.slow
@pytest.mark.parametrize("suffix", SUFFIXES)
def test_what_is_killed_can_be_read(suffix: str, tmp_path: Path) -> None:
    """Up to the last half second, without the end that others write; only MCAP then lacks something."""
    path = tmp_path / f"a{suffix}"
    with child(path, CHILD) as process:
        assert process.stdin is not None
        assert process.stdout is not None
        for more, total in ((300, 300), (1, 301), (1000, 1301)):
            process.stdin.write(b"%d\n" % more)
            process.stdin.flush()
            process.stdout.readline()
            wait_until(lambda total=total: len(frames_in(path)) == total)  # type: ignore[misc]
        process.send_signal(signal.SIGKILL)
        process.wait(LIMIT)
    assert stored(path, sound=".mcap" not in suffix) == traffic(1301)


def test_packed_files_can_be_unpacked_whole_at_any_moment(tmp_path: Path) -> None:
    for suffix, unpack in (".gz", gzip.decompress), (".zst", unpacked):
        path = tmp_path / f"a.log{suffix}"
        with FileRecorder(plan(path), flushed=0.0) as recorder:
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
    recorder = FileRecorder(plan(path), flushed=0.0)
    recorder.put(as_recorded([made(traffic(3))])[0])
    wait_until(lambda: len(frames_in(path)) == 3)
    source = Source(str(path))
    list(source.chunks())
    assert str(source.damage).endswith("MCAP data ends early")
    recorder.close()
    assert stored(path) == traffic(3)


@pytest.mark.slow
def test_a_recording_is_there_at_once(tmp_path: Path) -> None:
    """It does not wait for more rows, and an empty one is what its format makes of nothing."""
    for suffix in (".log", ".mcap", ".pcapng"):
        path = tmp_path / f"a{suffix}"
        with FileRecorder(plan(path)) as recorder:
            assert path.exists()
            recorder.put(made(traffic(1)))
            wait_until(lambda path=path: frames_in(path) == traffic(1))  # type: ignore[misc]
        assert stored(path) == traffic(1)
        record(path, [])
        assert stored(path) == []
