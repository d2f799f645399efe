"""Captures from binary file objects: what they give is what the same bytes give as a file, in every format."""

from __future__ import annotations

import errno
import gzip
import io
import os
import threading
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest
import zstandard
from kit import libraries, mcaps
from kit.command import CAPTURES, HOVER
from kit.rows import Frame, piece, plain, written

from analyzer import open_capture
from analyzer._native import FrameBatch
from analyzer.sources import CaptureError, Source, stored
from analyzer.sources.merge import Plan, open_captures
from analyzer.sources.native import rows
from analyzer.sources.stored import Stored
from analyzer.tables import EVENT_ROWS, wrap
from analyzer.window.cut import RECORDED

if TYPE_CHECKING:
    from collections.abc import Callable

SEEDS = CAPTURES.parent / "analyzer/native/fuzz/seeds/formats"
FRAMES = [Frame(1_700_000_000_000_000_000 + k * 1_000_000, f"can{k % 2}", k, data=bytes([k])) for k in range(1, 120)]
TEXT = b"".join(HOVER.read_bytes().splitlines(keepends=True)[:400])
CHUNK = 6  # opcode of MCAP


@cache
def capture(name: str) -> bytes:
    """Return a small capture of the format of this name."""
    suffix = Path(name).suffix
    if suffix in libraries.WRITERS:
        return libraries.library_file(suffix, FRAMES)
    if suffix in (".mcap", ".pcapng"):
        return written(suffix[1:], [piece(FRAMES)])[0]
    if suffix == ".seed":
        return (SEEDS / name.removesuffix(suffix)).read_bytes()[2:]
    pack: Callable[[bytes], bytes] = {".gz": gzip.compress, ".zst": zstandard.compress}.get(suffix, bytes)
    return pack(TEXT)


NAMES = (
    "a.log", "a.log.gz", "a.log.zst", "a.mcap", "a.pcapng", "pcap.seed", "pcapng-big.seed", "dataflash.seed",
    "dronecan.seed", "a.asc", "a.trc", "a.csv", "a.blf", "a.mf4",
)  # fmt: skip


class Named(io.BytesIO):
    """A file object that can seek."""

    def __init__(self, name: str, data: bytes = b"") -> None:
        super().__init__(data)
        self.name = name


class Pipe:
    """One that can only be read, `size` bytes at a time; behind `end` bytes it fails."""

    def __init__(self, name: str, data: bytes, size: int = 1 << 20, end: int | None = None) -> None:
        self.name = name
        self._data, self._size, self._end = data, size, end
        self._at = 0

    def read(self, size: int) -> bytes:
        stop = self._at + min(size, self._size)
        if self._end is not None:
            stop = min(stop, self._end)
            if self._at == stop:
                raise OSError(errno.EIO, os.strerror(errno.EIO))
        part = self._data[self._at : stop]
        self._at += len(part)
        return part


def given(source: Any) -> tuple[list[dict], list[dict], dict[str, int], list[str], str]:
    """Return all frames, events, sums, notes, and the error that nothing came out of."""
    frames: list[dict] = []
    events: list[dict] = []
    sums: dict[str, int] = {}
    failed = ""
    try:
        for part in rows(source.chunks()):
            if isinstance(part, FrameBatch):
                first, second = part.columns()
                frames += plain(wrap(RECORDED, first))
                events += plain(wrap(EVENT_ROWS, second))
                sums = {name: sums.get(name, 0) + count for name, count in part.lines.items()}
    except CaptureError as error:
        failed = str(error)
    return frames, events, sums, source.notes, failed


def from_file(folder: Path, name: str, data: bytes) -> tuple[Any, Source]:
    """Return what a path gives, and its source; the name in messages is that of the object."""
    (folder / name).write_bytes(data)
    source = Source(folder / name, hashed=True)
    *found, failed = given(source)
    return (*found, failed.replace(f"{folder}/", "")), source


@pytest.mark.sampled(2)
@pytest.mark.parametrize("name", NAMES)
def test_an_object_gives_what_the_file_gives(tmp_path: Path, name: str) -> None:
    data = capture(name)
    expected, path = from_file(tmp_path, name, data)
    assert expected[0]
    assert not expected[-1]
    for made in (Named(name, data), Pipe(name, data), Pipe(name, data, size=7)):
        source = Source(made, hashed=True)
        assert given(source) == expected
        assert (source.name, source.form, source.digest) == (name, path.form, path.digest)
        assert (source.size, source.damage, source.live) == (len(data), None, isinstance(made, Pipe))
    assert path.length == len(data)


@pytest.mark.sampled(4)
@pytest.mark.parametrize("name", NAMES)
def test_an_object_that_fails_in_the_middle_is_damaged_there(tmp_path: Path, name: str) -> None:
    data = capture(name)
    middle = 2 * len(data) // 3
    expected, _ = from_file(tmp_path, name, data[:middle])
    source = Source(Pipe(name, data, end=middle))
    found = given(source)
    assert found[:4] == expected[:4]
    told = f"{name}: byte {middle}: Input/output error"
    assert str(source.damage) == told
    assert found[4] == (told if expected[4] else "")  # MDF 4 is read as a whole, or not at all
    assert found[0] or name in ("a.log.zst", "dataflash.seed", "a.mf4")


@pytest.mark.sampled(4)
@pytest.mark.parametrize("name", NAMES)
def test_an_object_that_can_seek_is_read_again_from_where_it_stood(name: str) -> None:
    data = capture(name)
    file = Named(name, b"something in front" + data)
    file.seek(18)
    source = Source(file)
    first = given(source)
    assert given(source.again()) == first
    assert source.length == len(data)
    assert not file.closed


def test_what_exists_only_once_is_not_read_twice() -> None:
    source = Source(Pipe("a.log", TEXT))
    assert given(source)[0]
    assert given(source.again())[4] == (
        "a.log: was read before and cannot be read again: save the capture to a file first"
    )


def test_several_readings_of_one_object_keep_their_places() -> None:
    source = Source(Named("a.log", LONG))
    one, other = source.chunks(), source.again().chunks()
    assert [next(one), next(other), next(one)] == [TEXT_PARTS[0], TEXT_PARTS[0], TEXT_PARTS[1]]


LONG = TEXT * (3 * stored.CHUNK // len(TEXT))
TEXT_PARTS = [LONG[at : at + stored.CHUNK] for at in (0, stored.CHUNK)]


def test_lost_definitions_are_found_at_the_end_of_an_object(tmp_path: Path) -> None:
    """An MCAP file repeats its schemas and channels behind its data."""
    data = bytearray(mcaps.build(mcaps.frames(40), "can_msgs", compression="zstd", chunked=True, chunk_size=700))
    start = 8
    while data[start] != CHUNK:
        start += 9 + int.from_bytes(data[start + 1 : start + 9], "little")
    end = start + 9 + int.from_bytes(data[start + 1 : start + 9], "little")
    data[start + 9 + 40 + 8 : end] = bytes(end - start - 57)
    name = "a.mcap"
    expected, path = from_file(tmp_path, name, bytes(data))
    assert expected[0]
    source = Source(Named(name, bytes(data)))
    assert given(source) == expected
    assert source.damage is path.damage is None
    assert given(Source(Pipe(name, bytes(data))))[0] == []


def test_captures_from_objects_are_merged_as_files_are(tmp_path: Path) -> None:
    parts = {"a.log": TEXT, "b.pcapng": capture("a.pcapng")}
    for name, data in parts.items():
        (tmp_path / name).write_bytes(data)
    plan = Plan(offsets={"b.pcapng": 1}, names={"a.log": "left"})
    expected = given(_Noted(open_captures([tmp_path / name for name in parts], plan)))
    for kind in (Named, Pipe):
        merged = open_captures([kind(name, data) for name, data in parts.items()], plan)
        assert given(_Noted(merged)) == expected
        assert merged.name == "a.log, b.pcapng"


class _Noted:
    """A merged source, whose notes are those of its parts."""

    def __init__(self, merged: Any) -> None:
        self.chunks = merged.chunks
        self.notes = [note for part in merged.parts for note in part.notes]


def test_what_is_neither_a_path_nor_an_object() -> None:
    nameless: Any = io.BytesIO(TEXT)
    with pytest.raises(TypeError, match="neither a path nor a binary file object with a name"):
        Source(nameless)
    text: Any = io.StringIO("(1.000000) can0 123#\n")
    text.name = "a.log"
    source = Source(text)
    assert list(source.chunks()) == []
    assert str(source.damage) == "a.log: byte 0: it gives text, not bytes: open it in binary mode"


def test_whatever_an_object_raises_is_damage() -> None:
    closed = Named("a.log", TEXT)
    closed.close()
    source = Source(closed)
    assert list(source.chunks()) == []
    assert str(source.damage) == "a.log: byte 0: ValueError: I/O operation on closed file."


def test_an_object_cannot_be_followed() -> None:
    with pytest.raises(CaptureError, match=r"^a\.log: only a file or a pipe can be followed$"):
        list(Stored(Named("a.log", TEXT), follow=True).stored())


def test_a_buffered_pipe_gives_what_has_come() -> None:
    """Reading waits neither for as much as was asked for nor in `select`, which cannot see what is buffered."""
    out, into = os.pipe()
    with os.fdopen(out, "rb") as file, os.fdopen(into, "wb", buffering=0) as sender:
        source = Source(Renamed(file))
        half = TEXT.index(b"\n", 5000) + 1
        sender.write(TEXT[: half + 10])
        chunks = source.chunks()
        assert next(chunks) == TEXT[:half]
        assert source.live
        rest: list[bytes] = []
        reading = threading.Thread(target=lambda: rest.extend(chunks))
        reading.start()
        sender.write(TEXT[half + 10 :])
        sender.close()
        reading.join()
        assert b"".join(rest) == TEXT[half:]


class Renamed:
    """A file that has another name."""

    def __init__(self, file: io.BufferedReader) -> None:
        self.name = "a.log"
        self.read, self.read1, self.seekable = file.read, file.read1, file.seekable


def test_an_object_with_nothing_at_the_moment_is_waited_for() -> None:
    class Slow(Pipe):
        waiting = True

        def read(self, size: int) -> bytes | None:  # type: ignore[override]
            self.waiting = not self.waiting
            return super().read(size) if self.waiting else None

    assert b"".join(Stored(Slow("a.log", TEXT, size=15_000)).stored()) == TEXT


@pytest.mark.slow
def test_the_python_interface_takes_objects(tmp_path: Path) -> None:
    (tmp_path / "a.log").write_bytes(TEXT)
    expected = open_capture(tmp_path / "a.log").table("transfers")
    assert expected.num_rows
    assert open_capture(Named("a.log", TEXT)).table("transfers").equals(expected)
    once = open_capture(Pipe("a.log", TEXT))
    assert once.table("transfers").equals(expected)
    with pytest.raises(CaptureError, match="cannot be read again"):
        once.table("transfers")
    assert open_capture([Named("a.log", TEXT[:10_000]), Pipe("b.log", TEXT[10_000:])]).table("frames").num_rows
