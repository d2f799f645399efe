"""What a copy says is what the capture said: no times that nobody recorded, no direction less; the rest is told."""

from __future__ import annotations

import re
from itertools import pairwise
from typing import TYPE_CHECKING

import pytest
from cli.test_convert import SUFFIXES, frames_of

if TYPE_CHECKING:
    from pathlib import Path

    from cli.test_convert import Command


def test_a_copy_has_no_more_time_than_the_capture(command: Command, tmp_path: Path) -> None:
    capture = tmp_path / "console.txt"
    capture.write_text("  can0  123   [2]  11 22\n  can0  20000004   [8]  00 04 00 00 00 00 00 00   ERRORFRAME\n")
    for suffix in SUFFIXES:
        copy = tmp_path / f"copy.{suffix}"
        assert command("convert", capture, copy)[0] == 0
        assert frames_of(copy) == frames_of(capture)
        shown = command("info", copy)[1]
        assert re.search(r"^Stamps +none$", shown, re.MULTILINE)
        assert re.search(r"^Can judge .*timing NO", shown, re.MULTILINE)
        assert "no channel with CAN" not in shown


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_error_frames_keep_their_direction(command: Command, tmp_path: Path, suffix: str) -> None:
    line = "(1700000000.000000) can0 20000004#0100000000000000"
    capture, copy, again = tmp_path / "a.log", tmp_path / f"copy.{suffix}", tmp_path / "b.log"
    capture.write_text(f"{line} T\n{line}\n{line} R\n")
    for old, new in pairwise([capture, copy, again]):
        assert command("convert", old, new)[0] == 0
    assert again.read_text() == capture.read_text()


def test_what_is_lost_is_told(command: Command, tmp_path: Path) -> None:
    capture = tmp_path / "long.log"
    capture.write_text("# note\n(1.5) can0 123##111\n(1.6) can0 123#112233445566778899\n")
    sums = "3 lines = 2 frames + 1 comments\n"
    told = "cannot hold: classic frames of more than 8 bytes (1)\n"
    for name, frames, more in (
        ("a.mcap", 1, f"-- mcap {told}"), ("a.pcapng", 1, f"-- pcapng {told}"), ("a.log", 2, ""),
    ):  # fmt: skip
        out = tmp_path / name
        assert command("convert", capture, out) == (0, "", f"-- {frames} frames written to {out}; {sums}{more}")
