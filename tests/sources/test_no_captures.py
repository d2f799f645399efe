"""Files that are no captures are called what they are, in one line."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest

from analyzer.cli import main

if TYPE_CHECKING:
    from pathlib import Path

POINTER = b"version https://git-lfs.github.com/spec/v1\noid sha256:b5a3\nsize 165\n"
FILES = {
    "a Git LFS pointer (git lfs pull gets the file)": (POINTER, ("x.log", "x.mcap", "x.blf")),
    "a program": (b"\x7fELF\2\1\1" + bytes(90), ("x.log", "x.pcap")),
    "a text file": (b"Hello\nthis is a readme\n", ("x.mcap", "x.blf", "x.mf4", "x.pcapng")),
}


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


def test_a_directory(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    assert main(["info", str(tmp_path)]) == 3
    assert capfd.readouterr().err == f"tailbyte: {tmp_path}: is a directory\n"
