"""`tailbyte export`: the values of `Capture.table` in every format, windows, chosen tables, pandas and SQL."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Any

import duckdb
import pandas as pd
import pyarrow.parquet as pq
import pytest
from kit.command import CAPTURES, HOVER, run
from kit.exported import as_csv, csv_cell, expected, names_of, plain, read_csv, read_table, same

import analyzer
from analyzer.tables import VERDICTS

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    Main = Callable[..., tuple[int, str, str]]
    Rows = list[dict[str, Any]]

FAULTS = CAPTURES / "faults.log"
ALL = sorted(path for path in CAPTURES.iterdir() if path.suffix in (".log", ".txt"))


@pytest.mark.slow
@pytest.mark.parametrize("capture", ALL, ids=lambda path: path.stem)
@pytest.mark.parametrize("form", ["parquet", "arrow"])
def test_every_table_has_the_values_of_the_api(command: Main, tmp_path: Path, capture: Path, form: str) -> None:
    status, out, err = command("export", capture, "-o", tmp_path / "out", "-F", form)
    opened = analyzer.open_capture(capture)
    names = names_of(opened)
    assert status == (3 if " unreadable" in err else 0)
    assert out == ""
    assert sorted(path.name for path in (tmp_path / "out").iterdir()) == sorted(f"{name}.{form}" for name in names)
    for name in names:
        table = read_table(tmp_path / "out" / f"{name}.{form}")
        table.validate(full=True)
        assert same(plain(table), expected(opened, name)), name
    assert f"-- {len(names)} tables with " in err


@pytest.mark.slow
@pytest.mark.parametrize("capture", ALL, ids=lambda path: path.stem)
def test_csv(command: Main, tmp_path: Path, capture: Path) -> None:
    command("export", capture, "-o", tmp_path, "-F", "csv")
    opened = analyzer.open_capture(capture)
    for name in names_of(opened):
        schema = opened.table(name).schema
        wanted = [as_csv(row, schema) for row in expected(opened, name)]
        got = list(read_csv(tmp_path / f"{name}.csv"))
        assert len(got) == len(wanted)
        for left, right in zip(got, wanted, strict=True):
            assert list(left) == list(right), name
            assert same({key: csv_cell(text, right[key]) for key, text in left.items()}, right), name


def test_units_enumerations_and_clauses_are_kept(command: Main, tmp_path: Path) -> None:
    command("export", HOVER, "-o", tmp_path / "p")
    command("export", HOVER, "-o", tmp_path / "a", "-F", "arrow")
    for path in (tmp_path / "p/ESCStatus.parquet", tmp_path / "a/ESCStatus.arrow"):
        table = read_table(path)
        schema, about = table.schema, table.schema.metadata
        assert schema.field("voltage").metadata[b"unit"] == b"V"
        assert schema.field("voltage").metadata[b"clause"] == b"4.4.3 no 5-6"
        assert json.loads(schema.field("error_count.mode").metadata[b"enum"])["4"] == "operating"
        assert about[b"clause"] == b"4.4.3"
        assert about[b"type"] == b"uavcan.equipment.esc.Status"
    assert about[b"tailbyte.capture"] == str(HOVER).encode()
    file = pq.ParquetFile(tmp_path / "p/ESCStatus.parquet").metadata
    assert file.metadata[b"tailbyte.capture"] == str(HOVER).encode()
    assert json.loads(file.metadata[b"tailbyte.buses"]) == ["can0"]
    assert b"tailbyte.version" in file.metadata
    assert {file.row_group(0).column(k).compression for k in range(file.num_columns)} == {"ZSTD"}


def test_pandas_reads_times_and_texts(command: Main, tmp_path: Path) -> None:
    command("export", FAULTS, "-o", tmp_path)
    frames = pd.read_parquet(tmp_path / "frames.parquet")
    assert str(frames.t.dtype) == "datetime64[ns]"
    assert frames.t[0] == pd.Timestamp("2026-03-14 08:02:10.000141")
    assert (frames.verdict == "orphan").sum() == 8
    assert list(frames.frame) == list(range(1, 1967))
    status = pd.read_parquet(tmp_path / "ESCStatus.parquet")
    assert "operating" in set(status["error_count.mode.text"])


def test_sql_reads_and_joins_all_tables(command: Main, tmp_path: Path) -> None:
    command("export", FAULTS, "-o", tmp_path)
    with duckdb.connect() as db:

        def ask(text: str) -> list[tuple[Any, ...]]:
            return db.sql(text.replace("$", f"{tmp_path}/")).fetchall()

        for path in tmp_path.iterdir():
            rows = pq.ParquetFile(path).metadata.num_rows
            assert ask(f"SELECT count(*) FROM '{path}'") == [(rows,)]
        assert ask("SELECT epoch_ns(t) FROM '$frames.parquet' WHERE frame = 1") == [(1_773_475_330_000_141_000,)]
        assert ask("SELECT DISTINCT bus FROM '$frames.parquet'") == [("can0",)]
        broken = "SELECT status, anomaly FROM '$transfers.parquet' WHERE status = 'bad crc'"
        assert ask(broken) == [("bad crc", "crc")] * 2
        loose = """
            SELECT count(*) FROM '$frames.parquet' f WHERE verdict = 'used' AND f.frame NOT IN
                (SELECT unnest(frames) FROM '$transfers.parquet')"""
        assert ask(loose) == [(0,)]
        join = """
            SELECT count(*), bool_and(m.t = x.t)
            FROM '$ESCStatus.parquet' m JOIN '$transfers.parquet' x USING (transfer)"""
        assert ask(join) == [(len(analyzer.open_capture(FAULTS).table("ESCStatus")), True)]


@pytest.mark.slow
@pytest.mark.parametrize("waiting", [0, 100, 1 << 18])
def test_late_verdicts_are_right(
    command: Main, decode: Callable[..., Any], tmp_path: Path, monkeypatch: pytest.MonkeyPatch, waiting: int
) -> None:
    """Cut into many batches, frames of one are settled by a later one; row groups stay large.

    All wait on the disk, or those from some place on, or none.
    """
    wanted = decode(FAULTS.read_bytes())
    monkeypatch.setattr("analyzer.sinks.late.MOST_WAITING", waiting)
    monkeypatch.setattr("analyzer.decode.core.BATCH_ROWS", 50)
    monkeypatch.setattr("analyzer.sources.stored.CHUNK", 2000)
    assert sum(len(batch.settled) for batch in analyzer.open_capture(FAULTS)) > 0
    command("export", FAULTS, "-o", tmp_path)
    frames = pq.ParquetFile(tmp_path / "frames.parquet")
    assert frames.num_row_groups == 1
    table = frames.read()
    assert table.column("verdict").to_pylist() == wanted.verdicts
    assert [set((text or "").split(", ")) - {""} for text in table.column("anomaly").to_pylist()] == [
        row["anomaly"] for row in wanted.frames
    ]
    command("export", FAULTS, "-o", tmp_path, "--frames", "300-1700", "--table", "frames", "--force")
    assert pq.read_table(tmp_path / "frames.parquet").column("verdict").to_pylist() == wanted.verdicts[299:1700]
    assert set(wanted.verdicts[299:1700]) > {VERDICTS[0]}


@pytest.mark.slow
@pytest.mark.parametrize("form", ["parquet", "arrow", "csv"])
def test_many_batches_make_the_same_tables(
    command: Main, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, form: str
) -> None:
    command("export", FAULTS, "-o", tmp_path / "one", "-F", form)
    monkeypatch.setattr("analyzer.decode.core.BATCH_ROWS", 50)
    monkeypatch.setattr("analyzer.sources.stored.CHUNK", 2000)
    monkeypatch.setattr("analyzer.sinks.tables.ROW_GROUP", 100)
    monkeypatch.setattr("analyzer.sinks.csv._AT_ONCE", 7)
    command("export", FAULTS, "-o", tmp_path / "many", "-F", form)
    for path in (tmp_path / "one").iterdir():
        other = tmp_path / "many" / path.name
        if form == "csv":
            assert other.read_bytes() == path.read_bytes()
        else:
            assert same(plain(read_table(other)), plain(read_table(path))), path.name
    if form == "parquet":
        assert pq.ParquetFile(tmp_path / "many/frames.parquet").num_row_groups > 10


WINDOWS: list[tuple[str, ...]] = [
    ("--from", "0.5", "--to", "1.25"),
    ("--last", "0.5s"),
    ("--around", "453+-8ms"),
    ("--frames", "300-400"),
    ("--frames", "-20"),
]


@pytest.mark.slow
@pytest.mark.parametrize("window", WINDOWS, ids=" ".join)
def test_windows(command: Main, tmp_path: Path, window: tuple[str, ...]) -> None:
    """Frames and events by their own time or number, transfers as `decode` shows them, messages as their transfers."""
    command("export", FAULTS, "-o", tmp_path, *window)
    shown = command("decode", FAULTS, "-T", "jsonl", *window)[1].splitlines()
    tables = {path.stem: plain(pq.read_table(path)) for path in tmp_path.iterdir()}
    assert sorted(row["frames"] for row in tables["transfers"]) == sorted(json.loads(line)["frames"] for line in shown)
    whole = {name: expected(analyzer.open_capture(FAULTS), name) for name in tables}
    low, high = limits(window, whole["frames"])
    for name, rows in tables.items():
        if name in ("frames", "transfers"):
            assert all(row in whole[name] for row in rows)
        if name not in ("frames", "transfers", "events"):
            inside = {row["transfer"] for row in tables["transfers"]}
            assert same(rows, [row for row in whole[name] if row["transfer"] in inside]), name
    assert tables["frames"] == [row for row in whole["frames"] if low <= row["frame"] <= high]
    lines = [row["line"] for row in tables["frames"]]
    between = [row for row in whole["events"] if lines and lines[0] < row["line"] < lines[-1]]
    assert [row for row in tables["events"] if row in between] == between


def limits(window: tuple[str, ...], frames: Rows) -> tuple[int, int]:
    """The first and the last frame number, by hand."""
    start, end = frames[0]["t"], max(row["t"] for row in frames)
    if window[0] == "--frames":
        low, _, high = window[1].partition("-")
        return int(low or 1), int(high)
    span = {
        "0.5": (start + 500_000_000, start + 1_250_000_000),
        "0.5s": (end - 500_000_000, end),
        "453+-8ms": (frames[452]["t"] - 8_000_000, frames[452]["t"] + 8_000_000),
    }[window[1]]
    inside = [row["frame"] for row in frames if span[0] <= row["t"] <= span[1]]
    assert inside == list(range(inside[0], inside[-1] + 1))
    return inside[0], inside[-1]


def test_chosen_tables(command: Main, tmp_path: Path) -> None:
    """Short names are understood; a table that does not occur has its columns."""
    chosen = ("frames", "NodeStatus", "pushcan.MotorStatus", "uavcan.equipment.gnss.Fix2")
    args = [part for name in chosen for part in ("--table", name)]
    assert command("export", HOVER, "-o", tmp_path / "out", *args)[0] == 0
    files = {path.stem: pq.ParquetFile(path) for path in (tmp_path / "out").iterdir()}
    assert sorted(files) == sorted(
        ["frames", "uavcan.protocol.NodeStatus", "PUSHCAN.MotorStatus", "uavcan.equipment.gnss.Fix2"]
    )
    assert files["PUSHCAN.MotorStatus"].metadata.num_rows == 40
    assert files["uavcan.equipment.gnss.Fix2"].metadata.num_rows == 0
    assert "latitude_deg" in files["uavcan.equipment.gnss.Fix2"].schema_arrow.names


@pytest.mark.slow
@pytest.mark.parametrize("form", ["parquet", "arrow", "csv"])
def test_one_table_in_one_file(command: Main, tmp_path: Path, form: str) -> None:
    one, folder = tmp_path / f"esc.{form}", tmp_path / "out"
    assert command("export", HOVER, "-o", one, "--table", "ESCStatus")[0] == 0
    command("export", HOVER, "-o", folder, "-F", form)
    assert one.read_bytes() == (folder / f"ESCStatus.{form}").read_bytes()
    assert run("export", HOVER, "-o", "-", "-F", form, "--table", "ESCStatus").stdout == one.read_bytes()


def test_nothing_is_left_out_of_an_empty_capture(command: Main, tmp_path: Path) -> None:
    (tmp_path / "empty.log").write_bytes(b"")
    status, _, err = command("export", tmp_path / "empty.log", "-o", tmp_path / "out")
    assert (status, "empty" in err) == (3, True)
    for name in ("frames", "transfers", "events"):
        table = pq.read_table(tmp_path / "out" / f"{name}.parquet")
        assert (len(table), "bus" in table.column_names) == (0, True)


def test_a_spreadsheet_finds_no_formula(command: Main, tmp_path: Path) -> None:
    (tmp_path / "a.log").write_text("=cmd|'/C calc'!A0\n(1.0) =1+1 1F04060A#00000000000000C0\n# +note\n")
    command("export", tmp_path / "a.log", "-o", tmp_path / "out", "-F", "csv")
    cells = [cell for path in (tmp_path / "out").iterdir() for row in read_csv(path) for cell in row.values()]
    assert "'=1+1" in cells
    assert not [cell for cell in cells if cell.startswith(("=", "+", "@", "\t", "-"))]
