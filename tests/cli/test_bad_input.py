"""What captures, names, options and streams can do wrong: one clear line, the right status, never a traceback."""

from __future__ import annotations

import gzip
import os
import random
import subprocess
import sys
from typing import TYPE_CHECKING

import pytest
from kit.command import HOVER, LIMIT, environment, run

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    Command = Callable[..., tuple[int, str, str]]

TEXT = HOVER.read_bytes()
PACKED = gzip.compress(TEXT, mtime=0)
ALL = 1111  # transfers of hover.log
FRAME = b"1F040601#00000000000000C0"


def printable(text: str) -> bool:
    return text.replace("\n", "").isprintable()


@pytest.mark.parametrize(
    ("args", "reason"),
    [
        (["--"], "the following arguments are required: COMMAND"),
        (["nonsense"], "no command nonsense"),
        (["\x1b[31m\n"], r"no command '\x1b[31m\x0a'"),
        (
            ["decode"],
            "decode: which capture? give a file, or - for standard input (see tailbyte decode",
        ),
        (["decode", "-", "-r", "-"], "standard input can be read only once"),
        (["decode", "a", "b", "--follow"], "--follow takes one capture"),
        (
            ["decode", "a", "--bus", "left"],
            "--bus: 'left' is not NAME=CAPTURE, NAME=INTERFACE or NAME=CAPTURE:INTERFACE",
        ),
        (["decode", "a", "--bus", "\x1b=a"], r"--bus: '\x1b=a' is not NAME=CAPTURE"),
        (["decode", "a", "--offset", "a=x"], "--offset: 'x' is not a duration"),
        (["decode", "a", "--offset", "1s"], "--offset: '1s' is not FILE=+1.5s"),
        (["decode", "a", "--offset", "b=1s"], "--offset b: no such capture among a"),
        (["decode", "a", "--nonsense"], "no option --nonsense"),
        (["decode", "a", "-c", "0"], "argument -c: '0' is not a number of at least 1"),
        (["decode", "a", "-c", "-1"], "argument -c: '-1' is not a number"),
        (["decode", "a", "-c", "can0"], "argument -c: 'can0' is not a number"),
        (["decode", "a", "-c", "²"], "argument -c: '²' is not a number"),
        (["decode", "a", "-t", "x"], "argument -t: x is none of a, ad,"),
        (["decode", "a", "-T", "xml"], "argument -T: xml is none of text, fields"),
        (["decode", "a", "-e"], "argument -e: needs a value (FIELD)"),
        (["decode", "a", "-e", "frame.number"], "-e FIELD goes with -T fields, csv, jsonl or json"),
        (["decode", "a", "-T", "fields"], "-T fields needs -e FIELD"),
        (["decode", "a", "-T", "fields", "-e", "no\udcff\n"], r"no field 'no\udcff\n'"),
        (["decode", "a", "-T", "fields", "-e", "ESCStatus.volts"], "no field 'ESCStatus.volts'"),
        (["decode", "a", "-O", "ESCStatu"], "no message is called 'ESCStatu' (near: ESCStatus"),
        (["decode", "a", "-O", "\x1b[31m"], r"no message is called '\x1b[31m'"),
        (["decode", "a", "--frames", "5-3"], "--frames: '5-3' ends before it starts"),
        (["decode", "a", "--frames", "0"], "--frames: frame numbers start at 1"),
        (["decode", "a", "--frames", "x"], "--frames: 'x' is not a range of frame numbers"),
        (["decode", "a", "--frames", ""], "--frames: '' is not a range of frame numbers"),
        (["decode", "a", "--frames", "-"], "--frames: '-' is not a range of frame numbers"),
        (["decode", "a", "--last", "1e9"], "--last: '1e9' is not a duration"),
        (["decode", "a", "--last", "-5s"], "--last: needs a value (10s)"),
        (["decode", "a", "--last", "1s", "--follow"], "--last needs an end, --follow has none"),
        (["decode", "a", "--around", "0"], "--around: frame numbers start at 1"),
        (["decode", "a", "--around", "5±x"], "--around: 'x' is not a duration"),
        (["decode", "a", "--around", "±5s"], "--around: '' is not a time"),
        (["decode", "a", "--from", "\x1b"], r"--from: '\x1b' is not a time"),
        (["decode", "a", "--to", "-5"], "--to: '-5' is not a time"),
        (["decode", "a", "--color", "red"], "argument --color: red is none of auto, always"),
        (["decode", "a", "--dissector", "no\x1bwhere"], r"no\x1bwhere"),
        (["info"], "tailbyte info: which capture? give a file, or - for standard input"),
        (["info", "a", "-T", "csv"], "argument -T: csv is none of text, json"),
        (["info", "a", "--dialect", "0=tm"], "argument --dialect: '0=tm' is not NODE=CHOICE"),
    ],
)
def test_wrong_usage(command: Command, args: list[str], reason: str) -> None:
    status, out, err = command(*args)
    assert (status, out, err.count("\n")) == (2, "", 1), err
    assert reason in err
    assert err.startswith("tailbyte")
    assert printable(err)


@pytest.mark.sampled(2)
@pytest.mark.parametrize(
    ("args", "shown"),
    [
        (["-c", "9" * 20], ALL),
        (["-c", "9" * 5000], ALL),
        (["--frames", f"1-{'9' * 5000}"], ALL),
        (["--frames", "9" * 5000], 0),
        (["--from", "9" * 20], 0),
        (["--to", "9" * 20], ALL),
        (["--last", "9" * 20 + "h"], ALL),
        (["--around", f"1±{'9' * 20}h"], ALL),
        (["--from", "99999999999999999999.999999999999999999999"], 0),
    ],
)
def test_huge_numbers(command: Command, args: list[str], shown: int) -> None:
    status, _, err = command("decode", HOVER, *args)
    assert (status, err.count("\n")) == (0, 1)
    assert err.startswith(f"-- {shown} of {ALL} transfers shown")


def test_windows_that_do_not_fit_the_capture(command: Command, tmp_path: Path) -> None:
    timeless = tmp_path / "timeless.txt"
    timeless.write_bytes(b"  can0  1F040601   [8]  00 00 00 00 00 00 00 C0\n")
    for args, reason in (
        (["--around", "9" * 5000, HOVER], f"no frame {sys.maxsize}: the capture has 1868"),
        (["--around", "1869", HOVER], "no frame 1869: the capture has 1868"),
        (["--last", "1s", timeless], "without times: only --frames and -c can choose a part of it"),
        (["--from", "1", timeless], "without times: only --frames and -c can choose a part of it"),
    ):
        status, out, err = command("decode", *args)
        assert (status, out) == (2, "")
        assert err.splitlines()[0] == f"tailbyte: {args[-1]}: {reason}"
        assert err.splitlines()[1].startswith("-- 0 of ")
    assert command("decode", timeless, "--frames", "1")[0] == 0


@pytest.mark.parametrize("do", ["decode", "info"])
def test_names_that_cannot_be_read(command: Command, do: str, tmp_path: Path) -> None:
    for name, reason in (
        (tmp_path / "missing", "No such file or directory"),
        (tmp_path, "is a directory"),
        (HOVER / "below", "Not a directory"),
        ("x" * 300, "File name too long"),
    ):  # fmt: skip
        status, out, err = command(do, "-r", name)
        assert (status, out, err) == (3, "", f"tailbyte: {name}: {reason}\n")
    for name, shown in (("no\x1b[31m\nx", r"no\x1b[31m\x0ax"), (b"no\xff", r"no\xff"), ("né", "né")):
        done = run(do, name, env={"PYTHONUTF8": "1"})
        assert (done.returncode, done.stdout) == (3, b"")
        assert done.stderr.decode() == f"tailbyte: {shown}: No such file or directory\n"


def test_a_name_may_leave_no_room_for_that_of_marks(command: Command, tmp_path: Path) -> None:
    name = tmp_path / ("x" * 251 + ".log")
    name.write_bytes(HOVER.read_bytes())
    assert command("decode", "-c", "3", name)[0] == 0


@pytest.mark.sampled(3)
@pytest.mark.parametrize(
    ("data", "status", "complaint"),
    [
        (b"", 3, "empty"),
        (gzip.compress(b""), 3, "empty"),
        (b"\n" * 50, 0, None),
        (b"# only\n# comments\n", 0, None),
        (b"A" * 200_000, 3, "line 1: line longer than 65536 bytes"),
        (b"\0" * 70_000 + b"\n" + TEXT[:51], 3, "line 1: line longer than 65536 bytes"),
        (TEXT[:600].decode().encode("utf-16"), 3, "byte 0: looks like UTF-16 text"),
        (TEXT[:600].decode().encode("utf-16-le"), 3, "line 1: "),
        (random.Random(5).randbytes(100_000), 3, "lines are unreadable"),
        (b"\x89MCAP0\r\n" + bytes(50), 3, "byte 8: "),
        (b"\xd4\xc3\xb2\xa1" + bytes(50), 3, "byte 0: "),
        (b"LOGG" + bytes(50), 3, "byte 54: BLF data ends early"),
        (b"PK\x03\x04" + bytes(50), 3, "byte 0: looks like zip, which is not read"),
        (gzip.compress(PACKED), 3, "looks like gzip once more"),
    ],
    ids=lambda value: value if isinstance(value, str) else "",
)
def test_files_that_are_no_captures(
    command: Command, tmp_path: Path, data: bytes, status: int, complaint: str | None
) -> None:
    path = tmp_path / "file"
    path.write_bytes(data)
    for do in ("decode", "info"):
        got, _, err = command(do, path)
        assert got == status
        assert printable(err)
        assert complaint is None or f"{path}: " in err
        assert complaint is None or complaint in err
        assert len(err.splitlines()) <= 8


def test_a_truncated_last_line_costs_only_itself(command: Command, tmp_path: Path) -> None:
    path = tmp_path / "cut.log"
    path.write_bytes(TEXT[:-20])
    status, out, err = command("decode", path)
    assert (status, len(out.splitlines())) == (3, ALL - 1 + 1)
    assert f"{path}: line 1868: " in err
    assert "1867 frames + 1 unreadable" in err
    for whole in (TEXT.rstrip(b"\n"), TEXT.rstrip(b"\n") + b"\r"):
        path.write_bytes(whole)
        status, out, err = command("decode", path)
        assert (status, len(out.splitlines())) == (3, ALL - 1 + 1)
        assert f"{path}: line 1868: the capture ends in the middle of this line: " in err
        assert f"{path}: byte {len(whole)}: the capture ends in the middle of a line" in err
        assert command("info", path)[0] == 3


@pytest.mark.sampled(3)
@pytest.mark.parametrize(
    ("data", "reason", "complete"),
    [
        (PACKED[:5], "byte 5: gzip data ends early", False),
        (PACKED[:4000], "byte 4000: gzip data ends early", False),
        (PACKED[:-1], f"byte {len(PACKED) - 1}: gzip data ends early", True),
        (PACKED[:-5] + b"\x55" + PACKED[-4:], "damaged gzip data (incorrect data check)", True),
        (PACKED[:-1] + b"\x55", "damaged gzip data (incorrect length check)", True),
        (PACKED[:3] + b"\xff" + PACKED[4:], "byte 3: damaged gzip data (unknown header flags set)", False),
        (PACKED + b"more", f"byte {len(PACKED)}: data behind the end of the gzip data", True),
        (PACKED + PACKED[:15], "gzip data ends early", True),
    ],
)
def test_damaged_gzip(command: Command, tmp_path: Path, data: bytes, reason: str, complete: bool) -> None:
    path = tmp_path / "log.gz"
    path.write_bytes(data)
    status, out, err = command("decode", path)
    assert status == 3
    damage = [line for line in err.splitlines() if "gzip data" in line]
    assert len(damage) == 1
    assert damage[0].startswith(f"tailbyte: {path}: byte ")
    assert damage[0].endswith(reason)
    whole = command("decode", HOVER)[1]
    if complete:
        assert out == whole
    else:  # the last lines may be of transfers that were cut
        assert out.splitlines()[:-5] == whole.splitlines()[: max(0, len(out.splitlines()) - 5)]
    assert command("info", path)[0] == 3


def test_concatenated_members_are_one_capture(command: Command, tmp_path: Path) -> None:
    path = tmp_path / "log.gz"
    path.write_bytes(b"".join(gzip.compress(TEXT[at : at + 999]) for at in range(0, len(TEXT), 999)) + bytes(3 << 20))
    assert command("decode", path)[:2] == command("decode", HOVER)[:2]


def peak(*args: object) -> tuple[int, int]:
    """Exit status and the most memory the command had, in bytes; the child measures itself, behind everything else."""
    code = (
        "import re, sys; from analyzer.cli import main; status = main()\n"
        "text = open('/proc/self/status').read()\n"
        "print(status, re.search(r'VmHWM:\\s+(\\d+) kB', text)[1], file=sys.stderr)"
    )
    command = [sys.executable, "-c", code, *map(str, args)]
    done = subprocess.run(command, env=environment(), capture_output=True, timeout=LIMIT, check=True)
    status, kilobytes = done.stderr.splitlines()[-1].split()
    return int(status), int(kilobytes) << 10


@pytest.mark.slow
@pytest.mark.parametrize("do", ["decode", "info"])
def test_memory_does_not_grow_with_the_input(tmp_path: Path, do: str) -> None:
    bomb = tmp_path / "bomb.gz"
    bomb.write_bytes(gzip.compress(bytes(64 << 20), 9) * 16)
    long = tmp_path / "long.log"
    long.write_bytes(b"A" * 20_000_000)
    for path in (bomb, long):
        status, memory = peak(do, path)
        assert status == 3
        assert memory < 400 << 20


@pytest.mark.slow
def test_the_last_part_of_a_long_log_does_not_hold_all_of_it(tmp_path: Path) -> None:
    long = tmp_path / "long.log"
    lines = [
        b"(%d.%06d) can0 %s%X\n" % (1_773_475_330 + k // 1000, k % 1000 * 1000, FRAME[:-1], k % 16) for k in range(16)
    ]
    block = b"".join(lines)
    long.write_bytes(block * 125_000)
    status, memory = peak("decode", "-c", "1", "--last", "1h", long)
    assert status == 0
    assert memory < 600 << 20


@pytest.mark.slow
def test_a_named_pipe(command: Command, tmp_path: Path) -> None:
    fifo = tmp_path / "fifo"
    os.mkfifo(fifo)
    writer = f"open({str(fifo)!r}, 'wb').write(open({str(HOVER)!r}, 'rb').read())"
    with subprocess.Popen([sys.executable, "-c", writer]):
        assert command("decode", fifo)[:2] == command("decode", HOVER)[:2]
