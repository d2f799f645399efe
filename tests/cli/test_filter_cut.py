"""A capture cut into batches of any size gives the rows that it gives whole: verdicts that come late count, too."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest
from kit import CAPTURES

import analyzer

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    Command = Callable[..., tuple[int, str, str]]
    Told = tuple[int, list[str], str]

FAULTS = CAPTURES / "faults.log"
FILTERS = ("!dronecan.src", "can.len == 8", 'dronecan.status != "ok"', "!RawCommand", "ESCStatus")


def cut(monkeypatch: pytest.MonkeyPatch, rows: int, bytes_: int) -> None:
    monkeypatch.setattr("analyzer.decode.core.BATCH_ROWS", rows)
    monkeypatch.setattr("analyzer.sources.stored.CHUNK", bytes_)


def told(command: Command, folder: Path, path: Path, text: str) -> dict[str, Told]:
    """Return what each command writes and says; rows of transfers are in the order in which they are released."""
    lists = {"list": (), "frames": ("--frame-list",), "count": ("-q",), "frame count": ("-q", "--frame-list")}
    found = {}
    for name, more in lists.items():
        code, out, err = command("decode", path, "-T", "jsonl", "-Y", text, *more)
        lines = out.splitlines()
        found[name] = code, sorted(lines) if name == "list" else lines, err
    code, _, err = command("convert", path, "-o", folder / "some.log", "-Y", text)
    found["convert"] = code, (folder / "some.log").read_text().splitlines(), err
    code, _, err = command("export", path, "-o", folder / "csv", "--format", "csv", "--force", "-Y", text)
    rows = [f"{one.name} {line}" for one in sorted((folder / "csv").iterdir()) for line in one.read_text().split("\n")]
    found["export"] = code, sorted(rows), err
    return found


@pytest.mark.sampled(9)
@pytest.mark.parametrize("text", FILTERS)
@pytest.mark.parametrize(("rows", "bytes_"), [(50, 2000), (7, 300)])
def test_late_verdicts_select_what_they_select_at_once(
    command: Command, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, rows: int, bytes_: int, text: str
) -> None:
    """Frames that are foreign, orphans or of a transfer only in a later batch are rows as in a whole one."""
    whole = told(command, tmp_path, FAULTS, text)
    cut(monkeypatch, rows, bytes_)
    assert sum(len(batch.settled) for batch in analyzer.open_capture(FAULTS)) > 0
    assert told(command, tmp_path, FAULTS, text) == whole
