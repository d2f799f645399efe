"""Files that are no captures are called what they are, in one line."""

from __future__ import annotations

import gzip
import os
import threading
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

from analyzer.cli import main
from analyzer.sources import CaptureError, Source

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

PROSE = """# The flight of Tuesday

1. We took off (at 10:04), can0 was fine.
2.5 V was low [see 3], and 0x1F went missing.

ERROR: none was seen. Mode #3, ESC 4: 12, 13, 14
"""
POINTER = b"version https://git-lfs.github.com/spec/v1\noid sha256:b5a3\nsize 165\n"


@contextmanager
def closing_later(pipe: Path, parts: Sequence[bytes]) -> Iterator[None]:
    """Something that writes the parts into a pipe, one after the other."""

    def write() -> None:
        with pipe.open("wb", buffering=0) as file:
            for part in parts:
                file.write(part)

    writer = threading.Thread(target=write)
    writer.start()
    yield
    writer.join()


FILES = {
    "a Git LFS pointer (git lfs pull gets the file)": (POINTER, ("x.log", "x.mcap", "x.blf")),
    "a program": (b"\x7fELF\2\1\1" + bytes(90), ("x.log", "x.pcap")),
    "a text file": (b"Hello\nthis is a readme\n", ("x.mcap", "x.blf", "x.mf4", "x.pcapng")),
}


@pytest.mark.sampled(4)
@pytest.mark.parametrize("what", FILES)
def test_what_a_file_is(tmp_path: Path, what: str, capfd: pytest.CaptureFixture[str]) -> None:
    data, names = FILES[what]
    for name in names:
        path = tmp_path / name
        path.write_bytes(data)
        for command in ("info", "check", "decode"):
            assert main([command, str(path)]) == 3
            err = capfd.readouterr().err.splitlines()
            assert [line for line in err if "looks like" in line] == [
                f"tailbyte: {path}: byte 0: looks like {what}, which is not read"
            ]


def test_a_file_that_is_no_capture_is_closed_while_the_error_lives(tmp_path: Path) -> None:
    path = tmp_path / "x.pcapng"
    path.write_bytes(b"Hello\nthis is a readme\n")
    with pytest.raises(CaptureError) as told:
        list(Source(str(path)).chunks())
    held = [one for one in Path("/proc/self/fd").iterdir() if one.exists() and one.samefile(path)]
    assert not held, told


def test_a_directory(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    assert main(["info", str(tmp_path)]) == 3
    assert capfd.readouterr().err == f"tailbyte: {tmp_path}: is a directory\n"


@pytest.mark.parametrize("name", ["x.log", "x", "x.txt", "x.asc", "x.trc", "x.csv", "x.log.gz"])
@pytest.mark.parametrize("times", [1, 40])
def test_prose_is_told_in_one_line(tmp_path: Path, name: str, times: int, capfd: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / name
    data = PROSE.encode() * times
    path.write_bytes(gzip.compress(data) if name.endswith(".gz") else data)
    assert main(["decode", "-q", str(path)]) == 3
    place = "byte 0 of the unpacked data" if name.endswith(".gz") else "byte 0"
    assert capfd.readouterr().err == f"tailbyte: {path}: {place}: looks like a text file, which is not read\n"


@pytest.mark.parametrize(
    "text",
    [PROSE + "(1.5) can0 123#00\n" * 3, "can0  123   [2]  00 01\nnothing\n\nnothing\n" * 3],
    ids=["banner", "damage"],
)
def test_a_log_between_other_text_is_read(tmp_path: Path, text: str, capfd: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "x.log"
    path.write_text(text)
    assert main(["decode", "-q", str(path)]) == 3
    assert "= 3 frames + " in capfd.readouterr().err.splitlines()[-1]


def test_prose_in_front_of_what_a_pipe_gives_is_passed_over(tmp_path: Path) -> None:
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    with closing_later(pipe, [PROSE.encode() * 40, b"(1.5) can0 123#00\n"]):
        pieces = [piece for piece in Source(str(pipe)).chunks() if piece]
    assert b"".join(piece for piece in pieces if isinstance(piece, bytes)).endswith(b"(1.5) can0 123#00\n")


@pytest.mark.parametrize(
    "line",
    ["# can0: link down", "DROPCOUNT: dropped 1 CAN frame on 'can0' socket (total drops 1)"],
    ids=["#", "DROPCOUNT"],
)
def test_a_recording_of_nothing_but_remarks_is_one(tmp_path: Path, line: str) -> None:
    path = tmp_path / "x.log"
    path.write_text(f"{line}\n" * 5)
    assert main(["decode", "-q", str(path)]) == 0
