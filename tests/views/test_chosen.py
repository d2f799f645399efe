"""Chosen fields as records: of transfers and of frames, under the names that were asked for."""

from __future__ import annotations

import csv
import io
import json
from typing import TYPE_CHECKING

import pytest
from kit import CAPTURES

if TYPE_CHECKING:
    from collections.abc import Callable

    Command = Callable[..., tuple[int, str, str]]

NAMES = ("frame.number", "frame.time", "ESCStatus.voltage", "RawCommand.cmd", "frame.data", "src")
ASKED = [word for name in NAMES for word in ("-e", name)]
HOVER = CAPTURES / "hover.log"


@pytest.mark.parametrize("rows", [(), ("--frame-list",)])
def test_records_hold_what_the_fields_are(command: Command, rows: tuple[str, ...]) -> None:
    def written(form: str) -> str:
        return command("decode", HOVER, *rows, "-T", form, *ASKED, "-c", "40")[1]

    fields = [line.split("\t") for line in written("fields").splitlines()]
    assert list(csv.reader(io.StringIO(written("csv")))) == [list(NAMES), *fields]
    lines = [json.loads(line) for line in written("jsonl").splitlines()]
    assert json.loads(written("json")) == lines
    assert len(lines) == len(fields) == 40
    told = next(one for one in lines if one["ESCStatus.voltage"] is not None)
    assert list(told) == list(NAMES)
    assert isinstance(told["ESCStatus.voltage"], float)
    assert told["frame.time"].startswith("20")
    assert told["RawCommand.cmd"] is None
    assert isinstance(told["frame.data"], str)
    assert isinstance(next(one["RawCommand.cmd"] for one in lines if one["RawCommand.cmd"]), list)


def test_the_time_is_one_that_a_filter_takes(command: Command) -> None:
    """As it is written."""
    when = command("decode", HOVER, "-T", "fields", "-e", "frame.time", "-c", "5")[1].splitlines()[-1]
    found = command("decode", HOVER, "-T", "jsonl", "-e", "frame.time", "-Y", f'frame.time == "{when}"')[1]
    assert json.loads(found) == {"frame.time": when}


def test_what_does_not_go_together(command: Command) -> None:
    for more in (["--derived"], ["--findings"]):
        status, _, err = command("decode", HOVER, "-T", "csv", "-e", "src", *more)
        assert (status, err.splitlines()[0]) == (
            2, "tailbyte decode: -e FIELD says what is written: not with --derived or --findings",
        )  # fmt: skip
