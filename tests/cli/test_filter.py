"""`-Y` in every command that has it, and `fields`: what is shown, counted, written and said."""

from __future__ import annotations

import io
import json
from typing import TYPE_CHECKING

import pytest
from kit import CAPTURES

import analyzer
import dissectors
from analyzer.cli import main
from analyzer.filter.names import FilterNames

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    Command = Callable[..., tuple[int, str, str]]

FAULTS, HOVER, BREAK = (CAPTURES / f"{name}.log" for name in ("faults", "hover", "bus-break"))
FAILURE = CAPTURES / "esc-failure.mcap"
WRONG = "ESCStatus.voltge < 44"


@pytest.mark.parametrize("form", ["jsonl", "json", "csv", "fields"])
def test_every_form_lists_the_same_rows(command: Command, form: str) -> None:
    more = ["-e", "frame.number"] if form == "fields" else []
    code, out, err = command("decode", FAILURE, "-Y", "ESCStatus.mode == error", "-T", form, *more)
    records = {
        "jsonl": lambda: [json.loads(line)["frame"] for line in out.splitlines()],
        "json": lambda: [row["frame"] for row in json.loads(out)],
        "csv": lambda: [int(line.split(",")[0]) for line in out.splitlines()[1:]],
        "fields": lambda: [int(line) for line in out.splitlines()],
    }[form]()
    capture = analyzer.open_capture(FAILURE, filter="ESCStatus.mode == error")
    assert records == sorted(places[0] + 1 for places in capture.table("transfers").column("frame").to_pylist())
    assert code == 0
    assert "-- 114 of 4769 transfers match; " in err


def test_the_list_details_and_bytes_show_only_these(command: Command) -> None:
    for option in ("-V", "-x", "-P"):
        code, out, _ = command("decode", HOVER, "-Y", "PUSHSCI.OutputControl", option)
        assert code == 0
        assert "PUSHSCI" in out
        assert "ESCStatus" not in out


def test_frames_without_a_transfer_and_error_frames_are_rows(command: Command) -> None:
    _, out, err = command("decode", FAULTS, "-Y", "can.flags.rtr || can.flags.err")
    rows = out.splitlines()[1:]
    assert len(rows) == 3
    assert "remote frame" in rows[1] or "remote frame" in rows[0]
    assert "0 of 1118 transfers match, and 1 frame without one" in err
    _, out, _ = command("decode", FAULTS, "-Y", "!can.id")
    assert len(out.splitlines()) == 1 + 2  # the error frames have none


def test_a_count_is_of_what_is_shown_and_quiet_counts(command: Command) -> None:
    _, out, _ = command("decode", HOVER, "-Y", "NodeStatus", "-c", 3)
    assert sum("NodeStatus" in line for line in out.splitlines()) == 3
    _, out, err = command("decode", HOVER, "-Y", "NodeStatus", "-q")
    assert out == ""
    number = int(err.split()[1])
    assert number == len(analyzer.open_capture(HOVER).table("NodeStatus"))
    _, _, err = command("decode", BREAK, "-q", "--frame-list", "-Y", "can.flags.err || frame.number < 3")
    assert err.startswith("-- 28 of 4258 frames and error frames match")
    text = "frame.time_delta > 1 ms && can.len == 8"
    _, out, _ = command("decode", BREAK, "--frame-list", "-T", "jsonl", "-Y", text)
    _, _, err = command("decode", BREAK, "--frame-list", "-q", "-Y", text)
    assert err.startswith(f"-- {len(out.splitlines())} of 4258 frames and error frames match")


def test_a_window_and_a_filter_hold_both(command: Command) -> None:
    _, out, _ = command("decode", HOVER, "-Y", "ESCStatus", "--frames", "100-200", "-T", "jsonl")
    rows = [json.loads(line) for line in out.splitlines()]
    assert {row["type"] for row in rows} == {"ESCStatus"}
    assert all(95 < row["frame"] <= 200 for row in rows)


def test_findings_mark_what_they_select(command: Command) -> None:
    _, out, _ = command("decode", FAULTS, "-Y", 'finding.rule == "TRF-003"', "--findings", "-T", "jsonl")
    rows = [json.loads(line) for line in out.splitlines()]
    assert rows
    assert all("TRF-003" in row["findings"] for row in rows)


@pytest.mark.sampled(4)
@pytest.mark.parametrize(
    ("text", "word", "reason"),
    [
        ('finding.rule == "TRF-999"', '"TRF-999"', "no rule is called 'TRF-999'; did you mean TRF-0"),
        ('finding.rule in {"TRF-003", "trf-004"}', '"trf-004"', "did you mean TRF-004?"),
        ('finding.rule != "TRF"', '"TRF"', 'for all of these write finding.rule contains "TRF-"'),
        ('node.label == "front lift"', '"front lift"', "no node in the vehicle file is called 'front lift'"),
    ],
)
def test_words_that_exist_nowhere(command: Command, tmp_path: Path, text: str, word: str, reason: str) -> None:
    vehicle = tmp_path / "vehicle.toml"
    vehicle.write_text('[node.11]\nlabel = "front left"\n[rule.ACME-001]\ntitle = "t"\nwhen = "ESCStatus"\n')
    code, out, err = command("decode", HOVER, "--vehicle", vehicle, "-q", "-Y", text)
    assert (code, out) == (2, "")
    assert reason in err
    assert err.splitlines()[2] == f"  {' ' * text.index(word)}{'^' * len(word)}"
    for right in ('node.label == "front left"', 'finding.rule == "ACME-001" && finding.severity == "warning"'):
        code, _, err = command("decode", HOVER, "--vehicle", vehicle, "-q", "-Y", right)
        assert code == 0
        assert not err.startswith("-- 0 of")


def test_an_interface_that_did_not_come_is_said(command: Command, tmp_path: Path) -> None:
    text = 'frame.interface_name == "nope" || NodeStatus'
    said = "has no interface 'nope' (it has can0)\n"
    outputs = {"convert": [tmp_path / "x.log"], "export": ["-o", tmp_path / "x"], "stats": ["nodes"]}
    for name in ("decode", "info", "check", "convert", "export", "stats"):
        more = outputs.get(name, [])
        args = [*more, HOVER] if name == "stats" else [HOVER, *more]
        _, _, err = command(name, *args, "-Y", text)
        assert err.count(said) == 1, (name, err)
    _, _, err = command("decode", HOVER, "-q", "-Y", text.replace("nope", "can0"))
    assert "interface" not in err


def test_what_no_row_can_be_is_said(command: Command) -> None:
    code, _, err = command("decode", HOVER, "-q", "-Y", "ESCStatus && RawCommand")
    assert code == 0
    assert err.startswith("tailbyte: -Y: no row has both ESCStatus and RawCommand: ")


def test_a_pipe_cannot_be_judged_first(command: Command, monkeypatch: pytest.MonkeyPatch) -> None:
    with HOVER.open("rb") as file:
        monkeypatch.setattr("sys.stdin", io.TextIOWrapper(file))
        code, _, err = command("decode", "-", "-Y", 'finding.severity == "error"')
    assert code == 2
    assert err == "tailbyte: -: -Y with finding.* reads a capture twice: save it to a file first\n"


def test_converted_is_what_matches(command: Command, tmp_path: Path) -> None:
    made = tmp_path / "made.log"
    code, _, err = command("convert", FAULTS, made, "-Y", "ESCStatus || can.flags.err")
    assert code == 3  # a line of it cannot be read
    capture = analyzer.open_capture(FAULTS).filter("ESCStatus || can.flags.err")
    assert "do not match" in err
    lines = made.read_text().splitlines()
    frames, events = len(capture.table("frames")), len(capture.table("events"))
    assert len(lines) == frames + events
    assert events == 2
    again = analyzer.open_capture(made).table("transfers")
    assert len(again) == len(capture.table("transfers"))


def test_info_tells_of_what_matches(command: Command, tmp_path: Path) -> None:
    command("convert", FAILURE, tmp_path / "cut.log", "-Y", "src == 11")
    _, told, _ = command("info", FAILURE, "-Y", "src == 11", "-T", "json")
    _, cut, _ = command("info", tmp_path / "cut.log", "-T", "json")
    one, other = json.loads(told), json.loads(cut)
    assert one["nodes"] == other["nodes"]
    assert {node["node"] for node in one["nodes"]} == {11}


def test_check_judges_all_and_reports_what_matches(command: Command, tmp_path: Path) -> None:
    code, _, _ = command("check", FAULTS, "--json", tmp_path / "all.json")
    same, _, err = command("check", FAULTS, "-Y", "src == 11", "--json", tmp_path / "some.json")
    every, some = (json.loads((tmp_path / f"{name}.json").read_text()) for name in ("all", "some"))
    assert same == code
    assert every["rules"] == some["rules"]
    assert every["gate"] == some["gate"]
    assert 0 < len(some["findings"]) < len(every["findings"])
    assert all(one in every["findings"] for one in some["findings"])
    assert any(one["node"] == 11 for one in some["findings"])
    assert f"-- {len(some['findings'])} of {len(every['findings'])} findings match; " in err


def test_exported_are_rows_that_match(command: Command, tmp_path: Path) -> None:
    import pyarrow.parquet as pq  # noqa: PLC0415

    command("export", FAULTS, "-o", tmp_path / "made", "-Y", "src == 11")
    transfers = pq.read_table(tmp_path / "made" / "transfers.parquet")
    frames = pq.read_table(tmp_path / "made" / "frames.parquet")
    assert set(transfers.column("src").to_pylist()) == {11}
    capture = analyzer.open_capture(FAULTS).filter("src == 11")
    assert len(transfers) == len(capture.table("transfers"))
    assert len(frames) == len(capture.table("frames"))


@pytest.mark.parametrize(
    "words", [("decode",), ("decode", "--frame-list"), ("decode", "-q"), ("info",), ("check",), ("plot", "-o", "x.rrd")]
)
def test_a_wrong_one_is_told_before_anything_is_done(command: Command, words: tuple[str, ...]) -> None:
    code, out, err = command(*words, HOVER, "-Y", WRONG)
    assert (code, out) == (2, "")
    said, line, carets = err.splitlines()
    assert said.startswith(f"tailbyte {words[0]}: ESCStatus has no field 'voltge'")
    assert (line, carets) == (f"  {WRONG}", f"  {' ' * 10}{'^' * 6}")


def test_what_is_not_there_is_said(command: Command) -> None:
    code, _, err = command("decode", HOVER, "-Y", 'node.label == "a"')
    assert code == 2
    assert "--vehicle" in err


def test_fields_are_listed(command: Command) -> None:
    code, out, _ = command("fields", "ESCStatus.volt")
    assert code == 0
    assert out.split()[:3] == ["ESCStatus.voltage", "number", "V"]
    _, out, _ = command("fields", "ESCStatus.mode", "-T", "json")
    names = {row["name"]: row["values"] for row in json.loads(out)}
    assert names["ESCStatus.error_count.mode"]["6"] == "error"
    _, out, _ = command("fields", "can.*", "-T", "csv")
    assert out.splitlines()[0] == "name,type,unit,values,clause,about"
    _, out, _ = command("fields", "can.", "-T", "csv")
    names = {row.split(",")[0] for row in out.splitlines()[1:]}
    assert names == {"can.id", "can.len", "can.flags.xtd", "can.flags.rtr", "can.flags.err"}
    code, _, err = command("fields", "voltge")
    assert code == 2
    assert "did you mean" in err


def test_every_field_that_is_listed_is_one(command: Command) -> None:
    _, out, _ = command("fields", "ESCStatus", "PUSH", "frame.", "can.", "-T", "json")
    names = [row["name"] for row in json.loads(out)]
    assert len(names) > 100
    known = FilterNames(dissectors.load())
    assert [known.find(name, name, 0).kind.sort for name in names] != []


def test_help_names_it(capsys: pytest.CaptureFixture[str]) -> None:
    for name in ("decode", "info", "check", "export", "convert", "plot", "live"):
        assert main([name, "--help"]) == 0
        assert "-Y" in capsys.readouterr().out, name


def told(command: Command, *words: object) -> list[str]:
    """Return what `info` says, but for the file itself."""
    _, out, _ = command("info", *words)
    return out[out.index("\nTime ") :].splitlines()


@pytest.mark.parametrize("path", [FAULTS, BREAK, FAILURE], ids=lambda path: path.stem)
@pytest.mark.parametrize("text", ["!ESCStatus", "src == 12", "frame.time_relative > 0.5 && src != 12"])
def test_info_says_what_it_says_of_a_capture_of_what_matches(
    command: Command, tmp_path: Path, path: Path, text: str
) -> None:
    cut = tmp_path / f"cut{path.suffix}"
    command("convert", path, cut, "-Y", text)
    assert told(command, path, "-Y", text, "--types") == told(command, cut, "--types")


def test_info_counts_foreign_identifiers_between_what_does_not_match(command: Command, tmp_path: Path) -> None:
    path, cut = tmp_path / "mixed.log", tmp_path / "cut.log"
    path.write_text("".join(f"({n}.0) can0 123#00\n({n}.5) can0 18FF0{n % 7}22#{n % 251:02X}1122\n" for n in range(90)))
    command("convert", path, cut, "-Y", "can.id != 0x123")
    assert told(command, path, "-Y", "can.id != 0x123") == told(command, cut)


def test_error_frames_stand_in_the_account_and_say_where_they_are_rows(command: Command) -> None:
    text = "can.flags.err || ESCStatus"
    for more in ([], ["-q"], ["-V"]):
        assert "-- 528 of 2476 transfers match, and 26 error frames; " in command("decode", BREAK, "-Y", text, *more)[2]
    for form in ("jsonl", "json", "csv"):
        _, _, err = command("decode", BREAK, "-Y", text, "-T", form)
        assert "transfers match, and 26 error frames: rows of --frame-list; " in err


@pytest.mark.parametrize("path", [FAULTS, BREAK], ids=lambda path: path.stem)
@pytest.mark.parametrize("more", [[], ["--frame-list"]], ids=["transfers", "frames"])
def test_quiet_counts_what_the_list_of_a_window_shows(command: Command, path: Path, more: list[str]) -> None:
    words = ("decode", path, "-Y", "can.id == 0x123 || can.flags.err || ESCStatus", "--frames", "900-1700", *more)
    (_, rows, listed), (_, none, quiet) = command(*words, "-T", "jsonl"), command(*words, "-q")
    assert none == ""
    account = quiet.splitlines()[-1]
    assert account == listed.splitlines()[-1].replace(": rows of --frame-list", "")
    assert account.startswith(f"-- {len(rows.splitlines())} of ")


@pytest.mark.sampled(4)
@pytest.mark.parametrize("text", ["src == 11", "can.flags.err", "finding.rule == 'TRF-010'", "NodeStatus.mode == 7"])
def test_findings_are_exported_as_check_reports_them(command: Command, tmp_path: Path, text: str) -> None:
    import pyarrow.parquet as pq  # noqa: PLC0415

    text = text.replace("'", '"')
    command("check", FAULTS, "-Y", text, "--json", tmp_path / "report.json")
    reported = [(one["rule"], one["count"]) for one in json.loads((tmp_path / "report.json").read_text())["findings"]]
    command("export", FAULTS, "-o", tmp_path / "found.parquet", "--table", "findings", "-Y", text)
    table = pq.read_table(tmp_path / "found.parquet")
    assert list(zip(*(table.column(name).to_pylist() for name in ("rule", "count")), strict=True)) == reported
    assert analyzer.open_capture(FAULTS, filter=text).findings().num_rows == len(reported)
    _, _, err = command("export", FAULTS, "-o", tmp_path / "found.mcap", "--table", "findings", "-Y", text)
    assert (f", {len(reported)} findings" in err) == bool(reported)


def test_events_and_escs_are_exported_as_far_as_they_match(command: Command, tmp_path: Path) -> None:
    import pyarrow.parquet as pq  # noqa: PLC0415

    folder = tmp_path / "made"
    command("export", BREAK, "-o", folder, "--table", "all", "--table", "esc", "-Y", "src == 12")
    assert set(pq.read_table(folder / "esc.parquet").column("node").to_pylist()) == {12}
    assert pq.read_table(folder / "events.parquet").num_rows == 0
    command("export", BREAK, "-o", tmp_path / "some", "-Y", "can.flags.err && frame.time_relative < 2.2")
    every = analyzer.open_capture(BREAK).table("events")
    some = analyzer.open_capture(BREAK, filter="can.flags.err && frame.time_relative < 2.2").table("events")
    assert pq.read_table(tmp_path / "some" / "events.parquet").num_rows == some.num_rows < every.num_rows


@pytest.mark.sampled(4)
@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["ESCStatus.voltage > 400"], "nothing matches the filter"),
        (["Panic"], "has no uavcan.protocol.Panic: the filter asks for what never occurs"),
        (["frame.number < 40", "--frames", "100-"], "nothing that matches is inside the window"),
    ],
)
def test_what_nothing_matches_is_empty_and_whole_and_said(
    command: Command, tmp_path: Path, words: list[str], said: str
) -> None:
    for name in ("log", "pcapng", "mcap"):
        code, _, err = command("convert", HOVER, tmp_path / f"none.{name}", "-Y", *words)
        assert (code, err.splitlines()[0]) == (0, f"tailbyte: {HOVER}: {said}")
        assert len(analyzer.open_capture(tmp_path / f"none.{name}").table("frames")) == 0
    for more in (["export", "-o", tmp_path / "none"], ["plot", "-o", tmp_path / "none.rrd"], ["info"]):
        code, _, err = command(*more, HOVER, "-Y", *words)
        assert (code, err.splitlines()[0]) == (0, f"tailbyte: {HOVER}: {said}")


@pytest.mark.sampled(4)
@pytest.mark.parametrize("window", [(), ("--from", "2.5"), ("--last", "2s"), ("--around", "3000±500ms")])
def test_relative_times_of_own_rules_are_those_of_the_whole_capture(
    command: Command, tmp_path: Path, window: tuple[str, ...]
) -> None:
    hover, own, report = CAPTURES / "hover-4.log", tmp_path / "own.toml", tmp_path / "report.json"
    text = "ESCStatus && frame.time_relative > 3 && src == 11"
    own.write_text(f'[rule.ACME-001]\ntitle = "Late"\nwhen = "{text}"\n')
    command("check", hover, *window, "--vehicle", own, "--select", "ACME-001", "--json", report)
    told = sum(one["count"] for one in json.loads(report.read_text())["findings"])
    account = command("decode", "-q", hover, *window, "-Y", text)[2]
    assert account.startswith(f"-- {told} of ")
    assert told
