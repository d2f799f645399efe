"""MDF 4, which another process reads: what it cannot read, what it must not take, and how it may end."""

from __future__ import annotations

import gzip
import io
import os
import random
import resource
import subprocess
import sys
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any

import pytest
from kit.libraries import library_file, pieces_of
from kit.rows import EXTENDED, RX, TX, Frame, Record, records

from analyzer.sources import CaptureError, Source
from analyzer.sources.python_can import mdf, mdf_child

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

T0 = 1_700_000_000_000_000_000
SAMPLE: list[Record] = [
    Frame(T0 + row * 1_000_000, "can0", 0x05040601 + row, EXTENDED | (TX if row % 3 else RX), bytes(range(row % 9)))
    for row in range(12)
]
# A process that writes two messages and then ends in its own way.
ENDS = """
import os, signal, sys
from analyzer.sources.python_can.mdf_child import RECORD
message = RECORD.pack(1.5, 0x123, 0, 8, 2, 2, bytes(64))
os.write(1, message * 2 + message[:7])
"""


def test_mdf_without_its_extra(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(mdf, "PathFinder", SimpleNamespace(find_spec=lambda _: None))
    with pytest.raises(CaptureError, match=r": reading MDF 4 needs asammdf: pip install 'tailbyte\[mf4\]'$"):
        pieces_of(".mf4", b"MDF     4.10")


NO_MDF = "capture.mf4: damaged, or not of the kinds of MDF 4 that asammdf reads"


@pytest.mark.slow
def test_what_is_no_mdf_is_refused() -> None:
    """In words of our own, whatever asammdf trips over."""
    data = library_file(".mf4", SAMPLE)
    for bad in (b"MDF     4.10" + bytes(500), data[:3000], data[:100] + bytes(2000) + data[2100:], data[:64]):
        with pytest.raises(CaptureError) as caught:
            pieces_of(".mf4", bad)
        assert str(caught.value) == NO_MDF


@pytest.mark.slow
def test_a_packed_mdf_that_ends_early_says_where(tmp_path: Path) -> None:
    path = tmp_path / "x.mf4.gz"
    data = gzip.compress(library_file(".mf4", SAMPLE))[:-900]
    path.write_bytes(data)
    with pytest.raises(CaptureError) as caught:
        list(Source(str(path)).chunks())
    assert str(caught.value) == f"{path}: byte {len(data)}: gzip data ends early"


def test_no_room_for_the_temporary_file_of_mdf(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    def full() -> Iterator[bytes]:
        resource.setrlimit(resource.RLIMIT_FSIZE, (1 << 12, limits[1]))
        yield data

    data = library_file(".mf4", SAMPLE)
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    source = Source("capture.mf4")
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    try:
        with pytest.raises(CaptureError, match=rf"^capture.mf4: temporary file {tmp_path}/\w+.mf4: File too large$"):
            list(mdf.read(source, full()))
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path / "gone"))
    with pytest.raises(
        CaptureError, match=rf"^capture.mf4: temporary file {tmp_path}/gone: No such file or directory$"
    ):
        list(mdf.read(source, iter([data])))
    assert list(tmp_path.iterdir()) == []


def test_the_temporary_file_of_mdf_is_bounded(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("analyzer.sources.python_can.mdf._LARGEST", 2 << 30)
    data, seen = bytes(1 << 30), []

    def chunks() -> Iterator[bytes]:
        for part in (b"", b"", data, data, b"MDF", data):
            seen.append(len(part))
            yield part

    monkeypatch.setattr("analyzer.sources.python_can.mdf.NamedTemporaryFile", lambda **_: Discarded())
    with pytest.raises(CaptureError, match=r"^capture.mf4: MDF 4 of more than 2 GiB is not read$"):
        list(mdf.read(Source("capture.mf4"), chunks()))
    assert len(seen) == 5


class Discarded(io.BytesIO):
    """A file that keeps nothing."""

    name = "/nowhere"

    def write(self, data: Any) -> int:
        return len(data)


def test_ctrl_c_while_mdf_is_unpacked() -> None:
    source = Source("capture.mf4")

    def chunks() -> Iterator[bytes]:
        yield library_file(".mf4", SAMPLE)[:3000]
        source.stopped = True

    assert list(mdf.read(source, chunks())) == []
    assert source.damage is None


@pytest.mark.parametrize(
    ("end", "reason"),
    [
        ("os.kill(os.getpid(), signal.SIGSEGV)", "damaged: asammdf was ended by SIGSEGV"),
        ("os.kill(os.getpid(), signal.SIGXCPU)", "asammdf needs more than 120 s for it"),
        (f"os._exit({mdf_child.NO_MEMORY})", "asammdf needs more than 2048 MiB of memory for it"),
        (f"os._exit({mdf_child.BROKEN_OFF})", "damaged, or not of the kinds of MDF 4 that asammdf reads"),
        ("sys.exit(1)", "asammdf could not be started, or failed (exit status 1)"),
    ],
)
def test_what_came_before_the_end_is_kept(monkeypatch: pytest.MonkeyPatch, end: str, reason: str) -> None:
    monkeypatch.setattr(mdf, "_CHILD", ("-c", ENDS + end))
    pieces, source = pieces_of(".mf4", b"MDF     4.10")
    assert records(pieces) == [Frame(1_500_000_000, "can0", 0x123, RX, b"\0\0")] * 2
    assert str(source.damage) == f"capture.mf4: message 3: {reason}"
    monkeypatch.setattr(mdf, "_CHILD", ("-c", "import os, signal, sys\n" + end))
    with pytest.raises(CaptureError) as caught:
        pieces_of(".mf4", b"MDF     4.10")
    assert str(caught.value) == f"capture.mf4: {reason}"


def test_the_process_is_bounded(tmp_path: Path) -> None:
    """Of memory and time it gets what the size of the file allows."""
    path = tmp_path / "x.mf4"
    path.write_bytes(bytes(1000))
    code = """
import resource
from analyzer.sources.python_can import mdf_child
def greedy(path, out):
    print(*(resource.getrlimit(kind)[0] for kind in (resource.RLIMIT_DATA, resource.RLIMIT_CPU)), flush=True)
    try:
        bytearray(3 << 30)
    except MemoryError:
        return mdf_child.NO_MEMORY
    return mdf_child.WHOLE
mdf_child.read = greedy
mdf_child.main()
"""
    paths = {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)}
    done = subprocess.run([sys.executable, "-c", code, path], capture_output=True, text=True, env=paths, check=False)
    assert (done.returncode, done.stdout.split()) == (mdf_child.NO_MEMORY, [str((2 << 30) + 24_000), "120"])


def test_commands_do_without_asammdf() -> None:
    """python-can imports it, and pandas with it, where it can."""
    code = """
import sys
from analyzer.cli import main
main(["live", "-D"])
sys.exit(any(sys.modules.get(name) for name in ("asammdf", "pandas")) or "can" not in sys.modules)
"""
    paths = {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)}
    assert subprocess.run([sys.executable, "-c", code], capture_output=True, env=paths, check=False).returncode == 0


# Reads files until one ends the process; says of each how it ended.
READS = """
import io, sys
from analyzer.sources.python_can import mdf_child
for path in sys.argv[1:]:
    out = io.BytesIO()
    status = mdf_child.read(path, out)
    print(path, status, len(out.getvalue()) // mdf_child.RECORD.size, flush=True)
"""


@pytest.mark.slow
def test_cut_and_changed_at_many_bytes(tmp_path: Path) -> None:
    """However a file ends its process, each ends in one of the ways that are told."""
    data = library_file(".mf4", SAMPLE)
    chance = random.Random(9)
    for at in sorted({*range(0, 168, 2), *range(0, len(data), max(11, len(data) // 150))}):
        changed = bytearray(data)
        changed[at] ^= 1 << chance.randrange(8)
        (tmp_path / f"{at}-cut").write_bytes(data[:at])
        (tmp_path / f"{at}-changed").write_bytes(changed)
    paths = sorted(str(path) for path in tmp_path.iterdir())
    ends: dict[str, int] = {}
    while len(ends) < len(paths):
        left = paths[len(ends) :]
        environ = {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)}
        done = subprocess.run(
            [sys.executable, "-c", READS, *left], capture_output=True, text=True, env=environ, check=False
        )
        for line in done.stdout.splitlines():
            path, status, count = line.split()
            assert int(count) <= len(SAMPLE)
            ends[path] = int(status)
        if done.returncode:
            assert done.returncode < 0, done.stderr
            ends[paths[len(ends)]] = done.returncode
    assert {status for status in ends.values() if status > 0} <= {mdf_child.NOT_OPENED, mdf_child.BROKEN_OFF}
    assert sum(not status for status in ends.values()) > 10
