"""A recording in several files: when a new one begins, what it is called, and that nothing is lost between them."""

from __future__ import annotations

import re
import time
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from kit.command import wait_until
from kit.live import MS, Note, Row, as_recorded, cut, made, plan, record, sessions, stored, taken, traffic
from kit.rows import Frame
from kit.strategies import examples
from kit.waiting import Clock

from analyzer.live.recording import files as files_module
from analyzer.live.recording.file_recorder import FileRecorder
from analyzer.live.recording.ring import Ring, RingPlan, parse_ring
from analyzer.sinks import split_name

if TYPE_CHECKING:
    from collections.abc import Sequence

    from analyzer._native import FrameBatch

LAWS = examples(40)
SECOND = 1_000_000_000


@pytest.mark.parametrize(
    ("texts", "found"),
    [
        ([], None),
        (["duration:60"], RingPlan(duration=60 * SECOND)),
        (["duration:1.5min", "duration:2h"], RingPlan(duration=7200 * SECOND)),
        (["interval:3600", "files:10"], RingPlan(interval=3600 * SECOND, files=10)),
        (["filesize:100"], RingPlan(size=100_000)),
        (["filesize:100MB"], RingPlan(size=100_000_000)),
        (["filesize:2GiB"], RingPlan(size=2 << 30)),
        (["filesize:5B", "packets:7"], RingPlan(size=5, frames=7)),
        (["frames:7"], RingPlan(frames=7)),
    ],
)
def test_conditions(texts: list[str], found: RingPlan | None) -> None:
    assert parse_ring(texts) == found


@pytest.mark.parametrize(
    ("text", "why"),
    [
        ("files:3", "-b files: says how many are kept; add duration:, interval:, filesize: or packets:"),
        ("filesize", "-b filesize: filesize: needs a value"),
        ("filesize:", "-b filesize:: filesize: needs a value"),
        ("size:3", "-b size:3: did you mean filesize:"),
        ("zzz:3", "-b zzz:3: there are duration, interval, filesize, packets, frames, files"),
        ("filesize:3MBit", "-b filesize:3MBit: '3MBit' is not a size (100 are kB, 20MB, 1GiB)"),
        ("filesize:0", "-b filesize:0: '0' is not a size (100 are kB, 20MB, 1GiB)"),
        ("packets:0", "-b packets:0: '0' is not a whole number above 0"),
        ("files:-1", "-b files:-1: '-1' is not a whole number above 0"),
        ("duration:0", "-b duration:0: no time at all"),
        ("duration:soon", "-b duration:soon: 'soon' is not a duration (10s, 250ms, 1.5min)"),
    ],
)
def test_conditions_that_are_none(text: str, why: str) -> None:
    with pytest.raises(ValueError, match=f"^{re.escape(why)}$"):
        parse_ring([text])


@pytest.mark.parametrize(
    ("path", "parts"),
    [("a.log", ("a", ".log")), ("/x.y/a.b.log.gz", ("/x.y/a.b", ".log.gz")), ("a.MCAP.ZST", ("a", ".MCAP.ZST")),
     ("d/a", ("d/a", "")), ("d.log/a", ("d.log/a", "")), ("a.gz", ("a", ".gz")), (".log", (".log", ""))],
)  # fmt: skip
def test_names_are_split(path: str, parts: tuple[str, str]) -> None:
    assert split_name(path) == parts


def ring(clock: Clock, path: str = "d/a.log", **conditions: Any) -> Ring:
    return Ring(RingPlan(**conditions), path, clock, lambda: clock.ns() / SECOND)


def test_names_tell_number_and_time(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("TZ", "UTC-2")
    time.tzset()
    try:
        clock = Clock(start=1_795_287_600 * SECOND)  # 2026-11-21 19:00:00 UTC
        one = ring(clock, "d.x/a.log.gz", frames=1)
        assert one.next_name() == "d.x/a_00001_20261121210000.log.gz"
        clock.passed += 61 * SECOND
        assert one.next_name() == "d.x/a_00002_20261121210101.log.gz"
    finally:
        monkeypatch.undo()
        time.tzset()


def test_a_file_lasts_so_long() -> None:
    clock = Clock()
    one = ring(clock, duration=60 * SECOND)
    for _ in range(2):
        one.next_name()
        clock.passed += 60 * SECOND - 1
        assert not one.over(1 << 40)
        clock.passed += 1
        assert one.over(0)
        clock.passed += 12345 * SECOND


def test_a_file_ends_with_the_hour() -> None:
    clock = Clock(start=1_795_287_600 * SECOND + 1800 * SECOND)
    one = ring(clock, interval=3600 * SECOND)
    one.next_name()
    clock.passed += 1799 * SECOND
    assert not one.over(0)
    clock.passed += SECOND
    assert one.over(0)
    one.next_name()
    assert not one.over(0)
    clock.passed += 3600 * SECOND
    assert one.over(0)


def test_a_file_has_so_many_bytes_and_frames() -> None:
    one = ring(Clock(), size=1000, frames=10)
    one.next_name()
    assert [one.over(size) for size in (999, 1000)] == [False, True]
    assert [one.left(count) for count in (0, 9, 10, 11)] == [10, 1, 0, 0]
    assert ring(Clock(), size=1000).left(5) is None


def ringed(path: Path, pieces: Sequence[FrameBatch], ring: RingPlan, **more: Any) -> FileRecorder:
    with FileRecorder(plan(path, ring=ring, **more)) as recorder:
        for piece in pieces:
            recorder.put(piece)
    return recorder


RINGS = st.one_of(
    st.builds(RingPlan, frames=st.integers(1, 9)),
    st.builds(RingPlan, size=st.integers(1, 2000)),
    st.builds(RingPlan, size=st.integers(1, 2000), frames=st.integers(1, 9)),
)


@pytest.mark.parametrize("suffix", [".log", ".mcap", ".pcapng", ".log.zst"])
@LAWS
@given(rows=sessions(), cuts=st.lists(st.integers(0, 25), max_size=3), chosen=RINGS, step=st.sampled_from([1, 3, 256]))
def test_all_files_together_are_the_recording(
    suffix: str, rows: list[Row], cuts: list[int], chosen: RingPlan, step: int, tmp_path_factory: pytest.TempPathFactory
) -> None:
    folder = tmp_path_factory.mktemp("ring")
    pieces = as_recorded(cut(rows, cuts))
    with pytest.MonkeyPatch.context() as patched:
        patched.setattr(files_module, "STEP", step)
        recorder = ringed(folder / f"a{suffix}", pieces, chosen)
    names = recorder.files
    assert names == sorted(str(path) for path in folder.iterdir())
    each = [stored(name) for name in names]
    assert [row for part in each for row in part] == taken(pieces)
    assert all(each) or not rows
    counts = [sum(isinstance(row, Frame) for row in part) for part in each]
    if chosen.frames is not None and chosen.size is None:
        assert all(count == chosen.frames for count in counts[:-1])
    assert all(count <= (chosen.frames or count) for count in counts)
    assert recorder.full == len(names) - 1
    assert (recorder.frames, recorder.lost) == (sum(counts), 0)
    assert recorder.bytes == sum(Path(name).stat().st_size for name in names)
    if suffix == ".log":
        record(folder / "whole.log", pieces)
        assert b"".join(Path(name).read_bytes() for name in names) == (folder / "whole.log").read_bytes()
    if suffix == ".pcapng":
        both = folder / "joined.pcapng"
        both.write_bytes(b"".join(Path(name).read_bytes() for name in names))
        assert stored(both) == taken(pieces)


@pytest.mark.parametrize("suffix", [".log", ".mcap", ".pcapng", ".log.gz", ".mcap.zst"])
def test_sizes_are_kept(suffix: str, tmp_path: Path) -> None:
    """But for the rows of one step, and what ends an MCAP file."""
    pieces = as_recorded(cut(traffic(20_000), range(0, 20_000, 700)))
    recorder = ringed(tmp_path / f"a{suffix}", pieces, RingPlan(size=50_000))
    sizes = [Path(name).stat().st_size for name in recorder.files]
    assert len(sizes) > 2
    assert all(50_000 <= size < 50_000 + files_module.STEP * 100 for size in sizes[:-1])


def test_the_oldest_file_goes_when_the_new_one_is_there(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    seen: list[tuple[str, list[str]]] = []
    unlink = Path.unlink

    def gone(path: Path, *, missing_ok: bool = False) -> None:
        seen.append((path.name[:7], sorted(other.name[:7] for other in tmp_path.iterdir())))
        unlink(path, missing_ok=missing_ok)

    monkeypatch.setattr(Path, "unlink", gone)
    recorder = ringed(tmp_path / "a.log", as_recorded(cut(traffic(10), [])), RingPlan(frames=2, files=2))
    assert seen == [(f"a_0000{n}", [f"a_0000{k}" for k in range(n, n + 3)]) for n in (1, 2, 3)]
    assert stored(*recorder.files) == traffic(4, first=6)
    assert (recorder.frames, recorder.lost, len(recorder.files)) == (10, 0, 2)


def test_a_file_that_cannot_be_deleted_is_told(tmp_path: Path) -> None:
    with FileRecorder(plan(tmp_path / "a.log", ring=RingPlan(frames=1, files=1)), flushed=0.0) as recorder:
        recorder.put(made(traffic(1)))
        wait_until(lambda: recorder.frames == 1)
        (first,) = recorder.files
        Path(first).unlink()
        Path(first).mkdir()
        recorder.put(made(traffic(1)))
        wait_until(lambda: recorder.frames == 2)
        assert recorder.notes() == [f"{first}: cannot be deleted: Is a directory"]
    assert recorder.problem is None


@pytest.mark.parametrize("suffix", [".log", ".mcap", ".log.gz"])
def test_a_file_that_cannot_be_opened_leaves_the_last_one_whole(suffix: str, tmp_path: Path) -> None:
    folder, moved = tmp_path / "old", tmp_path / "new"
    folder.mkdir()
    with FileRecorder(plan(folder / f"a{suffix}", ring=RingPlan(frames=3))) as recorder:
        folder.rename(moved)
        recorder.put(made(traffic(5)))
        wait_until(lambda: recorder.problem is not None)
        assert "No such file or directory; recording ends with 3 frames" in str(recorder.problem)
    assert (recorder.frames, recorder.lost) == (3, 2)
    assert stored(*moved.iterdir()) == traffic(3)


def test_a_file_of_that_name_is_safe(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Of a session that began in the same second."""
    monkeypatch.setattr(time, "strftime", lambda *_: "20261121190000")
    for _ in range(2):
        ringed(tmp_path / "a.log", [made(traffic(2))], RingPlan(frames=1))
    assert [path.name for path in sorted(tmp_path.iterdir())] == [f"a_0000{n}_20261121190000.log" for n in (1, 2, 3, 4)]
    assert stored(*sorted(tmp_path.iterdir())) == traffic(2) * 2


def test_the_last_file_takes_the_rest(tmp_path: Path) -> None:
    """What comes until the session has noticed that it is enough is recorded as well."""
    recorder = ringed(tmp_path / "a.log", as_recorded(cut(traffic(10), [3, 5])), RingPlan(frames=2), files=2)
    assert [len(stored(name)) for name in recorder.files] == [2, 8]
    assert recorder.full == 2


@pytest.mark.slow
def test_rotation_under_load(tmp_path: Path) -> None:
    """Pieces keep coming while files change, several times a second."""
    count, size = 200_000, 1000
    with FileRecorder(plan(tmp_path / "a.mcap", ring=RingPlan(frames=7001, size=100_000)), most=count) as recorder:
        for piece in as_recorded(cut(traffic(count), range(size, count, size))):
            recorder.put(piece)
    assert len(recorder.files) > 20
    assert (recorder.lost, recorder.problem, recorder.frames) == (0, None, count)
    assert stored(*recorder.files) == traffic(count)


def test_time_begins_a_new_file_with_the_next_row(tmp_path: Path) -> None:
    """A silent bus makes no empty files."""
    with FileRecorder(plan(tmp_path / "a.log", ring=RingPlan(duration=1)), flushed=0.0) as recorder:
        for n in range(3):
            recorder.put(made([*traffic(1, first=n), Note(n * MS, "x")]))
            wait_until(lambda n=n: recorder.frames == n + 1)  # type: ignore[misc]
    assert [len(stored(name)) for name in recorder.files] == [2, 2, 2]


def test_a_ring_needs_names() -> None:
    with pytest.raises(Exception, match="files of a ring need names"):
        FileRecorder(plan(Path("-"), ring=RingPlan(frames=1)))
