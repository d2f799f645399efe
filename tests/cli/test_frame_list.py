"""Frames in lists: those that form no transfer at their place, all of them with `--frame-list`, and their numbers."""

from __future__ import annotations

import csv
import json
import re
from typing import TYPE_CHECKING, Any

import pytest
from kit.command import CAPTURES

from analyzer.cli import main

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

BREAK, FAULTS, FD = CAPTURES / "bus-break.log", CAPTURES / "faults.log", CAPTURES / "fd.log"
LOGS = [BREAK, FAULTS, FD, CAPTURES / "services.log", CAPTURES / "mission-8-faults.log"]
# A start of transfer (ESCStatus of node 11), its second frame of three twice, and frames of no transfer.
ODD = """\
(1.000000) can0 1F040A0B#164F002000004680
(1.001000) can0 1F040A0B#52CD34C04F000020
(1.002000) can0 1F040A0B#52CD34C04F000020
(1.003000) can0 1F040A0B#000040
(1.004000) can0 1F040A0B#52CD34C04F000023
(1.005000) can0 1F040A0B#R8
(1.006000) can0 1F040A0B#
(1.007000) can0 123#0102
(1.008000) can0 123#0304
(1.009000) can0 1ABCDE0D#01020304050607C5
(1.010000) can0 1F040601#00000000000000C0
"""


def listed(capfd: pytest.CaptureFixture[str], *args: object) -> list[str]:
    assert main(["decode", *map(str, args)]) in (0, 3)
    return capfd.readouterr().out.splitlines()


def frames(capfd: pytest.CaptureFixture[str], *args: object) -> list[dict[str, Any]]:
    return [json.loads(line) for line in listed(capfd, *args, "--frame-list", "-T", "jsonl")]


@pytest.fixture
def odd(tmp_path: Path) -> Path:
    path = tmp_path / "odd.log"
    path.write_text(ODD)
    return path


def test_frames_without_a_transfer_stand_at_their_place(capfd: pytest.CaptureFixture[str], odd: Path) -> None:
    text = [line for line in listed(capfd, odd) if not line.strip().startswith("!")]
    assert [line[1:].split()[0] for line in text[1:]] == ["1", "3", "5", "6", "7", "11", "8", "10"]
    assert re.search(r"^x +3 .* 11>\* .*ESCStatus .* 0  copy of the frame before  1F040A0B#52CD34C04F000020$", text[2])
    assert re.search(r"^x +5 .* 11>\* .*ESCStatus .* 3  no start of its transfer  1F040A0B#52CD34C04F000023$", text[3])
    assert re.search(r"^x +6 .* 11>\* .*ESCStatus +remote frame  1F040A0B#R8$", text[4])
    assert re.search(r"^x +7 .* 11>\* .*ESCStatus +no data, no tail byte  1F040A0B#$", text[5])
    assert re.search(r"^~ +8 .*foreign +2 frames  123$", text[7])
    assert re.search(r"^~ +10 .*foreign +1 frame  1ABCDE0D#01020304050607C5$", text[8])


def test_foreign_frames_are_rows_if_asked_for(capfd: pytest.CaptureFixture[str], odd: Path) -> None:
    text = listed(capfd, odd, "--foreign")
    foreign = [line for line in text if "not DroneCAN" in line]
    assert [line.split()[0] for line in foreign] == ["8", "9", "10"]
    assert foreign[1].endswith("123#0304")
    assert not any(line.startswith("~") for line in text)


def test_details_have_them_too(capfd: pytest.CaptureFixture[str], odd: Path) -> None:
    text = listed(capfd, odd, "-V")
    assert sum(line.startswith("x") for line in text) == 4
    assert not any("Time [s]" in line for line in text)


@pytest.mark.sampled(4)
@pytest.mark.parametrize("path", LOGS, ids=lambda path: path.stem)
def test_every_frame_is_in_one_row_of_either_list(capfd: pytest.CaptureFixture[str], path: Path) -> None:
    every = frames(capfd, path)
    own = [row for row in every if row["kind"] == "frame"]
    assert [row["frame"] for row in own] == list(range(1, len(own) + 1))
    transfers = [json.loads(line) for line in listed(capfd, path, "-T", "jsonl")]
    named = {
        number: (one["frames"][0], [k, len(one["frames"])])
        for one in transfers
        for k, number in enumerate(one["frames"], 1)
    }
    assert {row["frame"]: (row["transfer"], row["place"]) for row in own if row["place"]} == named
    loose = {row["frame"] for row in own if row["verdict"] not in ("used", "foreign")}
    lines = [line for line in listed(capfd, path) if re.match(r"x +\d+ .*  [0-9A-F]{8}#", line)]
    assert {int(line[1:].split()[0]) for line in lines} == loose
    assert all((row["verdict"] == "used") == (row["place"] is not None) for row in own)


@pytest.mark.parametrize("path", [BREAK, FAULTS], ids=lambda path: path.stem)
def test_the_frames_are_those_of_the_text(capfd: pytest.CaptureFixture[str], path: Path) -> None:
    texts = re.findall(r"^\(\d+\.\d{6}\) can0 (\w+)#(\w*)", path.read_text(), re.MULTILINE)
    rows = frames(capfd, path)
    said = [(row["id"] or "20", row["data"]) for row in rows]
    assert len(said) == len(texts)
    for (name, data), (number, bytes_), row in zip(said, texts, rows, strict=True):
        remote = "remote" in row["flags"]
        assert number.startswith(name) if row["id"] is None else number == name, row
        assert data == ("" if remote else bytes_)
        assert not remote or bytes_ == f"R{row['len']}"


def test_error_frames_are_rows_of_the_frame_list(capfd: pytest.CaptureFixture[str]) -> None:
    errors = [row for row in frames(capfd, BREAK) if row["kind"] == "error frame"]
    assert len(errors) == 26
    assert all(
        row["number"] is row["frame"] is row["id"] is row["verdict"] is None and row["len"] == 8 for row in errors
    )


def test_the_account_counts_error_frames_among_what_is_shown(capfd: pytest.CaptureFixture[str]) -> None:
    assert main(["decode", str(BREAK), "--frame-list"]) == 0
    err = capfd.readouterr().err
    assert err.startswith("-- 4258 of 4258 frames and error frames shown; 4258 lines = 4232 frames + 26 error frames; ")
    assert main(["decode", str(FD), "--frame-list"]) == 0
    assert capfd.readouterr().err.startswith("-- 162 of 162 frames shown; ")


def test_wireshark_counts_error_frames(capfd: pytest.CaptureFixture[str]) -> None:
    rows = frames(capfd, BREAK, "--number", "wireshark")
    assert [row["number"] for row in rows] == list(range(1, 4259))
    text = listed(capfd, BREAK, "--number", "wireshark")
    errors = [int(line[1:].split()[0]) for line in text if " error frame " in line]
    assert errors == [row["number"] for row in rows if row["kind"] == "error frame"]
    behind = rows[errors[0]]
    assert behind["number"] == behind["frame"] + 1


@pytest.mark.parametrize("where", [["--around", "2910±3ms"], ["--frames", "2905-2912"]], ids=lambda where: where[0])
def test_a_window_counts_as_the_list_does(capfd: pytest.CaptureFixture[str], where: Sequence[str]) -> None:
    rows = frames(capfd, BREAK, "--number", "wireshark", *where)
    assert 2910 in [row["number"] for row in rows]
    plain = frames(capfd, BREAK, *where)
    assert 2910 in [row["number"] for row in plain]
    assert [row["t_ns"] for row in rows] != [row["t_ns"] for row in plain]


def test_around_a_frame_shows_a_screen(capfd: pytest.CaptureFixture[str]) -> None:
    text = listed(capfd, FAULTS, "--around", 454)
    rows = [line for line in text[1:] if re.match(r".{0,9}\d", line[:9]) and not line.startswith("~")]
    assert len(rows) == 21
    assert rows[10].split()[1] == "453"
    wide = listed(capfd, FAULTS, "--around", "454±1s")
    assert len(wide) > 400
    assert listed(capfd, FAULTS, "--around", 3)[1].split()[0] == "1"
    assert (
        listed(capfd, FAULTS, "--around", 1966)[-1].split()[1] == "1966"
        or "1F05340E" in listed(capfd, FAULTS, "--around", 1966)[-1]
    )


def test_around_a_time_shows_a_screen(capfd: pytest.CaptureFixture[str]) -> None:
    rows = frames(capfd, FAULTS, "--around", "1.0s")
    assert len(rows) == 21
    start = frames(capfd, FAULTS, "-c", 1)[0]["t_ns"]
    assert rows[9]["t_ns"] < start + 10**9 <= rows[10]["t_ns"]


def test_csv_and_fields_of_frames(capfd: pytest.CaptureFixture[str], odd: Path) -> None:
    rows = list(csv.DictReader(listed(capfd, odd, "--frame-list", "-T", "csv")))
    assert [row["place"] for row in rows[:4]] == ["1/3", "2/3", "", "3/3"]
    assert rows[5]["flags"] == "extended remote"
    names = ("frame.number", "can.id", "can.len", "can.flags.rtr", "frame.time_delta")
    fields = listed(capfd, odd, "--frame-list", "-T", "fields", *(word for name in names for word in ("-e", name)))
    assert fields[5].split("\t") == ["6", str(0x1F040A0B), "8", "1", "0.001000000"]


OWN = ("dronecan.type", "dronecan.transfer_id", "dronecan.status", "ESCStatus.voltage", "RawCommand.cmd", "payload")


def columns(capfd: pytest.CaptureFixture[str], names: Sequence[str], *args: object) -> list[list[str]]:
    """The lines of `-T fields`, cell by cell."""
    text = listed(capfd, *args, "-T", "fields", *(word for name in names for word in ("-e", name)))
    return [line.split("\t") for line in text]


@pytest.mark.sampled(4)
@pytest.mark.parametrize("path", LOGS, ids=lambda path: path.stem)
def test_each_frame_has_the_fields_of_its_transfer(capfd: pytest.CaptureFixture[str], path: Path) -> None:
    """What `-T fields` says of a transfer stands in the row of each of its frames, in no other; rows are the text's."""
    text = [line[:8].strip() for line in listed(capfd, path, "--frame-list")[1:]]
    rows = columns(capfd, ("frame.number", *OWN), path, "--frame-list")
    assert [row[0] or "-" for row in rows] == text
    frames = [json.loads(line)["frames"] for line in listed(capfd, path, "-T", "jsonl")]
    owned = {}
    for numbers, (_, *cells) in zip(frames, columns(capfd, ("frame.number", *OWN), path), strict=True):
        owned |= {str(number): cells for number in numbers}
    nothing = [""] * len(OWN)
    assert [row[1:] for row in rows] == [owned.get(row[0], nothing) for row in rows]
    assert len({tuple(row[1:]) for row in rows}) > 20


@pytest.mark.sampled(4)
@pytest.mark.parametrize("text", ["can.id & 0x80", "ESCStatus", "can.flags.err || can.flags.rtr", "!dronecan.type"])
def test_a_filter_chooses_the_same_frames_in_every_form(capfd: pytest.CaptureFixture[str], text: str) -> None:
    for path in LOGS:
        lines = listed(capfd, path, "--frame-list", "-Y", text)[1:]
        numbers = [None if line[:8].strip() == "-" else int(line[:8]) for line in lines]
        assert [row["number"] for row in frames(capfd, path, "-Y", text)] == numbers
        rows = list(csv.DictReader(listed(capfd, path, "--frame-list", "-Y", text, "-T", "csv")))
        assert [int(row["number"]) if row["number"] else None for row in rows] == numbers
        cells = columns(capfd, ("frame.number", "dronecan.type"), path, "--frame-list", "-Y", text)
        assert [int(number) if number else None for number, _ in cells] == numbers


def test_frames_without_a_transfer_have_what_their_identifier_says(
    capfd: pytest.CaptureFixture[str], odd: Path
) -> None:
    names = ("frame.number", "src", "dronecan.dst", "dronecan.type", "frame.data")
    rows = {row[0]: row[1:] for row in columns(capfd, names, odd, "--frame-list")}
    assert rows["3"] == [*rows["2"][:2], "", "52CD34C04F000020"]
    assert rows["5"] == ["11", "", "", "52CD34C04F000023"]
    assert rows["6"] == ["11", "", "", ""]
    assert rows["8"] == ["", "", "", "0102"]
    services, cut = CAPTURES / "services.log", odd.with_name("services.log")
    every = [json.loads(line) for line in listed(capfd, services, "-T", "jsonl")]
    *_, one = (one for one in every if one["kind"] == "response" and len(one["frames"]) > 1)
    lines = services.read_text().splitlines(keepends=True)
    cut.write_text("".join(lines[: one["frame"] - 1] + lines[one["frame"] :]))
    orphan = columns(capfd, names, cut, "--frame-list")[one["frames"][1] - 2]
    assert orphan[1:4] == [str(one["src"]), str(one["dst"]), ""]


@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("can.id,can.len", "one field for each -e: -e can.id -e can.len"),
        ("frame.len", "no field 'frame.len'; did you mean can.len?"),
        ("ch", "'ch' is a field of filters, not of -e"),
        ("MotorStatus.speed", "no field 'MotorStatus.speed': it may be any of PUSH"),
        ("ESCStatus.temp", "did you mean ESCStatus.temperature, ESCStatus.temperature_celsius"),
        ("nothing.at.all", "no field 'nothing.at.all'"),
    ],
)
@pytest.mark.parametrize("form", [[], ["--frame-list"]])
def test_a_field_that_there_is_not(
    capfd: pytest.CaptureFixture[str], odd: Path, form: list[str], name: str, said: str
) -> None:
    assert main(["decode", str(odd), *form, "-T", "fields", "-e", name]) == 2
    assert said in capfd.readouterr().err


@pytest.mark.sampled(4)
@pytest.mark.parametrize(
    ("name", "full"),
    [("ESCStatus.mode", "ESCStatus.error_count.mode"), ("src", "dronecan.src"), ("data.data", "frame.data")],
)
def test_names_are_those_of_filters(capfd: pytest.CaptureFixture[str], name: str, full: str) -> None:
    for form in ([], ["--frame-list"]):
        cells = columns(capfd, [name], FAULTS, *form)
        assert cells == columns(capfd, [full], FAULTS, *form)
        assert len({tuple(row) for row in cells}) > 2


@pytest.mark.parametrize(
    ("args", "said"),
    [(["-V"], "list of its own"), (["-T", "fields", "-e", "dronecan.scr"], "did you mean dronecan.src")],
)
def test_what_does_not_go_together(capfd: pytest.CaptureFixture[str], odd: Path, args: list[str], said: str) -> None:
    assert main(["decode", str(odd), "--frame-list", *args]) == 2
    assert said in capfd.readouterr().err


def test_so_many_frames_and_no_more(capfd: pytest.CaptureFixture[str], odd: Path) -> None:
    assert len(listed(capfd, odd, "--frame-list", "-c", 3)) == 4
    assert len(json.loads("".join(listed(capfd, odd, "--frame-list", "-c", 3, "-T", "json")))) == 3
