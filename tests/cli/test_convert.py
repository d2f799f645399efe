"""`tailbyte convert` as a shell calls it: formats, windows, what it refuses, and every way to end too early."""

from __future__ import annotations

import gzip
import io
import os
import signal
import subprocess
import sys
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING

import pytest
import zstandard
from cli.test_live import Live, wait_until
from kit.command import CAPTURES, CODE, HOVER, LIMIT, commands, environment, log, run, run_in_room, start
from kit.rows import Fault, Frame, records, sound, text
from mcap.reader import make_reader

if TYPE_CHECKING:
    from collections.abc import Callable

    Command = Callable[..., tuple[int, str, str]]

MS = 1_000_000
SUFFIXES = ("log", "pcapng", "mcap")
FORM = {"log": "candump", "txt": "candump", "pcapng": "pcapng", "mcap": "mcap"}


def frames_of(path: Path) -> list[Frame | Fault]:
    return records(sound(FORM[path.suffix[1:]], path.read_bytes()))


@pytest.mark.sampled(3)
@pytest.mark.parametrize("capture", ["hover.log", "faults.log", "services.log", "dialects.txt"])
def test_from_format_to_format(command: Command, tmp_path: Path, capture: str) -> None:
    """A chain through all formats ends with the frames it started with."""
    paths = [
        CAPTURES / capture,
        *(tmp_path / name for name in ("a.mcap", "b.pcapng", "c.log.gz", "d.txt.zst", "e.log")),
    ]
    for old, new in pairwise(paths):
        status, out, err = command("convert", old, new)
        assert (status in (0, 3), out) == (True, ""), err
    first = records(text(paths[0].read_bytes()))
    overflow = bytes([0, 1, *bytes(6)])  # what becomes of a drop count in MCAP
    last = [record for record in frames_of(paths[-1]) if record.data != overflow or isinstance(record, Frame)]
    flags = 16 | 32  # the kinds of CAN FD that MCAP does not tell apart
    assert [(r.t, r.bus, r.data, r.flags & ~flags) for r in last] == [
        (r.t, r.bus, r.data, r.flags & ~flags) for r in first
    ]
    assert gzip.decompress(paths[3].read_bytes()) == paths[5].read_bytes()
    assert zstandard.ZstdDecompressor().stream_reader(paths[4].read_bytes()).read() == paths[5].read_bytes()


@pytest.mark.slow
def test_decoding_the_copy_gives_the_same(command: Command, tmp_path: Path) -> None:
    shown = command("decode", HOVER, "-T", "jsonl")[1]
    for suffix in SUFFIXES:
        copy = tmp_path / f"copy.{suffix}"
        assert command("convert", HOVER, copy)[0] == 0
        assert command("decode", copy, "-T", "jsonl")[1] == shown


def test_the_same_input_gives_the_same_bytes(command: Command, tmp_path: Path) -> None:
    for name in ("a.log.gz", "a.mcap", "a.pcapng"):
        got = set()
        for folder in "xy":
            (tmp_path / folder).mkdir(exist_ok=True)
            command("convert", HOVER, tmp_path / folder / name)
            got.add((tmp_path / folder / name).read_bytes())
        assert len(got) == 1
        assert name != "a.log.gz" or got.pop()[4:8] == bytes(4)  # no time of its making


@pytest.mark.slow
def test_every_way_to_name_the_output(command: Command, small: Path, tmp_path: Path) -> None:
    out = tmp_path / "out.pcapng"
    ways = [
        [small, out], ["-r", small, out], [small, "-o", out], ["-w", out, small], ["-o", out, "-r", small],
        [small, "-F", "pcapng", out], ["--frames", "1-", small, "--bus", "can0=can0", out],
    ]  # fmt: skip
    for way in ways:
        assert command("convert", *way) == (
            0, "", f"-- 10 frames written to {out}; 10 lines = 10 frames\n",
        )  # fmt: skip
        assert len(frames_of(out)) == 10
        out.unlink()


@pytest.mark.slow
def test_standard_streams(small: Path) -> None:
    data = small.read_bytes()
    for suffix in SUFFIXES:
        done = run("convert", "-", "-", "-F", FORM[suffix], input=data)
        assert (done.returncode, done.stderr) == (0, b"-- 10 frames written to standard output; 10 lines = 10 frames\n")
        assert (
            run("convert", "-", "-", "-F", "candump", input=done.stdout).stdout
            == run("convert", small, "-", "-F", "candump").stdout
        )


def test_formats_are_forced_and_packed(command: Command, small: Path, tmp_path: Path) -> None:
    out = tmp_path / "strange.name"
    assert command("convert", small, out, "-F", "mcap", "--compression", "none")[0] == 0
    summary = make_reader(io.BytesIO(out.read_bytes())).get_summary()
    assert [index.compression for index in summary.chunk_indexes] == [""]
    assert command("convert", small, tmp_path / "a.mcap", "--compression", "lz4")[0] == 0
    summary = make_reader(io.BytesIO((tmp_path / "a.mcap").read_bytes())).get_summary()
    assert [index.compression for index in summary.chunk_indexes] == ["lz4"]


@pytest.mark.parametrize(
    ("args", "reason"),
    [
        (["small.log"], "a capture and an output are needed: tailbyte convert CAPTURE OUT"),
        (["-o", "x.mcap"], None),
        ([], None),
        (["small.log", "out"], "out: the name says no format: give -F candump, mcap or pcapng"),
        (["small.log", "out.blf"], "out.blf: the name says no format: give -F candump, mcap or pcapng"),
        (["small.log", "-"], "- says no format: give -F candump, mcap or pcapng"),
        (["small.log", "out.log", "--compression", "zstd"], "--compression is for MCAP"),
        (["small.log", "out.mcap", "--to", "mcap"], "--to is a time: did you mean -F mcap?"),
        (["small.log", "out.mcap", "--from", "noon"], None),
        (["small.log", "out.mcap", "--around", "11"], None),
        (["small.log", "out.mcap", "-F", "blf"], None),
        (["small.log", "out.mcap", "--offset", "x=1s"], None),
        (["small.log", "small.log"], "small.log: is the capture small.log itself"),
        (["small.log", "out.log", "-o", "small.log"], "small.log: is the capture small.log itself"),
        (["hard.log", "small.log"], "small.log: is the capture hard.log itself"),
        (["small.log", "soft.log"], "soft.log: is the capture small.log itself"),
        (["s*.log", "soft.log"], "soft.log: is the capture small.log itself"),
    ],
)
def test_what_is_refused(
    command: Command, small: Path, monkeypatch: pytest.MonkeyPatch, args: list[str], reason: str | None
) -> None:
    monkeypatch.chdir(small.parent)
    os.link("small.log", "hard.log")
    Path("soft.log").symlink_to("small.log")
    before, names = small.read_bytes(), sorted(Path().iterdir())
    status, out, err = command("convert", *args)
    assert (status, out, err.count("\n")) == (2, "", 1)
    assert reason is None or err == f"tailbyte convert: {reason}\n"
    assert (small.read_bytes(), sorted(Path().iterdir())) == (before, names)


@pytest.mark.sampled(2)
@pytest.mark.parametrize(
    ("window", "kept"),
    [
        (["--frames", "3-5"], [2, 3, 4]), (["--from", "0.0055"], [6, 7, 8, 9]), (["--to", "0.0015"], [0, 1]),
        (["--last", "2ms"], [7, 8, 9]), (["--around", "5±1ms"], [3, 4, 5]),
    ],
)  # fmt: skip
@pytest.mark.parametrize("suffix", SUFFIXES)
def test_windows(
    command: Command, small: Path, tmp_path: Path, suffix: str, window: list[str], kept: list[int]
) -> None:
    out = tmp_path / f"out.{suffix}"
    whole = frames_of(small)
    status, _, err = command("convert", small, out, *window)
    assert (status, frames_of(out)) == (0, [whole[row] for row in kept])
    told = f"-- {len(kept)} frames written to {out}, {10 - len(kept)} outside the window; 10 lines = 10 frames\n"
    assert err == told


@pytest.mark.parametrize("window", [["--frames", "20-"], ["--from", "5"], ["--from", "0.0051", "--to", "0.0052"]])
def test_a_window_with_nothing_inside_leaves_the_output_alone(
    command: Command, small: Path, tmp_path: Path, window: list[str]
) -> None:
    out = tmp_path / "out.mcap"
    out.write_text("old")
    status, _, err = command("convert", small, out, *window)
    assert (status, err, out.read_text()) == (
        2,
        f"tailbyte: {small}: nothing is inside the window: {' '.join(window)}\n",
        "old",
    )
    assert [path.name for path in tmp_path.iterdir() if path.suffix == ".part"] == []


@pytest.mark.slow
@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGHUP])
def test_signals_that_end_it_leave_nothing_behind(small: Path, tmp_path: Path, number: int) -> None:
    folder = tmp_path / "out"
    folder.mkdir()
    live = Live("convert", "-", folder / "out.mcap")
    live.send(small.read_bytes())
    wait_until(live.taken)
    assert len(list(folder.iterdir())) == 1  # the unfinished file
    live.process.send_signal(number)
    status, shown, err = live.end()
    assert (status, shown, err, list(folder.iterdir())) == (128 + number, b"", b"", [])


def test_a_name_for_nothing_is_no_conversion(command: Command, small: Path, tmp_path: Path) -> None:
    out = tmp_path / "out.mcap"
    status, _, err = command("convert", small, out, "--bus", "x=can9")
    assert (status, out.exists()) == (2, False)
    assert err == f"tailbyte: {small}: --bus x=can9: no such capture or interface (there is can0)\n"


@pytest.mark.slow
def test_a_window_far_back_in_a_long_file(command: Command, large: Path, tmp_path: Path) -> None:
    """It is found only at the end, and read again."""
    out = tmp_path / "out.log"
    whole = frames_of(large)
    assert command("convert", large, out, "--frames", f"2-{len(whole)}")[0] == 0
    assert frames_of(out) == whole[1:]


def test_captures_are_merged(command: Command, tmp_path: Path) -> None:
    for bus, first in (("left", 0), ("right", 1)):
        (tmp_path / f"{bus}.log").write_bytes(log(commands(*range(first * MS, 10 * MS, 2 * MS), first=first)))
    out = tmp_path / "out.mcap"
    names = [f"--bus={bus}={bus}.log" for bus in ("left", "right")]
    status, _, err = command("convert", tmp_path / "left.log", tmp_path / "right.log", out, *names)
    assert (status, [record.bus for record in frames_of(out)]) == (0, ["left", "right"] * 5), err
    summary = make_reader(io.BytesIO(out.read_bytes())).get_summary()
    assert {channel.topic for channel in summary.channels.values()} == {"/left/can", "/right/can"}


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_what_is_readable_of_a_damaged_capture(command: Command, tmp_path: Path, suffix: str) -> None:
    capture, out = tmp_path / "cut.log.gz", tmp_path / f"out.{suffix}"
    data = log(commands(*range(0, 1000 * MS, MS)))
    capture.write_bytes(gzip.compress(data)[:-2000])
    status, _, err = command("convert", capture, out)
    assert status == 3
    assert "gzip data ends early\n" in err
    kept = frames_of(out)
    assert 10 < len(kept) < 1000
    assert kept == records(text(data))[: len(kept)]
    capture.write_bytes(b"garbage\n" + data)
    assert command("convert", capture, out)[0] == 3
    assert frames_of(out) == records(text(data))


@pytest.mark.sampled(2)
@pytest.mark.parametrize("suffix", SUFFIXES)
def test_a_capture_that_is_not_there_changes_nothing(command: Command, tmp_path: Path, suffix: str) -> None:
    out = tmp_path / f"out.{suffix}"
    for old in (None, b"old"):
        if old is not None:
            out.write_bytes(old)
        missing = tmp_path / "missing.log"
        assert command("convert", missing, out) == (3, "", f"tailbyte: {missing}: No such file or directory\n")
        assert [path.read_bytes() for path in tmp_path.iterdir()] == ([] if old is None else [old])


@pytest.mark.slow
@pytest.mark.parametrize("suffix", [*SUFFIXES, "log.gz", "log.zst"])
@pytest.mark.parametrize("room", [0, 1000, 200_000])
def test_a_full_disk(large: Path, tmp_path: Path, suffix: str, room: int) -> None:
    folder = tmp_path / "out"
    folder.mkdir()
    out = folder / f"out.{suffix}"
    room //= 20 if suffix in ("log.gz", "log.zst", "mcap") else 1
    done = run_in_room(room, "convert", large, out)
    assert (done.returncode, done.stdout, done.stderr.decode()) == (3, b"", f"tailbyte: {out}: File too large\n")
    assert list(folder.iterdir()) == []


@pytest.mark.slow
def test_outputs_that_cannot_be_written(command: Command, small: Path, tmp_path: Path) -> None:
    for out, reason in (
        (tmp_path, "is a directory"),
        (tmp_path / "no" / "out", f"there is no folder {tmp_path / 'no'}"),
        ("/dev/full", "No space left on device"),
    ):
        assert command("convert", small, out, "-F", "mcap") == (3, "", f"tailbyte: {out}: {reason}\n")
    with Path("/dev/full").open("wb") as full:
        done = run("convert", small, "-", "-F", "pcapng", stdout=full)
    assert (done.returncode, done.stderr) == (3, b"tailbyte: standard output: No space left on device\n")
    assert command("convert", small, "/dev/null", "-F", "mcap")[0] == 0


@pytest.mark.slow
def test_a_reader_that_leaves(large: Path) -> None:
    process = start("convert", large, "-", "-F", "candump", stdout=subprocess.PIPE, stderr=subprocess.PIPE)
    assert process.stdout is not None
    assert process.stderr is not None
    process.stdout.read(10)
    process.stdout.close()
    assert (process.stderr.read(), process.wait(LIMIT)) == (b"", 0)
    process.stderr.close()


INTERRUPTED = """
import os, signal, sys
import analyzer.sources.stored as stored
read = stored.Stored._count
def count(self, data):
    read(self, data)
    os.kill(os.getpid(), signal.SIGINT)
stored.Stored._count = count
"""


@pytest.mark.slow
@pytest.mark.parametrize("suffix", SUFFIXES)
@pytest.mark.parametrize("old", [None, b"old"])
def test_ctrl_c_while_a_file_is_read(large: Path, tmp_path: Path, suffix: str, old: bytes | None) -> None:
    folder = tmp_path / "out"
    folder.mkdir()
    out = folder / f"out.{suffix}"
    if old is not None:
        out.write_bytes(old)
    command = [sys.executable, "-c", INTERRUPTED + CODE, "convert", str(large), str(out)]
    done = subprocess.run(command, env=environment(), capture_output=True, timeout=LIMIT, check=False)
    told = b"tailbyte: interrupted, nothing is written\n"
    assert (done.returncode, done.stdout, done.stderr) == (130, b"", told)
    assert [path.read_bytes() for path in folder.iterdir()] == ([] if old is None else [old])


@pytest.mark.slow
@pytest.mark.parametrize("suffix", SUFFIXES)
def test_ctrl_c_while_a_pipe_is_read(small: Path, tmp_path: Path, suffix: str) -> None:
    """What has come is a whole capture."""
    out = tmp_path / f"out.{suffix}"
    live = Live("convert", "-", out)
    live.send(small.read_bytes())
    wait_until(live.taken)
    live.interrupt()
    status, shown, err = live.end()
    told = f"-- 10 frames written to {out}; 10 lines = 10 frames\n"
    assert (status, shown, err.decode()) == (130, b"", told)
    assert frames_of(out) == frames_of(small)


@pytest.mark.slow
def test_an_empty_capture(command: Command, tmp_path: Path) -> None:
    (tmp_path / "empty.log").touch()
    for suffix in SUFFIXES:
        status, _, err = command("convert", tmp_path / "empty.log", tmp_path / f"out.{suffix}")
        assert (status, "empty.log: empty\n" in err) == (3, True)
        assert frames_of(tmp_path / f"out.{suffix}") == []
