"""`tailbyte fleet check` in this process: what is stored, what is done again, and what is said."""

from __future__ import annotations

import os

import duckdb
import pandas as pd
import polars as pl
import pytest
from kit.command import CAPTURES, HOVER
from kit.fleets import QUICK, SETTINGS, checked, content, logs  # noqa: F401 - a fixture

import analyzer.fleet
from analyzer.cli.fleet.work import _Progress
from analyzer.fleet import driver
from analyzer.fleet.cluster import Serial, tasks
from analyzer.fleet.driver import FleetRun, RunCounts, jobs_of
from analyzer.fleet.jobs import Job
from analyzer.fleet.listing import Provenance, listed
from analyzer.fleet.store import ResultStore
from analyzer.fleet.tables import TABLES, rows_table


def test_everything_is_stored_once(checked, command):  # noqa: F811
    place, arguments = checked
    answers = ResultStore(str(place)).connected()
    rows = answers.execute(
        "select regexp_extract(url, '[^/]*$'), vehicle, outcome, verdict, duplicate from latest order by 1"
    ).fetchall()
    by_name = {row[0]: row[1:] for row in rows}
    assert by_name["v0_again.log.gz"] == ("v0", "judged", "pass", False)
    assert by_name["v0_hover.log.gz"] == ("v0", "judged", "pass", True)
    assert by_name["v1_cut.log.gz"][1] == "damaged"
    assert by_name["v2_garbage.log.gz"][1:3] == ("unreadable", None)
    assert by_name["v3_empty.log.gz"][2] == "not judged"
    assert len(rows) == 10
    before = content(ResultStore(str(place)))
    status, _, said = command(*arguments)
    assert (status, "10 done before" in said) == (0, True)
    assert content(ResultStore(str(place))) == before


def test_it_finds_what_check_finds(checked, logs):  # noqa: F811
    place, _ = checked
    answers = ResultStore(str(place)).connected()
    path = logs / "v5_faults.log.gz"
    report = analyzer.check(str(path))
    rows = answers.execute(
        "select rule, node, count from findings join latest using (key, run) where url = $1", [str(path)]
    ).fetchall()
    assert sorted(rows, key=repr) == sorted(((one.rule, one.node, one.count) for one in report.findings), key=repr)
    rules = answers.execute(
        "select rule, rules.verdict from rules join latest using (key, run) where url = $1", [str(path)]
    ).fetchall()
    assert rules
    assert dict(rules) == {one.rule: one.verdict for one in report.rules}


def test_retry_and_change(checked, logs, command):  # noqa: F811
    place, arguments = checked
    status, _, said = command(*arguments, "--retry", "failed")
    assert (status, "captures: 1 read, 9 done before" in said) == (3, True)
    (logs / "v2_garbage.log.gz").write_bytes((logs / "v3_empty.log.gz").read_bytes() or b"(1.0) can0 123#00\n")
    status, _, said = command(*arguments)
    assert (status, "captures: 1 read, 9 done before" in said) == (0, True)
    status, _, said = command(*arguments, "--ignore", "TRF-003")
    assert "captures: 10 read, 0 done before" in said
    assert ResultStore(str(place)).connected().execute("select count(*) from latest").fetchall() == [(10,)]


def test_others_read_it_too(checked):  # noqa: F811
    place, _ = checked
    store = ResultStore(str(place))
    uris = store.opened("captures").file_uris()
    assert pl.read_delta(store.table("captures")).height == 10
    assert len(pd.concat(map(pd.read_parquet, uris))) == 10
    assert set(pl.read_delta(store.table("esc_health")).columns) == set(TABLES["esc_health"].names)


def test_what_a_dead_driver_left_does_not_count(checked):  # noqa: F811
    place, _ = checked
    store = ResultStore(str(place))
    before = content(store)
    rows = store.opened("findings").to_pyarrow_table().to_pylist()
    store.append({"findings": [rows_table("findings", [{**row, "run": "of a driver that died"} for row in rows])]})
    assert content(store) == before


def test_a_capture_that_vanishes_is_no_verdict(logs, tmp_path):  # noqa: F811
    store = ResultStore(str(tmp_path / "results"))
    jobs = jobs_of(listed([str(logs / "v0*.gz")], store.place), Provenance(), SETTINGS.digest())
    gone = logs / "v0_again.log.gz"
    data = gone.read_bytes()
    gone.unlink()
    run = FleetRun(store, SETTINGS, QUICK)
    run.over(jobs, Serial())
    assert (run.counts.done, run.counts.unavailable) == (1, 1)
    rows = store.connected().execute("select outcome, verdict, attempts from latest where url = $1", [str(gone)])
    assert rows.fetchall() == [("unavailable", None, 2)]
    gone.write_bytes(data)
    run = FleetRun(store, SETTINGS, QUICK)
    run.over(jobs, Serial())
    assert (run.counts.skipped, run.counts.done) == (1, 1)


def test_ctrl_c_keeps_what_is_done(logs, tmp_path):  # noqa: F811
    store = ResultStore(str(tmp_path / "results"))
    jobs = jobs_of(listed([str(logs)], store.place), Provenance(), SETTINGS.digest())

    def stop(counts):
        if counts.done == 3:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        FleetRun(store, SETTINGS, QUICK, stop).over(jobs, Serial())
    assert store.connected().execute("select ended, done from runs").fetchall() == [("interrupted", 3)]
    run = FleetRun(store, SETTINGS, QUICK)
    run.over(jobs, Serial())
    assert (run.counts.skipped, run.counts.done) == (3, 7)


def test_commits_come_in_batches(logs, tmp_path, monkeypatch):  # noqa: F811
    monkeypatch.setattr(driver, "COMMIT_CAPTURES", 4)
    store = ResultStore(str(tmp_path / "results"))
    FleetRun(store, SETTINGS, QUICK).over(
        jobs_of(listed([str(logs)], store.place), Provenance(), SETTINGS.digest()), Serial()
    )
    assert store.opened("captures").version() == 2
    assert store.compact()["captures"] == 1


def test_one_driver_writes_a_folder(tmp_path, command, logs):  # noqa: F811
    store = ResultStore(str(tmp_path / "results"))
    with store.alone():
        status, _, said = command("fleet", "check", logs, "-o", store.place, "--workers", "0")
    assert (status, "another run is writing it" in said) == (3, True)


def sized(*sizes):
    return [Job(str(place), "", size, "", "", "") for place, size in enumerate(sizes)]


def test_two_drivers_of_a_store_lose_nothing_and_count_nothing_twice(logs, tmp_path, monkeypatch):  # noqa: F811
    """Both list before either writes, and their commits alternate, as drivers of a storage without locks may do."""
    monkeypatch.setattr(driver, "COMMIT_CAPTURES", 1)
    store, alone = ResultStore(str(tmp_path / "results")), ResultStore(str(tmp_path / "alone"))
    jobs = jobs_of(listed([str(logs / "v[03]_*.gz")], store.place), Provenance(), SETTINGS.digest())
    second = FleetRun(ResultStore(store.place), SETTINGS, QUICK)

    def meanwhile(counts):
        if counts.done == 1:
            second.over(jobs[1:], Serial())

    first = FleetRun(store, SETTINGS, QUICK, meanwhile)
    first.over(jobs, Serial())
    FleetRun(alone, SETTINGS, QUICK).over(jobs, Serial())
    assert (first.counts.done, second.counts.done) == (len(jobs), len(jobs) - 1)
    assert first.counts.others
    assert content(store) == content(alone)
    assert len(store.opened("captures").to_pyarrow_table()) == 2 * len(jobs) - 1


def test_another_driver_is_told_of_once(capsys):
    progress, counts = _Progress(), RunCounts(others=True)
    progress(counts)
    progress.end(counts)
    assert capsys.readouterr().err.count("another run writes this store, too") == 1


@pytest.mark.parametrize(
    ("sizes", "least", "lengths"),
    [
        ([], 8, []),
        ([10] * 5, 8, [1] * 5),  # fewer than there are places: each alone
        ([10] * 400, 8, [32] * 12 + [16]),
        ([10] * 24, 8, [3] * 8),
        ([5_000_000] * 16, 2, [1] * 16),
        ([None] * 16, 2, [1] * 16),  # a storage that tells no size
        ([10, 10, 9_000_000, 10, 10, 10], 1, [2, 1, 3]),
    ],
)
def test_small_captures_are_done_together(sizes, least, lengths):
    jobs = sized(*sizes)
    found = list(tasks(jobs, least))
    assert [len(some) for some in found] == lengths
    assert [job for some in found for job in some] == jobs


@pytest.mark.parametrize(
    ("arguments", "status", "said"),
    [
        (["check", "captures"], 2, "check needs captures, and a store"),
        (["report"], 2, "report takes one store"),
        (["report", "/nowhere"], 3, "/nowhere: no fleet has been checked into it"),
        (["status", "/nowhere"], 3, "/nowhere: no fleet has been checked into it"),
        (["check", "/nowhere.log", "-o", "x"], 3, "/nowhere.log: no such file"),
        (["check", "/nowhere*.log", "-o", "x"], 4, "/nowhere*.log: no capture"),
        (["check", "captures", "-o", "x", "--name", "*.log"], 2, "it takes {vehicle} and {date}"),
        (["check", "captures", "-o", "x", "--names", "/nowhere.csv"], 2, "/nowhere.csv: No such file"),
        (["check", "captures", "-o", "x", "--select", "NOPE-1"], 2, "NOPE-1"),
        (["export", "captures", "-o", "x"], 2, "export needs a table"),
        (["export", "captures", "-o", "x", "--table", "ESCStatsu"], 2, "ESCStatus"),
        (["fly"], 2, "fly"),
        (["check", HOVER, "-o", "x", "--html", "x.html"], 2, "--html is an option of report, not of check"),
        (
            ["export", HOVER, "-o", "x", "--table", "ESCStatus", "--vehicle", "x.toml"],
            2,
            "--vehicle is an option of check",
        ),
        (["report", "/nowhere", "--table", "ESCStatus"], 2, "--table is an option of export, not of report"),
        (["status", "/nowhere", "--name", "{vehicle}"], 2, "--name is an option of check and export, not of status"),
        (["check", HOVER, "-o", "x", "--scheduler", "tcp://x:1", "--workers", "2"], 2, "one of them"),
        (["report", "/nowhere", "--html", "-", "--json", "-"], 2, "only one of --html and --json"),
        (["check", HOVER, "-o", "x", "--memory", "lots"], 2, "--memory 'lots' is no size, such as 2GiB"),
        (["check", HOVER, "-o", "x", "--memory", "150MiB"], 2, "at least 256MiB"),
    ],
)
def test_slips_of_the_fingers(arguments, status, said, command):
    found = command("fleet", *arguments)
    assert (found[0], said in found[2], found[2].count("\n")) == (status, True, 1), found[2]


def test_workers_that_cannot_be_started_are_told_in_one_line(monkeypatch, command, tmp_path):
    def refuse(**_):
        raise RuntimeError("Nanny failed to start.") from OSError("no more processes")

    monkeypatch.setattr("distributed.LocalCluster", refuse)
    status, _, said = command("fleet", "check", HOVER, "-o", tmp_path / "results")
    assert (status, said) == (3, "tailbyte fleet: no workers can be started: no more processes\n")


def test_without_the_extra_it_says_how_to_get_it(monkeypatch, command):
    monkeypatch.setattr("analyzer.cli.fleet.find_spec", lambda name: None if name == "deltalake" else object())
    status, _, said = command("fleet", "status", "results")
    assert (status, said) == (2, "tailbyte fleet: deltalake not installed: pip install 'tailbyte[fleet]'\n")


def test_a_pattern_that_fits_nothing_is_told(logs, tmp_path, command):  # noqa: F811
    arguments = ["fleet", "check", logs / "v0_*.gz", "-o", tmp_path / "results", "--workers", "0"]
    status, _, said = command(*arguments, "--name", "{vehicle}/{date}/*.mcap")
    assert (status, "tells the vehicle of none of 2 captures" in said) == (0, True), said


def test_of_equal_captures_that_of_a_vehicle_counts(logs, tmp_path, command):  # noqa: F811
    names = tmp_path / "names.csv"
    names.write_text("url,vehicle\nv0_hover.log.gz,v17\n")
    arguments = ["fleet", "check", logs / "v0_*.gz", "-o", tmp_path / "results", "--workers", "0"]
    assert command(*arguments, "--names", names)[0] == 0
    answers = ResultStore(str(tmp_path / "results")).connected()
    assert answers.execute("select vehicle from counted").fetchall() == [("v17",)]


def test_export_writes_a_file_a_capture_and_table_once(logs, tmp_path, command):  # noqa: F811
    place = tmp_path / "tables"
    arguments = ["fleet", "export", logs / "v0_*.gz", "-o", place, "--table", "ESCStatus", "--workers", "0"]
    arguments += ["--name", "{vehicle}_*.log.gz", "--partition", "vehicle,date"]
    assert command(*arguments)[0] == 0
    files = sorted((place / "ESCStatus/vehicle=v0/date=unknown").iterdir())
    whole = analyzer.open_capture(str(logs / "v0_hover.log.gz")).table("ESCStatus")
    assert [len(pd.read_parquet(one)) for one in files] == [len(whole)] * 2
    assert "captures: 0 read, 2 done before" in command(*arguments)[2]
    assert not [name for _, _, names in os.walk(place) for name in names if name.endswith(".part")]


def test_a_table_of_many_captures_as_a_stream(logs):  # noqa: F811
    urls = [str(logs / f"v0_{name}.log.gz") for name in ("hover", "again")]
    whole = analyzer.open_capture(urls[0]).table("ESCStatus")
    rows = analyzer.fleet.scan(urls, "ESCStatus", ["voltage", "t"])
    assert rows.schema.names == ["url", "voltage", "t"]
    found = pl.from_arrow(rows)
    assert found["url"].to_list() == [url for url in urls for _ in range(len(whole))]
    assert found["voltage"].to_list() == 2 * whole.column("voltage").to_pylist()
    rows = analyzer.fleet.scan(urls, "ESCStatus")
    assert duckdb.sql("select url, count(*) from rows group by 1 order by 1").fetchall() == [
        (url, len(whole)) for url in sorted(urls)
    ]
    assert len(analyzer.fleet.scan(urls, "ESCStatus").read_pandas()) == 2 * len(whole)
    with pytest.raises(LookupError, match="ESCStatus"):
        analyzer.fleet.scan(urls, "ESCStatsu")
    with pytest.raises(analyzer.UnavailableError, match=r"gone\.log"):
        list(analyzer.fleet.scan([str(logs / "gone.log")], "ESCStatus"))


def test_captures_of_vehicles_without_a_name_are_of_no_vehicle(tmp_path, command):
    place = tmp_path / "results"
    _, _, said = command("fleet", "check", CAPTURES / "mission-8-faults.log", "-o", place, "--workers", "0")
    assert "captures: 1 read" in said
    _, shown, _ = command("fleet", "report", place, "--by", "rule")
    (line,) = [line for line in shown.splitlines() if "TRF-003" in line]
    assert line.split()[:4] == ["TRF-003", "error", "1", "capture"]
    assert "0 vehicles" in shown
    assert "1 vehicle" not in shown


def test_a_pattern_beside_others_that_names_nothing_is_told(logs, tmp_path, command):  # noqa: F811
    arguments = ["fleet", "check", logs / "nope*", logs / "v0_*.gz", "-o", tmp_path / "results", "--workers", "0"]
    status, _, said = command(*arguments)
    assert (status, said.count("no capture")) == (0, 1)
    assert f"{logs}/nope*: no capture\n" in said
