"""The bar: on a terminal only, not for short work, gone at the end."""

from __future__ import annotations

import os
import sys
import threading
from dataclasses import dataclass
from typing import TYPE_CHECKING

import pytest
from kit.command import HOVER

from analyzer.cli import main, progress
from analyzer.cli.progress import PATIENCE, Progress, labelled, line

if TYPE_CHECKING:
    from pathlib import Path


@dataclass
class Measurable:
    size: int = 0
    length: int | None = None


class Terminal:
    def __init__(self, is_terminal: bool = True) -> None:
        self.text, self.is_terminal = "", is_terminal

    def isatty(self) -> bool:
        return self.is_terminal

    def fileno(self) -> int:
        raise OSError

    def write(self, text: str) -> None:
        self.text += text

    def flush(self) -> None:
        pass


def shown(monkeypatch: pytest.MonkeyPatch, *, terminal: bool = True, wanted: bool = True, seconds: float = 10) -> str:
    """What a work of 100 steps writes."""
    stderr, now, reading = Terminal(terminal), 0.0, Measurable(0, 100)
    monkeypatch.setattr(sys, "stderr", stderr)
    monkeypatch.setenv("TERM", "xterm")
    with Progress(reading, wanted=wanted, clock=lambda: now) as progress:
        assert progress.active == (terminal and wanted)
        for part in progress.over(range(100)):
            now += seconds / 100
            reading.size = part + 1
    return stderr.text


def test_long_work_on_a_terminal(monkeypatch: pytest.MonkeyPatch) -> None:
    drawn = shown(monkeypatch).split("\r\x1b[K")
    assert drawn[0] == drawn[-1] == ""
    assert len(drawn) == 2 + 95
    assert drawn[1].startswith("  5% [##............................] 10 B/s")
    assert drawn[-2].endswith("0:00 left")
    assert "\n" not in "".join(drawn)


def test_at_most_ten_times_a_second(monkeypatch: pytest.MonkeyPatch) -> None:
    assert shown(monkeypatch, seconds=1).count("%") == 5


@pytest.mark.parametrize(("terminal", "wanted", "seconds"), [(False, True, 10), (True, False, 10), (True, True, 0.4)])
def test_nothing_at_all(monkeypatch: pytest.MonkeyPatch, terminal: bool, wanted: bool, seconds: float) -> None:
    assert seconds > PATIENCE or seconds == 0.4
    assert shown(monkeypatch, terminal=terminal, wanted=wanted, seconds=seconds) == ""


def test_a_dumb_terminal(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys, "stderr", Terminal())
    monkeypatch.setenv("TERM", "dumb")
    assert not Progress(Measurable()).active


def test_the_line() -> None:
    assert line(Measurable(250, 1000), 0.001, 80) == " 25% [########......................] 250 kB/s  0:00 left"
    assert line(Measurable(1_000_000, 5_000_000_000), 1, 80).endswith("1 MB/s  1:23:19 left")
    assert line(Measurable(0, 1000), 1, 80) == "  0% [..............................] 0 B/s"
    assert line(Measurable(3_000, 1000), 1, 80).startswith("100% [##############################] 3 kB/s")
    assert line(Measurable(2_500_000_000), 5, 80) == "2.5 GB  500 MB/s"
    assert line(Measurable(0, 0), 5, 80) == "0 B  0 B/s"
    assert line(Measurable(2_500_000_000), 5, 7) == "2.5 GB"


def test_a_rate_in_other_words(monkeypatch: pytest.MonkeyPatch) -> None:
    assert line(Measurable(250, 1000), 1, 80, "{:.0f} steps".format).endswith(" 250 steps  0:03 left")
    stderr = Terminal()
    monkeypatch.setattr(sys, "stderr", stderr)
    monkeypatch.setenv("TERM", "xterm")
    times = iter(range(100))
    with Progress(Measurable(50, 100), clock=lambda: next(times), speed="{:.0f} steps".format) as progress:
        progress.step()
    assert " 50 steps  0:01 left" in stderr.text


def test_a_narrow_line_loses_whole_parts() -> None:
    reading = Measurable(250, 1000)
    texts = [line(reading, 1, width) for width in range(80)]
    assert list(dict.fromkeys(texts)) == [
        "",
        " 25%",
        " 25%  0:03 left",
        " 25% 250 B/s  0:03 left",
        " 25% [########......................] 250 B/s  0:03 left",
    ]
    assert all(len(text) < max(width, 1) for width, text in enumerate(texts))
    assert {line(Measurable(2500), 1, width) for width in range(80)} == {"", "2 kB", "2 kB  2 kB/s"}


def test_work_without_a_measure(monkeypatch: pytest.MonkeyPatch) -> None:
    assert [labelled("writing", 75, width) for width in (80, 14, 13, 8, 7)] == [
        "writing  1:15", "writing  1:15", "writing", "writing", "",
    ]  # fmt: skip
    stderr, now = Terminal(), 0.0
    monkeypatch.setattr(sys, "stderr", stderr)
    monkeypatch.setenv("TERM", "xterm")
    with Progress(Measurable(100, 100), clock=lambda: now) as progress:
        for part in progress.over(range(3), "writing"):
            now = 10 * (part + 1.0)
    assert stderr.text == "\r\x1b[Kwriting  0:10\r\x1b[Kwriting  0:20\r\x1b[K"


def run(monkeypatch: pytest.MonkeyPatch, stdout: Path | int, *args: object) -> str:
    """What a command writes on a terminal while its results go to a file, or to the descriptor of a pipe."""
    stderr = Terminal()
    monkeypatch.setattr(sys, "stderr", stderr)
    monkeypatch.setenv("TERM", "xterm")
    monkeypatch.setattr(progress, "PATIENCE", 0)
    monkeypatch.setattr(progress, "PAUSE", 0)
    with open(stdout, "w", encoding="utf-8") as out:  # noqa: PTH123 - a descriptor, too
        monkeypatch.setattr(sys, "stdout", out)
        assert main(list(map(str, args))) == 0
    return stderr.text


@pytest.mark.parametrize("args", [("decode",), ("decode", "--frame-list"), ("decode", "-q"), ("info",)])
def test_commands_that_write_a_file_show_how_far_they_are(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, args: tuple[str, ...]
) -> None:
    drawn = run(monkeypatch, tmp_path / "out.txt", *args, HOVER).split("\r\x1b[K")
    assert "B/s" in drawn[1]
    assert drawn[-1] == "" or drawn[-1].startswith("-- ")  # gone before anything else is said
    assert "\x1b" not in (tmp_path / "out.txt").read_text()


@pytest.mark.parametrize("args", [("decode",), ("decode", "-V")])
def test_nothing_is_drawn_beside_a_pipe(monkeypatch: pytest.MonkeyPatch, args: tuple[str, ...]) -> None:
    ours, theirs = os.pipe()

    def drain() -> None:
        with os.fdopen(ours, "rb") as pipe:
            pipe.read()

    reader = threading.Thread(target=drain)
    reader.start()
    assert "\x1b" not in run(monkeypatch, theirs, *args, HOVER)
    reader.join()
