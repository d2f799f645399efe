"""How doubtful fields are read is the same in every command, in windows too, and can be forced in each."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Any

import pyarrow.parquet as pq
import pytest
from kit.traffic import Traffic

import analyzer

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    Command = Callable[..., tuple[int, str, str]]

HOT = [150.0 + k for k in range(70)]  # beyond 200 degC towards the end


@pytest.fixture
def hot(tmp_path: Path) -> Path:
    """Node 11 is a T-Motor ESC in degC with big-endian packets, node 12 a stock one in kelvin with errors."""
    traffic, path = Traffic(), tmp_path / "hot.log"
    for degrees in HOT:
        traffic.status(11, temperature=degrees, error_count=4 << 12)
        traffic.motor(11, big=True)
        traffic.status(12, temperature=degrees + 100, error_count=5)
    path.write_bytes(traffic.log)
    return path


def shown(command: Command, *args: object) -> list[list[str]]:
    status, text, _ = command("decode", "-T", "fields", *args)
    assert status == 0
    return [line.split("\t") for line in text.splitlines()]


def test_no_window_turns_a_hot_node_cold(command: Command, hot: Path) -> None:
    names = ("temperature_celsius", "reading.temperature", "decided")
    fields = [part for name in names for part in ("-e", f"ESCStatus.{name}")]
    for window in ([], ["--last", "50ms"], ["--frames", "700-"], ["-c", "3"]):
        rows = [row for row in shown(command, hot, *fields, *window) if row[0]]
        assert {row[1] for row in rows} == {"degC", "K"}
        assert {row[2] for row in rows} == {"1"}
        assert all((float(celsius) >= 150) == (reading == "degC") for celsius, reading, _ in rows)


def test_windows_of_info_and_check_know_what_went_before(command: Command, hot: Path, tmp_path: Path) -> None:
    """In the last frames node 11 is above 200 all the time, which alone would be kelvin."""
    _, whole, _ = command("info", hot)
    _, part, _ = command("info", hot, "--last", "50ms")
    readings = [line for line in whole.splitlines() if line.startswith("Reading")]
    assert readings == [line for line in part.splitlines() if line.startswith("Reading")]
    assert "Reading    ESCStatus.temperature: degC, node 11" in readings
    assert "Reading    PUSHCAN.byte order: big-endian, node 11" in readings
    for window in ([], ["--last", "50ms"]):
        command("check", hot, "--json", tmp_path / "report.json", *window)
        stated = json.loads((tmp_path / "report.json").read_text())["captures"][0]["dialects"]
        assert {"degC", "tm", "big-endian"} <= set(stated["can0:11"].values())
        assert {"K", "dronecan"} == set(stated["can0:12"].values())


def test_every_reader_is_told_otherwise_alike(command: Command, hot: Path, tmp_path: Path) -> None:
    fields = ("-e", "dronecan.src", "-e", "ESCStatus.temperature_celsius", "-e", "PUSHCAN.MotorStatus.voltage")
    forced = ("--dialect", "11=K", "--dialect", "11=little-endian")
    rows = [row for row in shown(command, hot, *fields, *forced) if row[0] == "11"]
    assert [round(float(row[1]), 2) for row in rows if row[1]] == [round(one - 273.15, 2) for one in HOT]
    assert {row[2] for row in rows if row[2]} == {"619.7"}
    status, _, _ = command("export", hot, "-o", tmp_path / "out", *forced)
    assert status == 0
    table = pq.read_table(tmp_path / "out" / "ESCStatus.parquet").to_pylist()
    assert {row["reading.temperature"] for row in table if row["src"] == 11} == {"K"}
    assert {row["reading.dialect"] for row in table if row["src"] == 12} == {"dronecan"}
    opened: Any = analyzer.open_capture(hot, dialects={11: ["K", "little-endian"]}).table("ESCStatus").to_pylist()
    assert [row["temperature_celsius"] for row in opened] == [row["temperature_celsius"] for row in table]


@pytest.mark.parametrize("name", ["decode", "export", "info", "check"])
def test_a_reading_that_nobody_has_is_refused(command: Command, hot: Path, tmp_path: Path, name: str) -> None:
    more = ("-o", tmp_path / "out") if name == "export" else ()
    status, _, error = command(name, hot, "--dialect", "11=foo", *more)
    assert status == 2
    assert "no field is read as 'foo' (one of: tm, dronecan, degC, K, little-endian, big-endian)" in error


def test_json_says_where_a_word_is_no_status(command: Command, hot: Path) -> None:
    _, text, _ = command("decode", hot, "-T", "jsonl", "-c", "3")
    status, push, stock = (json.loads(line) for line in text.splitlines())
    assert "read_as" not in status["fields"]["error_count"]
    assert push["packets"][0]["fields"]["voltage"] == 48.5
    assert "decided" not in push["packets"][0]
    assert stock["fields"]["error_count"]["read_as"] == "dronecan"
