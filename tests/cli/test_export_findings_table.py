"""Findings as a table: those of `check`, in every format, joined to the other tables by frame and transfer."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from kit.command import CAPTURES, HOVER
from kit.exported import as_csv, csv_cell, plain, read_csv, read_table, same

import analyzer
from analyzer.sinks import portable
from analyzer.sinks.transfer_index import TransferIndex
from analyzer.tables import FINDINGS

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    Main = Callable[..., tuple[int, str, str]]
    Rows = list[dict[str, Any]]

FAULTS = CAPTURES / "faults.log"


def exported(command: Main, path: Path, capture: Path, *more: object) -> Rows:
    assert command("export", capture, "-o", path, "--table", "findings", *more)[0] in (0, 3)
    return plain(read_table(path))


def test_they_are_those_of_check(command: Main, tmp_path: Path) -> None:
    report = analyzer.check(FAULTS)
    rows = exported(command, tmp_path / "f.parquet", FAULTS)
    assert [row["finding"] for row in rows] == list(range(1, len(report.findings) + 1))
    for row, one in zip(rows, report.findings, strict=True):
        assert (row["rule"], row["severity"], row["category"], row["origin"], row["title"], row["text"]) == (
            one.rule, one.severity, one.category, one.origin, one.title, one.text,
        )  # fmt: skip
        assert [row[name] or "" for name in ("clause", "bus", "label", "type", "key", "cause")] == [
            one.clause, one.bus, one.label, one.type, one.key, one.cause,
        ]  # fmt: skip
        assert (row["t"], row["t_end"], row["frame"], row["frame_end"]) == (
            one.first.t_ns, one.last.t_ns, one.first.frame, one.last.frame,
        )  # fmt: skip
        assert (row["node"], row["count"], tuple(row["frames"]), row["waived"]) == (
            one.node, one.count, one.frames, False,
        )  # fmt: skip


def test_rows_join_the_other_tables(command: Main, tmp_path: Path) -> None:
    command("export", FAULTS, "-o", tmp_path / "all", "--table", "all", "--table", "findings")
    tables = {path.stem: plain(read_table(path)) for path in (tmp_path / "all").iterdir()}
    assert {"frames", "transfers", "events", "ESCStatus", "findings"} <= set(tables)
    holder = {frame: row["transfer"] for row in tables["transfers"] for frame in row["frames"]}
    times = {row["frame"]: row["t"] for row in tables["frames"]}
    for row in tables["findings"]:
        assert row["transfer"] == holder.get(row["frame"])
        assert row["transfers"] == list(dict.fromkeys(holder[frame] for frame in row["frames"] if frame in holder))
        assert row["frame"] is None or times[row["frame"]] == row["t"]
    assert {row["transfer"] is None for row in tables["findings"]} == {True, False}
    broken = {row["transfer"] for row in tables["transfers"] if row["status"] == "bad crc"}
    assert {row["transfer"] for row in tables["findings"] if row["rule"] == "TRF-010"} == broken


@pytest.mark.sampled(4)
@pytest.mark.parametrize("form", ["arrow", "csv"])
def test_every_format_has_them(command: Main, tmp_path: Path, form: str) -> None:
    wanted = exported(command, tmp_path / "f.parquet", FAULTS)
    path = tmp_path / f"f.{form}"
    if form == "arrow":
        assert exported(command, path, FAULTS) == wanted
        return
    assert command("export", FAULTS, "-o", path, "--table", "findings")[0] == 3
    schema = pq.read_schema(tmp_path / "f.parquet")
    for got, row in zip(read_csv(path), wanted, strict=True):
        like = as_csv(row, schema)
        assert same({key: csv_cell(text, like[key]) for key, text in got.items()}, like)


def test_columns_say_what_they_are(command: Main, tmp_path: Path) -> None:
    assert exported(command, tmp_path / "f.parquet", HOVER, "--select", "TRF-010") == []
    schema = pq.read_schema(tmp_path / "f.parquet")
    assert schema.names == FINDINGS.names
    assert all(field.metadata[b"about"] for field in schema)
    assert schema.field("frame").metadata[b"about"].endswith(b"from 1; null when it has none")


@pytest.mark.slow
def test_rules_are_chosen(command: Main, tmp_path: Path) -> None:
    rules = lambda *more: {row["rule"] for row in exported(command, tmp_path / "f.arrow", FAULTS, *more)}  # noqa: E731
    every = rules()
    assert rules("--select", "TRF") == {rule for rule in every if rule.startswith("TRF")} != set()
    assert rules("--ignore", "TRF,CAN") == {rule for rule in every if not rule.startswith(("TRF", "CAN"))}
    vehicle = tmp_path / "vehicle.toml"
    vehicle.write_text(
        '[rule.TRF-010]\nseverity = "note"\n'
        '[[waiver]]\nrule = "TRF-003"\nreason = "known"\nowner = "me"\nexpires = 2999-01-01\n'
    )
    rows = exported(command, tmp_path / "f.arrow", FAULTS, "--vehicle", vehicle)
    assert {row["severity"] for row in rows if row["rule"] == "TRF-010"} == {"note"}
    assert {row["rule"] for row in rows if row["waived"]} == {"TRF-003"}


@pytest.mark.parametrize(
    ("args", "said"),
    [
        (["--table", "findings", "--select", "NO-1"], "no rule is called 'NO-1'"),
        (["--table", "findings", "--vehicle", "missing.toml"], "No such file"),
        (["--select", "TRF", "--table", "frames"], "rules are chosen, but no findings: give --table findings"),
        (["--table", "all"], "one file holds one table"),
    ],
)
def test_what_makes_no_sense(command: Main, tmp_path: Path, args: list[str], said: str) -> None:
    status, out, err = command("export", HOVER, "-o", tmp_path / "f.csv", *args)
    assert (status, out, err.count("\n")) == (2, "", 1)
    assert said in err
    assert not list(tmp_path.iterdir())


def test_a_window_keeps_those_that_meet_it(command: Main, tmp_path: Path) -> None:
    whole = exported(command, tmp_path / "f.arrow", FAULTS)
    inside = exported(command, tmp_path / "f.arrow", FAULTS, "--frames", "450-800")
    numbers = [row for row in whole if row["frame"] is not None]
    wanted = {row["text"] for row in numbers if row["frame"] <= 800 and row["frame_end"] >= 450}
    assert wanted <= {row["text"] for row in inside}
    assert not {row["text"] for row in numbers if row["frame"] > 800} & {row["text"] for row in inside}


def test_all_into_mcap_is_what_it_holds_anyway(command: Main, tmp_path: Path) -> None:
    said = [command("export", HOVER, "-o", tmp_path / "f.mcap", *more)[2] for more in ([], ["--table", "all"])]
    assert said[0] == said[1]


def test_from_python(command: Main, tmp_path: Path) -> None:
    rows = exported(command, tmp_path / "f.arrow", FAULTS)
    capture = analyzer.open_capture(FAULTS)
    table = capture.table("findings")
    assert table.schema == FINDINGS
    shown = portable.found(table.combine_chunks().to_batches()[0], capture.buses)
    assert plain(pa.Table.from_batches([shown])) == rows
    assert plain(capture.table("findings")) == plain(table), "a second time"
    transfers = capture.table("transfers").column("frame").to_pylist()
    for row in table.to_pylist():
        assert row["transfer"] is None or row["frame"] in transfers[row["transfer"]]
    chosen = analyzer.open_capture(FAULTS).findings(select=["TRF"], ignore=["TRF-010"])
    assert {rule[:3] for rule in chosen.column("rule").to_pylist()} == {"TRF"}
    assert "TRF-010" not in chosen.column("rule").to_pylist()
    with pytest.raises(LookupError, match="NO-1"):
        capture.findings(select=["NO-1"])


def test_an_index_knows_who_holds_what(decode: Callable[..., Any], flush: object) -> None:
    text = HOVER.read_bytes().splitlines(keepends=True)
    got = decode(b"".join(text[:100]), flush, b"".join(text[100:]))
    index = TransferIndex()
    for batch in got.batches:
        index.feed(batch)
    holder = {frame: k for k, row in enumerate(got.transfers) for frame in row["frame"]}
    some = [frame for frame in holder if frame % 7 == 0]
    assert index.find([*some, 10**9]) == {frame: holder[frame] for frame in some}
    index.close()
