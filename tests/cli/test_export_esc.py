"""`tailbyte export --table esc`: what ESCs report beside what they were commanded, in every format."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import pyarrow.parquet as pq
import pytest
from kit.command import CAPTURES, HOVER
from kit.exported import as_csv, csv_cell, plain, read_csv, read_table, same

import analyzer
from analyzer.tables import ESC

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    Main = Callable[..., tuple[int, str, str]]
    Rows = list[dict[str, Any]]

FLIGHT = CAPTURES / "hover-4.log"


def exported(command: Main, path: Path, *more: object) -> Rows:
    assert command("export", FLIGHT, "-o", path, "--table", "esc", *more)[0] == 0
    return plain(read_table(path))


@pytest.mark.parametrize("form", ["parquet", "arrow", "csv"])
def test_it_has_the_values_of_the_api(command: Main, tmp_path: Path, form: str) -> None:
    table = analyzer.open_capture(FLIGHT).table("esc")
    wanted = [row | {"bus": "can0"} for row in plain(table)]
    assert len(wanted) > 500
    path = tmp_path / f"esc.{form}"
    if form != "csv":
        assert exported(command, path) == wanted
        return
    assert command("export", FLIGHT, "-o", path, "--table", "esc")[0] == 0
    for got, row in zip(read_csv(path), wanted, strict=True):
        like = as_csv(row, table.schema)
        assert same({key: csv_cell(text, like[key]) for key, text in got.items()}, like)


def test_columns_have_units(command: Main, tmp_path: Path) -> None:
    exported(command, tmp_path / "esc.parquet")
    schema = pq.read_schema(tmp_path / "esc.parquet")
    assert schema.names == ESC.names
    units = {field.name: field.metadata.get(b"unit", b"").decode() for field in schema}
    assert {name: unit for name, unit in units.items() if unit} == {
        "commanded": "%", "reported": "%", "rpm": "rpm", "voltage": "V", "current": "A", "temperature": "degC",
    }  # fmt: skip
    assert all(field.metadata[b"about"] for field in schema)


@pytest.mark.parametrize("window", [("--from", "2", "--to", "2.2"), ("--last", "0.3"), ("--around", "4000+-0.1s")])
def test_a_window_knows_the_command_before_it(command: Main, tmp_path: Path, window: tuple[str, ...]) -> None:
    whole = exported(command, tmp_path / "esc.arrow")
    inside = exported(command, tmp_path / "esc.arrow", *window)
    assert 0 < len(inside) < len(whole)
    assert inside == [row for row in whole if inside[0]["transfer"] <= row["transfer"] <= inside[-1]["transfer"]]


def test_without_escs_it_has_its_columns(command: Main, tmp_path: Path) -> None:
    command("export", CAPTURES / "services.log", "-o", tmp_path / "esc.parquet", "--table", "esc")
    table = pq.read_table(tmp_path / "esc.parquet")
    assert (table.num_rows, table.schema.names) == (0, ESC.names)
    assert analyzer.open_capture(CAPTURES / "services.log").table("esc").schema == ESC


def test_it_is_in_a_folder_only_if_asked_for(command: Main, tmp_path: Path) -> None:
    command("export", HOVER, "-o", tmp_path / "plain")
    command("export", HOVER, "-o", tmp_path / "more", "--table", "all", "--table", "esc")
    plain_, more = ({path.name for path in (tmp_path / name).iterdir()} for name in ("plain", "more"))
    assert more - plain_ == {"esc.parquet"}
    assert plain_ < more


def test_mcap_has_none(command: Main, tmp_path: Path) -> None:
    status, out, err = command("export", HOVER, "-o", tmp_path / "esc.mcap", "--table", "esc")
    assert (status, out, err.count("\n"), list(tmp_path.iterdir())) == (2, "", 1, [])
    assert "esc is a table for Parquet, Arrow or CSV" in err
