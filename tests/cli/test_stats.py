"""The command stats, and -z of decode: what they print, what they refuse, and with which status."""

from __future__ import annotations

import csv
import io
import json
import os
import re
import threading
from typing import TYPE_CHECKING

import pytest
from kit import CAPTURES

import analyzer
from analyzer.sources import Source
from analyzer.stats.catalogue import STATISTICS, named
from analyzer.views.terminal import display_width

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    Command = Callable[..., tuple[int, str, str]]

HOVER, FAULTS, SERVICES = (CAPTURES / f"{name}.log" for name in ("hover-4", "faults", "services"))
EACH = {name: name for name in STATISTICS} | {"values": "values,ESCStatus.voltage", "io": "io,0.5,ESCStatus"}


@pytest.mark.sampled(4)
@pytest.mark.parametrize("name", [name for name in STATISTICS if name != "odd"])  # no ESC of a hover is: see test_odd
def test_every_statistic_in_every_form(name: str, command: Command) -> None:
    status, out, err = command("stats", EACH[name], HOVER)
    assert (status, err) == (0, "")
    assert max(map(display_width, out.splitlines())) <= 80
    assert f"\n{name}  " in out
    status, out, _ = command("stats", EACH[name], HOVER, "-T", "json")
    content = json.loads(out)
    assert (status, content["frames"], content["all_transfers"]) == (0, 4788, 2812)
    tables = content["statistics"]
    assert name in tables
    status, out, _ = command("stats", EACH[name], HOVER, "-T", "csv")
    rows = list(csv.DictReader(io.StringIO(out)))
    main = list(tables)[-1]
    assert len(rows) == len(tables[main]["rows"]) > 0
    assert list(rows[0]) == list(tables[main]["rows"][0])
    table = analyzer.open_capture(HOVER).stats(EACH[name])
    assert table.column_names == list(rows[0])
    assert table.num_rows == len(rows)


@pytest.mark.parametrize(
    "line",
    [("-z", "io,5", HOVER), (HOVER, "-z", "io,5"), ("-z", "io,5", "-r", HOVER), ("-z", "io,5", "-z", "nodes", HOVER)],
)
def test_they_are_named_by_letter_alone_as_tshark_has_it(line: tuple[object, ...], command: Command) -> None:
    more = [word for word in line if word == "nodes"]
    status, out, _ = command("stats", "io,5", *(part for name in more for part in ("-z", name)), HOVER)
    assert status == 0
    assert command("stats", *line) == (0, out, "")


def test_which_one_is_asked_for(command: Command) -> None:
    assert command("stats", "-r", HOVER)[2].startswith("tailbyte stats: argument NAME[,ARGS]: which statistic? one of")
    assert command("stats", "-z", "io,5", "missing.log")[2].startswith("tailbyte: missing.log: No such file")
    assert command("stats", "-z", "io,5", "missing")[2].startswith(
        "tailbyte stats: argument NAME[,ARGS]: no statistic is called 'missing'"
    )


@pytest.mark.slow
def test_several_in_one_reading_are_what_each_is_alone(command: Command) -> None:
    texts = list(EACH.values())
    _, together, _ = command("stats", texts[0], *(part for text in texts[1:] for part in ("-z", text)), FAULTS)
    for text in texts:
        _, alone, _ = command("stats", text, FAULTS)
        assert "\n".join(alone.splitlines()[4:]) in together
    _, out, _ = command("stats", "nodes", "-z", "io,5", HOVER, "-T", "csv")
    assert [line for line in out.splitlines() if line.startswith("#")] == ["# nodes", "# io"]
    both = analyzer.open_capture(HOVER).statistics(["io,1", "io,5"])
    assert [table.num_rows for table in both.values()] == [5, 1]


def test_decode_prints_them_behind_the_list_or_instead(command: Command) -> None:
    _, alone, _ = command("stats", "services", "-z", "io,1", SERVICES)
    status, out, err = command("decode", "-q", "-z", "services", "-z", "io,1", SERVICES)
    assert (status, out, err) == (0, alone, "")
    _, listed, _ = command("decode", SERVICES)
    status, out, _ = command("decode", SERVICES, "-z", "services", "-z", "io,1")
    assert (status, out) == (0, f"{listed}\n{alone}")


def test_a_list_and_statistics_are_one_reading(
    command: Command, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    """So that a pipe is enough; the statistics are of all, however many rows are shown."""
    monkeypatch.chdir(tmp_path)
    _, alone, _ = command("stats", "services", "-z", "io,1", SERVICES)
    pipe = tmp_path / "pipe.log"
    os.mkfifo(pipe)
    writer = threading.Thread(target=pipe.write_bytes, args=(SERVICES.read_bytes(),))
    writer.start()
    status, out, _ = command("decode", "pipe.log", "-c", "2", "-z", "services", "-z", "io,1")
    writer.join()
    listed, _, tables = out.partition("\n\n")
    assert (status, len(listed.splitlines())) == (0, 3)
    assert tables.splitlines()[1:] == alone.splitlines()[1:]
    monkeypatch.setattr(Source, "again", lambda _: pytest.fail("it was opened again"))
    for more in (["-z", "io,1", "-Y", "node == 12"], ["-z", "findings"]):
        _, out, _ = command("decode", HOVER, "-z", "talkers", *more)
        assert out.endswith(command("stats", "talkers", *more, HOVER)[1])


def test_frames_that_another_capture_repeats_are_told(command: Command) -> None:
    _, out, _ = command("stats", "io,0", "--same-bus", HOVER, HOVER)
    assert "4788 frames, 2812 transfers\nand 4788 repeated frames" in out
    content = json.loads(command("stats", "io,0", "--same-bus", HOVER, HOVER, "-T", "json")[1])
    assert (content["frames"], content["repeated_frames"]) == (4788, 4788)
    assert "repeated" not in command("stats", "io,0", HOVER)[1]


@pytest.mark.slow
def test_findings_have_the_order_of_check(command: Command) -> None:
    for path in (FAULTS, CAPTURES / "mission-8-faults.log"):
        out = command("check", path)[1]
        shown = [line.split()[1] for line in out.splitlines() if re.match(r"(error|warning|note) +[A-Z]+-\d", line)]
        rows = json.loads(command("stats", "findings", path, "-T", "json")[1])["statistics"]["findings"]["rows"]
        rules = [row["rule"] for row in rows]
        assert [rule for rule in rules if rule in shown] == list(dict.fromkeys(shown))
    assert command("stats", "expert", FAULTS) == command("stats", "findings", FAULTS)


def test_what_the_worst_second_leaves_out_is_counted(command: Command) -> None:
    path = CAPTURES / "mission-8-faults.log"
    worst = json.loads(command("stats", "load", path, "-T", "json")[1])["statistics"]["load_worst"]
    rest = sum(row["share_pct"] for row in worst["rows"][12:])
    assert sum(row["share_pct"] for row in worst["rows"]) == pytest.approx(100)
    assert worst["notes"] == [f"can0: and {len(worst['rows']) - 12} more, {rest:.1f} % of it together; -T json has all"]
    out = command("stats", "load", path)[1]
    assert f"and {len(worst['rows']) - 12} more" in out
    assert analyzer.open_capture(path).statistics(["load"])["load_worst"].num_rows == len(worst["rows"])


@pytest.mark.parametrize("form", ["", "relative"])
@pytest.mark.parametrize("interval", ["1us", "50us", "1ms", "2.5ms", "1.0001"])
def test_no_two_intervals_have_one_label(interval: str, form: str, command: Command, tmp_path: Path) -> None:
    path = HOVER
    if form:
        path = tmp_path / "relative.log"
        path.write_text(HOVER.read_text().replace("(17734753", "(00000000"))
    out = command("stats", f"io,{interval}", path, "--frames", "1-40")[1]
    lines = [re.split(r"  +", line.strip()) for line in out.splitlines() if re.match(r" *\d+\.\d{3,} ", line)]
    lines = [line for line in lines if len(line) > 2]
    assert len({line[0] for line in lines}) == len({line[1] for line in lines}) == len(lines) > 0


def test_a_few_transfers_have_no_rate(command: Command) -> None:
    rows = json.loads(command("stats", "talkers", SERVICES, "-T", "json")[1])["statistics"]["talkers"]["rows"]
    assert {row["hz"] is None for row in rows if (row["transfers"] or 0) < 4} == {True}
    assert any(row["hz"] for row in rows)


def test_losses_of_two_devices_with_one_node_id_are_none(command: Command) -> None:
    path = CAPTURES / "duplicate-node.log"
    table = json.loads(command("stats", "nodes", path, "-T", "json")[1])["statistics"]["nodes"]
    assert {row["node"]: row["lost"] for row in table["rows"]} == {"10": 0, "11": 0, "12": 0, "13": None, "125": 0}
    assert any("two transfer-ID counters under one node ID" in note for note in table["notes"])
    assert "372" not in command("info", path)[1]


def test_a_cell_of_csv_is_no_formula(command: Command, tmp_path: Path) -> None:
    path = tmp_path / "bus.log"
    path.write_text(HOVER.read_text().replace(" can0 ", " =cmd|1 "))
    rows = list(csv.DictReader(io.StringIO(command("stats", "talkers", path, "-T", "csv")[1])))
    assert {row["bus"] for row in rows} == {"'=cmd|1"}


def test_windows_and_filters(command: Command) -> None:
    for window in (
        ["--frames", "101-300"],
        ["--last", "1s"],
        ["--from", "1", "--to", "2.5"],
        ["--around", "500+-100ms"],
    ):
        _, out, _ = command("stats", "io,0", HOVER, "-T", "json", *window)
        _, listed, _ = command("decode", "--frame-list", "-T", "jsonl", HOVER, *window)
        content = json.loads(out)
        assert content["frames"] == len(listed.splitlines()) == content["statistics"]["io"]["total"]["frames"]
        assert content["window"] == [" ".join(window)] or len(content["window"]) == 2
    _, out, _ = command("stats", "talkers", HOVER, "-T", "json", "-Y", "node == 12", "--last", "1s")
    content = json.loads(out)
    assert {row["type"] for row in content["statistics"]["talkers"]["rows"]} == {
        "ESCStatus",
        "PUSHCAN",
        "NodeStatus",
        "ParamGet",
    }
    assert content["filter"] == "node == 12"
    assert 0 < content["frames"] < content["all_frames"]


@pytest.mark.slow
def test_findings_are_those_of_check(command: Command, tmp_path: Path) -> None:
    for where in ([], ["-Y", "node == 12"]):
        command("check", FAULTS, "--json", tmp_path / "report.json", "--force", *where)
        _, out, _ = command("stats", "findings", FAULTS, "-T", "json", *where)
        found = json.loads((tmp_path / "report.json").read_bytes())["findings"]
        rows = json.loads(out)["statistics"]["findings"]["rows"]
        assert sum(row["findings"] for row in rows) == len(found) > 0
        assert {row["rule"]: row["count"] for row in rows} == {
            rule: sum(one["count"] for one in found if one["rule"] == rule) for rule in {one["rule"] for one in found}
        }


@pytest.mark.parametrize(
    ("counted", "where"),
    [
        ("ESCStatus", "ESCStatus"),
        ("PUSHCAN.MotorStatus", "PUSHCAN.MotorStatus"),
        ("ESCStatus)(node == 12", "ESCStatus && (node == 12)"),
        ("PUSHCAN.MotorStatus.fault.stall", "PUSHCAN.MotorStatus.fault.stall"),
    ],
)
def test_a_type_is_counted_where_it_is_there_and_a_flag_where_it_is_set(
    counted: str, where: str, command: Command
) -> None:
    wish = f"COUNT({counted})"
    _, out, _ = command("stats", f"io,0.5,{wish}", FAULTS, "-T", "json")
    table = json.loads(out)["statistics"]["io"]
    _, listed, _ = command("decode", FAULTS, "-Y", where, "-T", "jsonl")
    assert table["total"][wish] == sum(row[wish] for row in table["rows"]) == len(listed.splitlines())


@pytest.mark.parametrize(
    ("arguments", "reason"),
    [
        (["tlkers", HOVER], "did you mean talkers?"),
        ([HOVER], "is a capture: a statistic stands before it"),
        (["talkers,1", HOVER], "talkers takes no arguments"),
        (["values", HOVER], "values needs a field"),
        (["values,ESCStatus.rpm,ESCStatus.voltage", HOVER], "-z values,ESCStatus.rpm -z values,ESCStatus.voltage"),
        (["values,ESCStatus", HOVER], "ESCStatus is a type"),
        (["values,ESCStatus.voltge", HOVER], "did you mean ESCStatus.voltage"),
        (["io,fast", HOVER], "'fast' is not a duration"),
        (["io,1,can.len >", HOVER], "the filter ends here"),
        (["io,1,AVG(ESCStatus.voltage", HOVER], "has no closing bracket"),
        (["io,1,AVG(ESCStatus)", HOVER], "ESCStatus is a type: AVG needs a field"),
        (["io,1,AVG", HOVER], "the field stands in brackets"),
        (
            ["io,1,avg(ESCStatus.voltage)", HOVER],
            "COUNT, SUM, MIN, MAX and AVG, as in AVG(FIELD)",
        ),
        (["io,1,MEAN(ESCStatus.voltage)", HOVER], "there are COUNT, SUM, MIN, MAX and AVG"),
        (["io,1,max(ESCStatus.voltage)", HOVER], "as in AVG(FIELD), in capitals"),
        (["io,1,AVG()", HOVER], "needs a field, as in AVG(FIELD)"),
        (["io,1,max(ESCStatus.voltage) > 3 V && ESCStatus.voltge", HOVER], "did you mean ESCStatus.voltage"),
        (["io,1" + ",ESCStatus" * 33, HOVER], "at most 32 filters"),
        (["io,1ns", HOVER, "-z", "load"], ""),
        (["talkers", HOVER, "-z", "nothing"], "no statistic is called 'nothing'"),
        (["talkers", HOVER, "-Y", "ESCStatus.voltage < 44 A"], "44 A"),
        (["talkers", HOVER, "--from", "100"], "nothing is inside the window"),
        (["talkers"], "which capture?"),
    ],
)
def test_what_makes_no_sense(arguments: list[object], reason: str, command: Command) -> None:
    status, out, err = command("stats", *arguments)
    if not reason:
        assert status == 0
        return
    assert (status, out) == (2, "")
    assert reason in err
    assert "Traceback" not in err


def test_too_short_an_interval(command: Command, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("analyzer.stats.intervals.MOST_INTERVALS", 100)
    status, out, err = command("stats", "io,1ms", HOVER)
    assert (status, out) == (2, "")
    assert "a longer INTERVAL is needed" in err


def test_decode_refuses_what_it_cannot_do(command: Command) -> None:
    assert "text, json, csv" in command("decode", "-q", "-T", "jsonl", "-z", "io", HOVER)[2]
    assert command("decode", "-T", "json", "-z", "io", HOVER)[0] == 2
    assert command("decode", "-z", "io", "--follow", HOVER)[0] == 2
    assert "reads the capture twice" in command("decode", "-z", "io", "--last", "1s", "-")[2]


def test_captures_that_are_damaged_or_empty(command: Command, tmp_path: Path) -> None:
    path = tmp_path / "empty.log"
    path.touch()
    status, out, err = command("stats", "talkers", "-z", "load", "-z", "values,NodeStatus.uptime_sec", path)
    assert status == 3
    assert out.count("\n  nothing\n") >= 3
    assert "empty" in err
    path.write_bytes(HOVER.read_bytes()[:-20] + b"\x00garbage")
    status, out, _ = command("stats", "hierarchy", path)
    assert status == 3
    assert "4787" in out
    assert command("stats", "talkers", tmp_path / "none.log")[:2] == (3, "")


def test_buses_stand_apart(command: Command) -> None:
    status, out, _ = command("stats", "talkers", "-z", "load", HOVER, SERVICES, "--bus", f"left={HOVER}")
    assert status == 0
    assert max(map(display_width, out.splitlines())) <= 80
    buses = {line.split()[0] for line in out.splitlines() if line.startswith(("left", "can0"))}
    assert buses == {"left", "can0"}


def test_arguments_are_cut_at_commas_that_are_nobody_elses() -> None:
    text = 'io,1,frame.number in {1,2},MAX(max(can.len, 3))node.label == "a,b\\",c",x'
    assert named(text) == ("io", ["1", "frame.number in {1,2}", 'MAX(max(can.len, 3))node.label == "a,b\\",c"', "x"])
