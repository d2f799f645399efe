"""The command as people use it: options of decode and info, exit status, terminals, pagers, growing files, Ctrl-C."""

from __future__ import annotations

import fcntl
import gzip
import json
import os
import pty
import struct
import subprocess
import sys
import termios
import time
from typing import TYPE_CHECKING

import pytest
from command import CAPTURES, HOVER, LIMIT, ROOT, SGR, Reader, commands, environment, interrupt, log, run, start

from analyzer.cli import main
from analyzer.views.terminal import display_width

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


def test_help_waits_for_nothing_heavy() -> None:
    code = (
        "import sys; from analyzer.cli import main; status = main(sys.argv[1:])\n"
        "heavy = {'numpy', 'pyarrow', 'can', 'rerun', 'mcap', 'pandas', 'dronecan', 'dissectors', 'analyzer._native'}\n"
        "print(status, sorted(heavy & set(sys.modules)), file=sys.stderr)"
    )
    for args in (
        ["--help"],
        ["decode", "--help"],
        ["info", "--help"],
        ["--version"],
        ["decode"],
        ["decode", "-c", "x"],
    ):
        done = subprocess.run([sys.executable, "-c", code, *args], env=environment(), capture_output=True, check=True)
        assert done.stderr.splitlines()[-1].split(b" ", 1)[1] == b"[]", args


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


def test_colour(small: Path) -> None:
    assert b"\x1b[" not in run("decode", small).stdout
    coloured = run("decode", small, "--color", "always", env={"NO_COLOR": "1"}).stdout
    assert SGR.sub("", coloured.decode()).encode() == run("decode", small).stdout != coloured


def on_terminal(*args: object, **env: str) -> tuple[int, str]:
    """The command with both outputs on a terminal of 80 columns: status and everything that it shows."""
    ours, theirs = pty.openpty()
    fcntl.ioctl(theirs, termios.TIOCSWINSZ, struct.pack("HHHH", 24, 80, 0, 0))
    process = start(*args, env={"TERM": "xterm", **env}, stdin=theirs, stdout=theirs, stderr=theirs)
    os.close(theirs)
    shown = Reader(ours).rest().decode()
    status = process.wait(LIMIT)
    os.close(ours)
    return status, shown.replace("\r\n", "\n")


@pytest.mark.parametrize("columns", [80, 200])
@pytest.mark.parametrize("capture", ["faults.log", "services.log", "dialects.txt"])
def test_lines_fit_the_terminal(capture: str, columns: int) -> None:
    size = {} if columns == 80 else {"COLUMNS": str(columns)}
    _, shown = on_terminal("decode", "--no-pager", "-t", "ud", CAPTURES / capture, **size)
    lines = SGR.sub("", shown.partition("\n-- ")[0]).splitlines()
    listed = [line for line in lines if not line.startswith("tailbyte: ")]
    assert len(listed) > 10
    assert max(map(display_width, listed)) <= columns
    assert "\x1b[31m" in shown or capture != "faults.log"


def test_colour_on_a_terminal(small: Path) -> None:
    assert "\x1b[" in on_terminal("decode", small, "--no-pager")[1]
    for args, env in (([], {"NO_COLOR": "1"}), ([], {"TERM": "dumb"}), (["--color", "never"], {})):
        status, shown = on_terminal("decode", small, "--no-pager", *args, **env)
        assert (status, "\x1b[" in shown, "RawCommand" in shown) == (0, False, True)


@pytest.mark.parametrize("pager", ["cat", "", "no-such-pager", "'", "cat -", "sed p -n"])
def test_pagers_that_show_everything(pager: str) -> None:
    status, shown = on_terminal("decode", HOVER, "--color", "never", PAGER=pager)
    assert status == 0
    assert len(shown.splitlines()) == 1111 + 2


def test_pagers_that_leave_early() -> None:
    assert on_terminal("decode", HOVER, PAGER="false")[0] == 0
    status, shown = on_terminal("decode", HOVER, "--color", "never", PAGER="less", TAILBYTE_PAGER="head -1")
    assert (status, shown.splitlines()[0].split()[:2]) == (0, ["Frame", "Time"])
    assert "Traceback" not in shown
    assert shown.count("RawCommand") == 0


def test_complaints_wait_for_the_pager() -> None:
    status, shown = on_terminal("decode", CAPTURES / "faults.log", PAGER="cat -")
    assert status == 3
    assert shown.splitlines()[-2].startswith("tailbyte: ")
    assert shown.splitlines()[-1].startswith("-- ")


@pytest.mark.parametrize("args", [["decode", HOVER], ["decode", HOVER, "-T", "jsonl"], ["info", HOVER], ["--help"]])
def test_a_reader_that_leaves_ends_the_command_quietly(args: list[object]) -> None:
    ours, theirs = os.pipe()
    os.close(ours)
    done = run(*args, stdout=theirs)
    os.close(theirs)
    assert (done.returncode, done.stderr) == (0, b"")


def test_a_growing_file_is_followed(tmp_path: Path) -> None:
    """Written, appended to, with half a line at a time, emptied and written anew; Ctrl-C ends it."""
    first, second, third = (log(commands(k * MS, first=k)) for k in range(3))
    path = tmp_path / "growing.log"
    path.touch()
    process = start(
        "decode",
        "--follow",
        "-T",
        "fields",
        "-e",
        "RawCommand.cmd",
        path,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
    )
    assert process.stdout is not None
    shown = Reader(process.stdout.fileno())
    with path.open("ab", buffering=0) as file:
        file.write(first + second)
        shown.until(b"0,0\n1,0\n")
        file.write(third[:30])
        file.write(third[30:])
        shown.until(b"2,0\n")
        file.write(b"(1773475339.0")
    path.write_bytes(second)
    shown.until(b"2,0\n1,0\n")
    with path.open("ab", buffering=0) as file:
        file.write(third.rstrip(b"\n"))  # the end of its line never comes
        file.write(b" ")
        assert interrupt(process) in (130,)
    assert shown.rest() == b"0,0\n1,0\n2,0\n1,0\n2,0\n" or shown.got == b"0,0\n1,0\n2,0\n1,0\n"
    assert process.stderr is not None
    assert b"Traceback" not in process.stderr.read()


def test_a_pipe_is_shown_as_it_comes_and_to_its_end() -> None:
    process = start(
        "decode", "--follow", "-T", "fields", "-e", "RawCommand.cmd", "-", stdin=subprocess.PIPE, stdout=subprocess.PIPE
    )
    assert process.stdin is not None
    assert process.stdout is not None
    shown = Reader(process.stdout.fileno())
    for k in range(3):
        process.stdin.write(log(commands(k * MS, first=k)))
        process.stdin.flush()
        shown.until(b"%d,0\n" % k)
    process.stdin.close()
    assert (process.wait(LIMIT), shown.rest()) == (0, b"0,0\n1,0\n2,0\n")


@pytest.mark.parametrize("form", ["text", "json", "jsonl"])
def test_ctrl_c_while_a_pipe_is_read(form: str) -> None:
    """What has come is shown in whole lines, the account too, and a JSON array is closed."""
    process = start("decode", "-T", form, "-", stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.PIPE)
    assert process.stdin is not None
    half = HOVER.read_bytes()[:30_000]
    process.stdin.write(half)
    process.stdin.flush()
    while struct.unpack("i", fcntl.ioctl(process.stdin, termios.FIONREAD, b"\0" * 4))[0]:
        assert process.poll() is None
        time.sleep(0.01)  # until the process has taken all of it
    process.send_signal(2)
    out, err = process.communicate(timeout=LIMIT)
    assert process.returncode == 130
    assert out.endswith(b"]\n" if form == "json" else b"\n")
    assert b"Traceback" not in err
    expected = run("decode", "-T", form, "-", input=half)
    assert (out, err.splitlines()[-1]) == (expected.stdout, expected.stderr.splitlines()[-1])


def test_ctrl_c_from_the_very_start() -> None:
    """At whatever point of start-up it arrives: no traceback of the program's own."""
    process = start("decode", "-", stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.PIPE)
    status = interrupt(process)
    assert status in (130, -2, 1)
    assert ROOT.is_dir()
