"""A text that ends in the middle of a line is damaged, wherever that is, and it makes no sender break the protocol."""

from __future__ import annotations

import gzip
from functools import cache
from typing import TYPE_CHECKING, Any

import pytest
import zstandard
from kit import CAPTURES
from kit.command import HOVER
from kit.libraries import library_file
from kit.rows import Frame, records, text

import analyzer
from analyzer.cli import main
from analyzer.decode.engine import Engine
from analyzer.sources import Source
from analyzer.sources.native import rows

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator
    from pathlib import Path

LINES = 1200  # more than a second
WORDS = "the capture ends in the middle of this line: "


@cache
def capture(form: str) -> bytes:
    """The start of a flight in one of the formats that are text; on the screen it is that of `candump -t a`."""
    log = b"".join(HOVER.read_bytes().splitlines(keepends=True)[:LINES])
    if form == ".log":
        return log
    if form == "crlf.log":
        return log.replace(b"\n", b"\r\n")
    frames = [frame for frame in records(text(log)) if isinstance(frame, Frame)]
    if form != "screen.log":
        return library_file(form, frames)
    shown = (
        f" ({(frame.t or 0) / 10**9:.6f})  can0  {frame.id:08X}   [{len(frame.data)}]  {frame.data.hex(' ').upper()}\n"
        for frame in frames
    )
    return "".join(shown).encode()


FORMS = (".log", "crlf.log", "screen.log", ".asc", ".trc", ".csv")


def places(form: str, data: bytes, last: int) -> Iterator[int]:
    """Where the last lines can be cut: behind each of their bytes but the ends of lines.

    TRC states how many bytes a line has: with the last of them it is whole.
    """
    start = len(data) - sum(map(len, data.splitlines(keepends=True)[-last:]))
    ends = (end for end in range(start + 1, len(data)) if data[end - 1] != ord("\n"))
    return (end for end in ends if form != ".trc" or data[end:].strip(b" ")[:1] not in b"\r\n")


def broken(report: Any) -> set[tuple[str, str]]:
    return {(one.rule, one.text) for one in report.findings if (one.category, one.severity) == ("protocol", "error")}


def reported(path: Path, data: bytes) -> Any:
    path.write_bytes(data)
    return analyzer.check(path, fail_on="protocol:error,device:error")


def check_cut(path: Path, whole: bytes, end: int, before: set[tuple[str, str]]) -> None:
    """State what a capture says of itself that is cut there; `before` is what is broken in it anyhow."""
    report = reported(path, whole[:end])
    assert report.gate.exit_status == 3
    assert broken(report) <= before
    (capture,) = report.captures
    assert f"byte {end}: the capture ends in the middle of a line" in capture.damage
    number = whole[:end].count(b"\n") + 1
    (one,) = (one for one in report.findings if one.rule == "CAP-003")
    assert (one.count, one.severity, one.category) == (1, "error", "capture")
    assert one.text.startswith(f"line {number}: {WORDS}")


@pytest.mark.sampled(4)
@pytest.mark.parametrize("form", FORMS)
def test_a_cut_line_is_damage(tmp_path: Path, form: str) -> None:
    whole = capture(form)
    path = tmp_path / f"cut{form}"
    before = reported(path, whole)
    assert before.gate.exit_status == 0
    check_cut(path, whole, len(whole) - 4, broken(before))


@pytest.mark.slow
@pytest.mark.parametrize("form", FORMS)
def test_a_line_may_be_cut_at_any_place(tmp_path: Path, form: str) -> None:
    whole = capture(form)
    path = tmp_path / f"cut{form}"
    before = broken(reported(path, whole))
    for end in places(form, whole, 2):
        check_cut(path, whole, end, before)


@pytest.mark.slow
@pytest.mark.parametrize("form", FORMS)
def test_every_line_is_accounted_for(form: str) -> None:
    """At any place, in pieces of any size; what stands before the cut is as it was."""
    lines = capture(form).splitlines(keepends=True)[:40]
    whole, before = b"".join(lines), {k: _frames(form, b"".join(lines[:k])) for k in range(30, 40)}
    for end in places(form, whole, 3):
        for size in (1 << 20, 7):
            engine = Engine()
            source = Source(_Named(f"cut{form}", whole[:end], size))
            frames = sum(len(batch.frames) for batch in engine.run(source.chunks()))
            counts = engine.totals.lines
            assert engine.totals.balanced
            assert counts["lines"] == whole[:end].count(b"\n") + 1
            assert (counts["unreadable"], counts["frames"], frames) == (1, before[counts["lines"] - 1], frames)
            assert source.damage is not None


def _frames(form: str, data: bytes) -> int:
    source = Source(_Named(form, data, len(data)))
    return sum(len(batch.frames) for batch in Engine().run(source.chunks()))


class _Named:
    """A file object that gives so many bytes at a time."""

    def __init__(self, name: str, data: bytes, step: int) -> None:
        self.name, self._data, self._step, self._at = name, data, step, 0

    def read(self, size: int, /) -> bytes:
        piece = self._data[self._at :][: min(size, self._step)]
        self._at += len(piece)
        return piece


def _is_frame(line: bytes) -> bool:
    return b"can0" in line or line[:1].isdigit() or b" Rx " in line or line.strip()[:1].isdigit()


@pytest.mark.parametrize("pack", [gzip.compress, zstandard.compress])
@pytest.mark.parametrize("form", FORMS)
def test_a_cut_line_that_is_packed(tmp_path: Path, form: str, pack: Callable[[bytes], bytes]) -> None:
    whole = capture(form)
    path = tmp_path / f"cut{form}.gz"
    path.write_bytes(pack(whole[:-9]))
    opened = analyzer.open_capture(path)
    assert opened.table("events").to_pylist()[-1]["text"].startswith(WORDS)
    assert str(opened.damage) == (
        f"{path}: byte {len(whole) - 9} of the unpacked data: the capture ends in the middle of a line"
    )


@pytest.mark.parametrize("pack", [gzip.compress, zstandard.compress])
def test_what_is_cut_while_it_is_packed(tmp_path: Path, pack: Callable[[bytes], bytes]) -> None:
    """The compression says that it ends early, and the text that came of it where that is."""
    whole = capture(".log")
    packed = pack(whole[:-500]) + pack(whole[-500:])
    report = reported(tmp_path / "cut.log.gz", packed[: len(packed) - 40])
    assert report.gate.exit_status == 3
    assert "data ends early" in report.captures[0].damage
    assert report.captures[0].damage.count("ends") == 1


def test_the_last_line_of_a_capture_that_is_merged(tmp_path: Path) -> None:
    """Each capture has its own last line."""
    whole = capture(".log")
    paths = [tmp_path / "a.log", tmp_path / "b.log"]
    paths[0].write_bytes(whole[:-7])
    paths[1].write_bytes(whole.replace(b" can0 ", b" can1 "))
    opened = analyzer.open_capture(paths)
    events = [row["text"] for row in opened.table("events").to_pylist()]
    assert [one for one in events if "ends" in one] == [f"{paths[0]}: line {LINES}: {WORDS}{_last(whole[:-7])}"]
    assert opened.totals.balanced


def _last(data: bytes) -> str:
    return data.splitlines()[-1].decode()


@pytest.mark.parametrize("form", FORMS)
def test_nothing_is_cut_when_the_reading_is_stopped(form: str) -> None:
    """Nobody knows then how the line goes on: it is left out."""
    whole = capture(form)
    for size in (1, 1 << 14):
        source = Source(_Named(f"stopped{form}", whole[:-9], size))
        engine = Engine()
        for chunk in source.chunks():
            list(engine.feed(chunk))
            source.stopped = True
        engine.finish()
        assert (source.damage, engine.totals.lines["unreadable"]) == (None, 0)
        assert engine.totals.balanced


@pytest.mark.parametrize("form", FORMS)
def test_a_line_that_grows_is_waited_for(tmp_path: Path, form: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """It counts when it is whole; a line that is not, as the waiting ends, is left out."""
    monkeypatch.setattr("analyzer.sources.stored.FOLLOW_PAUSE", 0)
    whole = capture(form)
    path = tmp_path / f"growing{form}"
    path.write_bytes(whole[:-9])
    source = Source(str(path), follow=True)
    batches = rows(source.chunks())

    def lines() -> int:
        """As far as there is something to read."""
        found = 0
        for batch in batches:
            if isinstance(batch, bytes):
                break
            assert not batch.lines["unreadable"]
            found += batch.lines["lines"]
        return found

    total = whole.count(b"\n")
    assert lines() == total - 1
    with path.open("ab", buffering=0) as file:
        file.write(whole[-9:])
        assert lines() == 1
        file.write(whole.splitlines(keepends=True)[-1][:-5])
    assert lines() == 0
    source.stopped = True
    assert sum(batch.lines["lines"] for batch in batches if not isinstance(batch, bytes)) == 0
    assert source.damage is None


@pytest.mark.parametrize("form", FORMS)
def test_a_line_whose_log_is_emptied_is_none(tmp_path: Path, form: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Its rest is lost, wherever that is."""
    monkeypatch.setattr("analyzer.sources.stored.FOLLOW_PAUSE", 0)
    whole = b"".join(capture(form).splitlines(keepends=True)[:40])
    line = next(line for line in reversed(whole.splitlines(keepends=True)) if _is_frame(line))
    kept = 2 if form.endswith("log") else line.rstrip().count(b" ")
    for end in range(1, len(line.rstrip()) - kept):
        path = tmp_path / f"emptied{form}"
        path.write_bytes(whole + line[:end])
        source = Source(str(path), follow=True)
        batches = rows(source.chunks())
        counts: list[dict[str, int]] = []
        for batch in batches:
            if isinstance(batch, bytes):
                break
            counts.append(batch.lines)
        path.write_bytes(b"\n")
        source.stopped = True
        counts += [batch.lines for batch in batches if not isinstance(batch, bytes)]
        assert sum(count["unreadable"] for count in counts) == 1


def test_what_is_written_ends_its_last_line(tmp_path: Path) -> None:
    """And the line that is cut is not written."""
    old, new = tmp_path / "cut.log", tmp_path / "new.log"
    old.write_bytes(capture(".log")[:-7])
    assert main(["convert", str(old), str(new)]) == 3
    assert (new.read_bytes().count(b"\n"), new.read_bytes()[-1:]) == (LINES - 1, b"\n")
    assert main(["check", str(CAPTURES / "faults.log"), "--select", "TRF-010", "--extract", str(tmp_path / "out")]) == 1
    extracts = list((tmp_path / "out").glob("*.log"))
    assert extracts
    assert all(path.read_bytes()[-1:] == b"\n" for path in extracts)
