"""The list of transfers shows error frames, lost frames and silences where they happened."""

from __future__ import annotations

import json
import shlex
from typing import TYPE_CHECKING

import pytest
from kit.command import CAPTURES

from analyzer.cli import main

if TYPE_CHECKING:
    from pathlib import Path

BREAK, FAULTS = CAPTURES / "bus-break.log", CAPTURES / "faults.log"


def listed(capfd: pytest.CaptureFixture[str], *args: object) -> list[str]:
    assert main(["decode", *map(str, args)]) in (0, 3)
    return capfd.readouterr().out.splitlines()


def marks(lines: list[str]) -> list[str]:
    return [line for line in lines if line.startswith("!")]


def test_every_error_frame_stands_in_its_place(capfd: pytest.CaptureFixture[str]) -> None:
    lines = listed(capfd, BREAK, "-t", "e")
    found = [line for line in marks(lines) if "error frame" in line]
    recorded = [row for row in BREAK.read_text().splitlines() if row.split()[2].startswith("2000")]
    assert [line.split()[2] for line in found] == [row.split()[0][1:-1] for row in recorded]
    at = lines.index(found[0])
    before, after = (float(lines[at + step].split()[1]) for step in (-1, 1))
    assert before <= float(found[0].split()[2]) <= after
    assert found[0].split("error frame")[1].split() == ["stuffing", "error,", "tx", "errors", "0,", "rx", "errors", "8"]


def test_losses_and_silences(capfd: pytest.CaptureFixture[str]) -> None:
    text = "\n".join(marks(listed(capfd, FAULTS)))
    assert "drop" in text
    assert "3 frames lost by the recorder" in text
    assert "silent for 1.612 s" in text


def test_an_overflow_is_called_a_loss(capfd: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    path = tmp_path / "a.log"
    path.write_text("(1.000000) can0 20000004#0001000000000000\n")
    head, mark = listed(capfd, path)
    assert head.startswith("    Frame  Time [s]")
    assert "error frame      receive overflow, frames lost" in mark


def test_a_window_holds_for_them_too(capfd: pytest.CaptureFixture[str]) -> None:
    every = marks(listed(capfd, BREAK, "-t", "e"))
    inside = marks(listed(capfd, BREAK, "-t", "e", "--from", "2.99", "--to", "3.01"))
    assert 0 < len(inside) < len(every)
    assert set(inside) < set(every)
    assert marks(listed(capfd, BREAK, "--to", "1")) == []


def test_a_count_is_one_of_transfers(capfd: pytest.CaptureFixture[str]) -> None:
    lines = listed(capfd, BREAK, "--from", "2.9", "-c", "60")
    assert len(lines) - len(marks(lines)) - 1 == 60
    assert not lines[-1].startswith("!")


@pytest.mark.slow
def test_formats_for_programs_have_no_such_lines_and_details_have_them(capfd: pytest.CaptureFixture[str]) -> None:
    for row in listed(capfd, BREAK, "-T", "jsonl"):
        assert json.loads(row)["status"] == "ok"
    assert len(marks(listed(capfd, BREAK, "-V"))) == len(marks(listed(capfd, BREAK)))


@pytest.mark.parametrize("rule", ["CAN-004", "BUS-005"])
def test_the_command_of_a_finding_shows_its_error_frames(capfd: pytest.CaptureFixture[str], rule: str) -> None:
    main(["check", str(BREAK), "--select", rule])
    (command, *_) = (row.strip() for row in capfd.readouterr().out.splitlines() if "tailbyte decode" in row)
    assert command.endswith("+-50ms")
    assert main(shlex.split(command)[1:]) == 0
    lines = capfd.readouterr().out.splitlines()
    assert marks(lines)
    assert len(lines) < 120
