"""The command as people use it: options of decode and info, exit status, terminals, pagers, growing files, Ctrl-C."""

from __future__ import annotations

import gzip
import json
import os
import time
from typing import TYPE_CHECKING

import pytest
from kit.command import CAPTURES, HOVER, SGR, commands, log, run

from analyzer.cli import main

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator
    from pathlib import Path

    Main = Callable[..., tuple[int, str, str]]
MS = 1_000_000


@pytest.fixture
def command(capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> Iterator[Main]:
    """Runs in this process, in UTC: status, output, complaints."""
    monkeypatch.setenv("TZ", "UTC")
    time.tzset()

    def call(*args: object) -> tuple[int, str, str]:
        status = main([str(arg) for arg in args])
        return status, *capsys.readouterr()

    yield call
    monkeypatch.undo()
    time.tzset()


@pytest.fixture
def small(tmp_path: Path) -> Path:
    """Three transfers, at 0, 10 and 30 ms."""
    path = tmp_path / "small.log"
    path.write_bytes(log(commands(0, 10 * MS, 30 * MS)))
    return path


def test_help_and_version(command: Main) -> None:
    for args in (["--help"], ["decode", "--help"], ["info", "-h"]):
        status, out, err = command(*args)
        assert (status, err) == (0, "")
        assert out.startswith("usage: tailbyte")
    status, out, err = command("--version")
    assert (status, err, out.split()[0]) == (0, "", "tailbyte")


@pytest.mark.slow
def test_the_process_gives_the_status_and_both_streams() -> None:
    done = run("decode", HOVER, "-c", 3)
    assert (done.returncode, done.stdout.count(b"\n"), done.stderr) == (0, 4, b"")
    done = run("decode", CAPTURES / "faults.log")
    assert done.returncode == 3
    assert done.stdout.count(b"\n") > 1000
    assert b"1 unreadable" in done.stderr


def test_count(command: Main, small: Path) -> None:
    for count, lines in ((1, 2), (2, 3), (3, 4), (4, 4), (10**30, 4)):
        status, out, err = command("decode", small, "-c", count)
        assert (status, len(out.splitlines())) == (0, lines)
        assert ("3 of 3 transfers shown" in err) == (count > 3)


@pytest.mark.slow
def test_capture_by_letter_and_from_standard_input(command: Main, small: Path) -> None:
    expected = command("decode", small)[1]
    assert command("decode", "-r", small)[1] == expected
    for source in (["-"], ["-r", "-"]):
        with small.open("rb") as file:
            done = run("decode", *source, stdin=file)
        assert (done.returncode, done.stdout.decode()) == (0, expected)
        assert run("decode", *source, input=small.read_bytes()).stdout.decode() == expected


def test_gzip_is_known_by_its_content(command: Main, small: Path, tmp_path: Path) -> None:
    expected = command("decode", small)[1]
    data = small.read_bytes()
    packed = tmp_path / "packed.log"
    packed.write_bytes(gzip.compress(data[:50]) + gzip.compress(data[50:]) + bytes(512))
    assert command("decode", packed)[:2] == (0, expected)
    plain = tmp_path / "plain.gz"
    plain.write_bytes(data)
    assert command("decode", plain)[:2] == (0, expected)
    assert "candump text, gzip" in command("info", packed)[1]


@pytest.mark.slow
def test_details_summaries_and_bytes(command: Main, small: Path) -> None:
    listed, details = command("decode", small)[1], command("decode", small, "-V")[1]
    assert "Frame  Time" not in details
    assert len(details) > 3 * len(listed)
    both = command("decode", small, "-V", "-P")[1]
    assert all(line in both.splitlines() for line in listed.splitlines())
    assert command("decode", small, "-P")[1] == listed
    assert command("decode", small, "-O", "RawCommand")[1] == details
    assert command("decode", small, "-O", "ESCStatus,RawCommand")[1] == details
    assert len(command("decode", small, "-O", "ESCStatus")[1]) < len(details)
    dumped = command("decode", small, "-x")[1]
    assert dumped.count("tail C") == 3
    assert command("decode", small, "-V", "-x")[1].count("tail C") >= 3


def test_quiet_only_checks(command: Main, small: Path) -> None:
    status, out, err = command("decode", small, "-q")
    assert (status, out, err) == (0, "", "-- 3 transfers; 3 lines = 3 frames; 3 frames = 3 used\n")
    assert command("decode", CAPTURES / "faults.log", "-q")[0] == 3


@pytest.mark.parametrize(
    ("mode", "times"),
    [
        ("a", ["08:02:10.000000", "08:02:10.010000", "08:02:10.030000"]),
        ("ad", ["2026-03-14 08:02:10.000000", "2026-03-14 08:02:10.010000", "2026-03-14 08:02:10.030000"]),
        ("d", ["0.000000", "0.010000", "0.020000"]),
        ("dd", ["0.000000", "0.010000", "0.020000"]),
        ("e", ["1773475330.000000", "1773475330.010000", "1773475330.030000"]),
        ("r", ["0.000000", "0.010000", "0.030000"]),
        ("u", ["08:02:10.000000", "08:02:10.010000", "08:02:10.030000"]),
        ("ud", ["2026-03-14 08:02:10.000000", "2026-03-14 08:02:10.010000", "2026-03-14 08:02:10.030000"]),
    ],
)
def test_time_columns(command: Main, small: Path, mode: str, times: list[str]) -> None:
    status, out, _ = command("decode", small, "-t", mode)
    assert status == 0
    assert [time in line for time, line in zip(times, out.splitlines()[1:], strict=True)] == [True] * 3


@pytest.mark.slow
def test_times_of_day_are_local_and_universal(small: Path) -> None:
    for mode, hour in (("a", b"17:02:10.010000"), ("u", b"08:02:10.010000")):
        assert hour in run("decode", small, "-t", mode, env={"TZ": "JST-9"}).stdout


def test_times_around_an_anchor_have_signs(command: Main, small: Path) -> None:
    out = command("decode", small, "--around", "2")[1]
    assert [line.split()[1] for line in out.splitlines()[1:]] == ["-0.010000", "+0.000000", "+0.020000"]
    out = command("decode", small, "--around", "2", "-T", "fields", "-e", "frame.time_relative")[1]
    assert out.split() == ["-0.010000000", "0.000000000", "0.020000000"]


def test_forms(command: Main, small: Path) -> None:
    status, out, _ = command("decode", small, "-T", "jsonl")
    rows = [json.loads(line) for line in out.splitlines()]
    assert (status, [row["frame"] for row in rows]) == (0, [1, 2, 3])
    assert json.loads(command("decode", small, "-T", "json")[1]) == rows
    assert json.loads(command("decode", small, "-T", "json", "--frames", "7")[1]) == []
    out = command("decode", small, "-T", "csv")[1]
    assert [line.partition(",")[0] for line in out.splitlines()] == ["frame", "1", "2", "3"]
    out = command("decode", small, "-T", "fields", "-e", "frame.number", "-e", "RawCommand.cmd", "-c", 2)[1]
    assert out == "1\t0,0\n2\t1,0\n"
    assert command("decode", small, "-T", "text") == command("decode", small)


def test_windows_reach_the_list(command: Main, small: Path) -> None:
    for args in (
        ["--from", "0.01", "--to", "0.02"],
        ["--frames", "2"],
        ["--around", "2±5ms"],
        ["--around", "0.01+-5ms"],
    ):
        status, out, err = command("decode", small, *args)
        assert (status, [line.split()[0] for line in out.splitlines()[1:]]) == (0, ["2"])
        assert "1 of 3 transfers shown" in err
    assert len(command("decode", small, "--last", "20ms")[1].splitlines()) == 3


def test_info(command: Main, small: Path) -> None:
    status, out, err = command("info", small)
    assert (status, err) == (0, "")
    assert "3 = 3 frames" in out
    facts = json.loads(command("info", small, "-T", "json")[1])
    assert (facts["transfers"], facts["size"]) == (3, small.stat().st_size)
    assert command("info", small, "--all")[0] == 0
    assert command("info", CAPTURES / "faults.log")[0] == 3


def test_a_folder_of_types(command: Main, small: Path, tmp_path: Path) -> None:
    folder = tmp_path / "vendor"
    folder.mkdir()
    (folder / "1030.Command.uavcan").write_text("int14[<=20] wish\n")
    out = command("decode", small, "--dissector", folder, "-T", "jsonl")[1]
    assert {json.loads(line)["type"] for line in out.splitlines()} <= {"vendor.Command", "Command", "RawCommand"}
    (folder / "1030.Command.uavcan").write_text("nonsense[\n")
    status, _, err = command("decode", small, "--dissector", folder)
    assert (status, err.count("\n")) == (2, 1)
    assert "1030.Command.uavcan:1" in err


@pytest.mark.slow
def test_colour(small: Path) -> None:
    assert b"\x1b[" not in run("decode", small).stdout
    coloured = run("decode", small, "--color", "always", env={"NO_COLOR": "1"}).stdout
    assert SGR.sub("", coloured.decode()).encode() == run("decode", small).stdout != coloured


@pytest.mark.slow
@pytest.mark.parametrize("args", [["decode", HOVER], ["decode", HOVER, "-T", "jsonl"], ["info", HOVER], ["--help"]])
def test_a_reader_that_leaves_ends_the_command_quietly(args: list[object]) -> None:
    ours, theirs = os.pipe()
    os.close(ours)
    done = run(*args, stdout=theirs)
    os.close(theirs)
    assert (done.returncode, done.stderr) == (0, b"")


@pytest.mark.slow
@pytest.mark.parametrize("command", [["info"], ["plot", "-o", "x.rrd"]], ids=lambda command: command[0])
def test_a_reading_that_no_field_has_is_refused(command: list[str], tmp_path: Path) -> None:
    done = run(command[0], CAPTURES / "hover-4.log", "--dialect", "11=foo", *command[1:], cwd=tmp_path)
    assert done.returncode == 2
    assert b"'foo' (one of: tm, dronecan, degC, K, little-endian, big-endian)" in done.stderr
    assert done.stderr.count(b"\n") == 1
    assert not done.stdout
    assert not list(tmp_path.iterdir())
