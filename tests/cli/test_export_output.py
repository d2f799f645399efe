"""Where an export goes: usage, nothing half under the final name, damaged captures, bounded memory."""

from __future__ import annotations

import csv
import gzip
import os
import signal
import subprocess
from typing import TYPE_CHECKING

import pyarrow.parquet as pq
import pytest
from kit import encode
from kit.command import CAPTURES, HOVER, START, commands, log, run, run_in_room, start, wait_until

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    Main = Callable[..., tuple[int, str, str]]

FAULTS = CAPTURES / "faults.log"
FORMS = ("parquet", "arrow", "csv", "mcap")
MANY = 1_500_000


@pytest.fixture(scope="module")
def long(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Commands in one frame each, 100 us apart."""
    path = tmp_path_factory.mktemp("long") / "long.log"
    (frame,) = commands(0)
    number = f"{frame.id:08X}"
    block = "".join(
        f"(17000%05d.%02d{k:04d}) can0 {number}#{k:014X}{0xC0 | k % 32:02X}\n" for k in range(0, 10_000, 100)
    )
    with path.open("w") as file:
        for second in range(MANY // 10_000):
            for part in range(100):
                file.write(block.replace("%05d", f"{second:05}").replace("%02d", f"{part:02}"))
    assert encode.log_line(frame).endswith("C0")
    return path


@pytest.mark.parametrize(
    ("args", "said"),
    [
        (["-o", "out", "--table", "ESCStatu"], "ESCStatus"),
        (["-o", "out", "--table", "PUSHCAN.Nope"], "MotorStatus"),
        (["-o", "out.parquet"], "--table NAME"),
        (["-o", "out.csv", "--table", "frames", "--table", "ESCStatus"], "--table NAME"),
        (["-o", "out.csv", "-F", "parquet", "--table", "frames"], "contradict"),
        (["-o", "out.mcap", "--table", "transfers"], "no table of transfers"),
        (["-o", "-"], "-F parquet, arrow, csv or mcap"),
        (["-o", "out", "--to", "csv"], "did you mean -F csv?"),
        (["-o", "out", "-F", "xlsx"], "xlsx is none of parquet"),
        (["-o", "out", "--frames", "9-1"], "ends before it starts"),
        (["-o", "out", "--around", "99999"], "no frame 99999"),
        ([], "-o"),
    ],
)
def test_wrong_usage(
    command: Main, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, args: list[str], said: str
) -> None:
    monkeypatch.chdir(tmp_path)
    status, out, err = command("export", HOVER, *args)
    assert (status, out) == (2, "")
    assert said in err
    assert list(tmp_path.iterdir()) == []


def test_a_capture_is_not_written_over(command: Main, tmp_path: Path) -> None:
    capture = tmp_path / "a.mcap"
    capture.write_bytes(HOVER.read_bytes())
    status, _, err = command("export", capture, "-o", capture)
    assert (status, "is the capture" in err) == (2, True)
    assert capture.read_bytes() == HOVER.read_bytes()


@pytest.mark.parametrize("form", FORMS)
def test_output_that_cannot_be_written(command: Main, tmp_path: Path, form: str) -> None:
    for place in (tmp_path / "no" / f"x.{form}", "/dev/full"):
        table = [] if form == "mcap" else ["--table", "ESCStatus"]
        status, _, err = command("export", HOVER, "-o", place, "-F", form, *table)
        assert (status, err.count("\n")) == (3, 1), err
        assert str(place) in err
    assert list(tmp_path.iterdir()) == []


@pytest.mark.slow
@pytest.mark.parametrize("form", FORMS)
def test_a_full_disk_leaves_what_was_there(tmp_path: Path, form: str) -> None:
    target = tmp_path / ("out.mcap" if form == "mcap" else "out")
    if form == "mcap":
        target.write_bytes(b"before")
    else:
        target.mkdir()
        (target / f"frames.{form}").write_bytes(b"before")

    done = run_in_room(8192, "export", HOVER, "-o", target, "-F", form, "--force")
    assert done.returncode == 3
    assert done.stderr.count(b"\n") == 1
    assert b"File too large" in done.stderr
    files = {path.relative_to(tmp_path).as_posix() for path in tmp_path.rglob("*") if path.is_file()}
    assert files == {"out.mcap" if form == "mcap" else f"out/frames.{form}"}
    assert (target if form == "mcap" else target / f"frames.{form}").read_bytes() == b"before"


@pytest.mark.slow
@pytest.mark.parametrize("form", ["parquet", "mcap"])
def test_ctrl_c_leaves_nothing(tmp_path: Path, long: Path, form: str) -> None:
    target = tmp_path / ("out.mcap" if form == "mcap" else "out")
    with start("export", long, "-o", target, stdout=subprocess.PIPE, stderr=subprocess.PIPE) as process:
        wait_until(lambda: any(tmp_path.iterdir()))
        process.send_signal(signal.SIGINT)
        out, _ = process.communicate()
    assert (process.returncode, out) == (130, b"")
    assert list(tmp_path.iterdir()) == []


@pytest.mark.slow
def test_a_killed_export_leaves_the_old_files(tmp_path: Path, long: Path) -> None:
    target = tmp_path / "out"
    assert run("export", HOVER, "-o", target).returncode == 0
    before = {path.name: path.read_bytes() for path in target.iterdir()}
    with start("export", long, "-o", target, "--force", stderr=subprocess.DEVNULL) as process:
        wait_until(lambda: any(path.name not in before for path in target.iterdir()))
        process.kill()
    assert {name: (target / name).read_bytes() for name in before} == before
    assert {path.suffix for path in target.iterdir() if path.name not in before} == {".part"}


@pytest.mark.slow
def test_ctrl_c_ends_a_pipe_but_not_its_export(tmp_path: Path) -> None:
    with start("export", "-", "-o", tmp_path / "out", stdin=subprocess.PIPE, stderr=subprocess.PIPE) as process:
        assert process.stdin is not None
        process.stdin.write(log(commands(*range(0, 5_000_000, 1_000_000))))
        process.stdin.flush()
        wait_until(lambda: any(tmp_path.iterdir()))
        process.send_signal(signal.SIGINT)
        process.communicate()
    assert process.returncode == 130
    assert pq.read_metadata(tmp_path / "out/frames.parquet").num_rows == 5


@pytest.mark.sampled(2)
@pytest.mark.parametrize("form", FORMS)
def test_a_damaged_capture_is_exported_as_far_as_it_goes(command: Main, tmp_path: Path, form: str) -> None:
    cut = tmp_path / "cut.gz"
    cut.write_bytes(gzip.compress(HOVER.read_bytes())[:-4])
    for number, source in enumerate((cut, HOVER)):
        status, _, err = command(
            "export", source, "-o", tmp_path / f"{number}.{form}", "-F", form, "--table", "NodeStatus"
        )
        assert status == (3 if source is cut else 0)
        assert ("gzip data ends early" in err) == (source is cut)
    if form == "csv":
        assert (tmp_path / "0.csv").read_bytes() == (tmp_path / "1.csv").read_bytes()
    assert (tmp_path / f"0.{form}").stat().st_size > 500


def test_files_of_an_earlier_export_are_pointed_out(command: Main, tmp_path: Path) -> None:
    assert "also holds" not in command("export", HOVER, "-o", tmp_path)[2]
    (tmp_path / "notes.txt").write_text("mine")
    (tmp_path / "ESCStatus.csv").write_text("mine")
    status, _, err = command("export", CAPTURES / "services.log", "-o", tmp_path, "--force")
    assert status == 0
    assert "also holds earlier files: ESCStatus.parquet, PUSHCAN.FocFeedback.parquet" in err
    assert "notes" not in err
    assert "csv" not in err
    assert "also holds" not in command("export", HOVER, "-o", tmp_path / "frames.parquet", "--table", "frames")[2]


def peak(*args: object) -> int:
    """The largest resident size of the command in kB."""
    process = start(*args, stderr=subprocess.DEVNULL)
    _, status, usage = os.wait4(process.pid, 0)
    process.returncode = os.waitstatus_to_exitcode(status)
    assert process.returncode == 0
    return usage.ru_maxrss


@pytest.mark.slow
@pytest.mark.parametrize("form", FORMS)
def test_memory_does_not_grow_with_the_capture(tmp_path: Path, long: Path, form: str) -> None:
    """Twice as many frames behind the point where everything is full take hardly more memory."""
    half = tmp_path / "half.log"
    data = long.read_bytes()
    half.write_bytes(data[: len(data) // 2])
    out = "out.mcap" if form == "mcap" else "out"
    sizes = [peak("export", source, "-o", tmp_path / out, "-F", form, "--force") for source in (half, long)]
    assert sizes[1] - sizes[0] < 60_000, sizes


def test_what_waits_for_a_row_group_is_bounded(command: Main, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """All tables together wait in so many bytes; the largest one is written first."""
    monkeypatch.setattr("analyzer.decode.core.BATCH_ROWS", 50)
    monkeypatch.setattr("analyzer.sources.stored.CHUNK", 2000)
    monkeypatch.setattr("analyzer.sinks.tables.GATHERED", 30_000)
    command("export", FAULTS, "-o", tmp_path)
    groups = {path.stem: pq.read_metadata(path).num_row_groups for path in tmp_path.iterdir()}
    assert groups["transfers"] > 5
    assert groups["frames"] > 5
    assert groups["uavcan.protocol.NodeStatus"] == 1


@pytest.mark.parametrize("form", FORMS)
def test_fields_that_are_called_like_other_columns(command: Main, tmp_path: Path, form: str) -> None:
    (tmp_path / "acme").mkdir()
    (tmp_path / "acme/1030.Pump.uavcan").write_text("uint8 src\nuint8 t\nuint8 bus\nuint8 transfer\nuint8 trusted\n")
    (tmp_path / "a.log").write_bytes(log(commands(0, 1_000_000)))
    target = tmp_path / f"pump.{form}"
    args = ("--table", "acme.Pump", "--dissector", tmp_path / "acme")
    assert command("export", tmp_path / "a.log", "-o", target, "-F", form, *args)[0] == 0
    if form == "parquet":
        names = pq.read_schema(target).names
        assert pq.read_table(target, columns=["src.field"]).to_pydict() == {"src.field": [0, 1]}
        assert len(set(names)) == len(names)
        assert set(names) > {"src", "src.field", "t.field", "bus.field", "transfer.field", "trusted.field"}


def test_a_field_that_is_called_like_the_nanoseconds(command: Main, tmp_path: Path) -> None:
    (tmp_path / "acme").mkdir()
    (tmp_path / "acme/1030.Pump.uavcan").write_text("uint8 t_ns\nuint8 t\n")
    (tmp_path / "a.log").write_bytes(log(commands(0, 1_000_000)))
    target = tmp_path / "pump.csv"
    args = ("--table", "acme.Pump", "--dissector", tmp_path / "acme")
    assert command("export", tmp_path / "a.log", "-o", target, *args)[0] == 0
    with target.open(newline="") as file:
        names, first, second = csv.reader(file)
    assert len(set(names)) == len(names)
    assert names[1:3] == ["t_ns", "t"]
    assert names[-2:] == ["t_ns.field", "t.field"]
    assert (first[1], first[-2], second[-2]) == (str(START), "0", "1")
