"""What `tailbyte export` makes of the name of its output, and what it never writes over."""

from __future__ import annotations

import os
import subprocess
from pathlib import Path
from typing import TYPE_CHECKING

import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from kit.command import CAPTURES, HOVER, commands, log, run, start

if TYPE_CHECKING:
    from collections.abc import Callable

    Main = Callable[..., tuple[int, str, str]]

FAULTS = CAPTURES / "faults.log"


@pytest.fixture(autouse=True)
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    return tmp_path


def files() -> dict[str, bytes]:
    return {str(path): path.read_bytes() for path in Path().rglob("*") if path.is_file()}


@pytest.mark.parametrize(
    ("args", "said"),
    [
        (["-o", ""], "-o is empty: give a folder or a file"),
        (["-o", "", "-F", "mcap"], "-o is empty"),
        (["-o", "x.xlsx"], "x.xlsx: no format is called .xlsx"),
        (["-o", "x.txt", "-F", "csv", "--table", "frames"], "no format is called .txt"),
        (["-o", "out.csv.gz", "-F", "csv", "--table", "frames"], "out.csv.gz: an export is not packed"),
        (["-o", "there.csv.gz", "-F", "csv", "--table", "frames"], "there.csv.gz: an export is not packed"),
        (["-o", "x.mcap.zst"], "x.mcap.zst: an export is not packed"),
        (["-o", "x.mcap.zst", "-F", "mcap"], "x.mcap.zst: an export is not packed"),
        (["-o", "x.feather", "-F", "parquet", "--table", "frames"], "contradict"),
        (["-o", "out/", "-F", "mcap"], "out/: is a folder, and MCAP is one file"),
        (["-o", "flight.mcap/"], None),
    ],
)
def test_names_that_say_no_format(command: Main, args: list[str], said: str | None) -> None:
    Path("there.csv.gz").write_bytes(b"mine")
    status, out, err = command("export", HOVER, *args)
    assert (status, out, err.count("\n")) == (2, "", 1)
    assert said is None or said in err
    assert files() == {"there.csv.gz": b"mine"}


@pytest.mark.parametrize("name", ["flight-1.5/", "flight.old", "flight", "2026.03.14/"])
def test_names_of_folders(command: Main, name: str) -> None:
    Path("flight.old").mkdir()
    assert command("export", HOVER, "-o", name)[0] == 0
    assert pq.read_metadata(Path(name, "frames.parquet")).num_rows > 0


def test_other_names_of_formats(command: Main) -> None:
    assert command("export", HOVER, "-o", "esc.feather", "--table", "ESCStatus")[0] == 0
    assert command("export", HOVER, "-o", "esc.pq", "--table", "ESCStatus")[0] == 0
    with pa.ipc.open_file("esc.feather") as file:
        assert file.read_all().num_rows == pq.read_table("esc.pq").num_rows == 240


@pytest.mark.slow
def test_one_table_goes_to_a_file_that_is_there(command: Main) -> None:
    wanted = run("export", HOVER, "-o", "-", "-F", "csv", "--table", "frames").stdout
    one = ("-F", "csv", "--table", "frames")
    assert wanted.startswith(b'"frame","t_ns"')
    for name in ("plain", "notes.txt"):
        Path(name).write_bytes(b"before")
        assert command("export", HOVER, *one, "-o", name)[0] == 0
        assert Path(name).read_bytes() == wanted
    assert command("export", HOVER, *one, "-o", os.devnull)[0] == 0
    os.mkfifo("pipe")
    with start("export", HOVER, *one, "-o", "pipe", stderr=subprocess.DEVNULL) as process:
        assert Path("pipe").read_bytes() == wanted
    assert process.returncode == 0


@pytest.mark.parametrize(
    ("capture", "args"),
    [
        ("frames.csv", ["frames.csv", "-o", "."]),
        ("ex/frames.csv", ["ex/frames.csv", "-o", "ex"]),
        ("ex/frames.csv", ["ex/*.csv", "-o", "ex/"]),
        ("ex/ESCStatus.csv", ["ex/ESCStatus.csv", "-o", "ex"]),  # known only once there is such a message
        ("ex/ESCStatus.csv", ["ex/ESCStatus.csv", "-o", "ex", "--table", "ESCStatus"]),
        ("there.log", ["there.log", "-o", "linked"]),
        ("there.log", [HOVER, "there.log", "-o", "linked"]),
        ("frames.csv", ["frames.csv", "-o", "frames.csv", "--table", "frames"]),
    ],
)
def test_a_capture_is_not_written_over(command: Main, capture: str, args: list[str]) -> None:
    Path("ex").mkdir()
    Path(capture).write_bytes(HOVER.read_bytes())
    Path("linked").mkdir()
    if capture == "there.log":
        Path("linked/frames.csv").symlink_to("../there.log")
    before = files()
    status, out, err = command("export", *args, "-F", "csv", "--force")
    assert (status, out, err.count("\n")) == (2, "", 1)
    assert err.endswith(f"csv: is the capture {capture} itself\n")
    assert files() == before
    assert not [path for path in Path().rglob("*") if path.suffix == ".part"]


def test_a_folder_with_other_files_asks_for_force(command: Main) -> None:
    Path("full").mkdir()
    Path("full/notes.txt").write_text("mine")
    Path("full/.hidden").write_text("mine")
    before = files()
    for form in ("parquet", "csv"):
        status, out, err = command("export", HOVER, "-o", "full", "-F", form)
        said = "tailbyte export: full: holds files already (notes.txt): --force writes among them\n"
        assert (status, out, err) == (2, "", said)
        assert files() == before
    assert command("export", HOVER, "-o", "full", "--force")[0] == 0
    assert files().items() > before.items()
    assert command("export", HOVER, "-o", "full")[0] == 2, "its own tables are files, too"


def test_an_empty_folder_and_a_file_ask_for_nothing(command: Main) -> None:
    Path("empty").mkdir()
    Path("empty/.hidden").write_text("mine")
    Path("frames.csv").write_text("before")
    assert command("export", HOVER, "-o", "empty")[0] == 0
    assert command("export", HOVER, "-o", "new/")[0] == 0
    assert command("export", HOVER, "-o", "frames.csv", "--table", "frames")[0] == 0


def test_a_capture_beside_the_tables_is_no_obstacle(command: Main) -> None:
    Path("hover.csv").write_bytes(HOVER.read_bytes())
    Path("frames.csv").write_bytes(HOVER.read_bytes())
    assert command("export", "hover.csv", "-o", ".", "-F", "csv", "--force")[0] == 0
    assert Path("frames.csv").read_bytes().startswith(b'"frame"')
    assert Path("hover.csv").read_bytes() == HOVER.read_bytes()


@pytest.mark.sampled(3)
@pytest.mark.parametrize(
    "args",
    [
        ("convert", "-", "t.log"),
        ("export", "-", "-o", "t.log", "-F", "csv", "--table", "frames"),
        ("export", "-", "-o", "linked", "-F", "csv", "--force"),
    ],
)
def test_standard_input_is_not_written_over(args: tuple[str, ...]) -> None:
    Path("t.log").write_bytes(HOVER.read_bytes())
    Path("linked").mkdir()
    os.link("t.log", "linked/frames.csv")
    with Path("t.log").open("rb") as stdin:
        done = run(*args, stdin=stdin)
    name = "linked/frames.csv" if "linked" in args else "t.log"
    said = f"tailbyte {args[0]}: {name}: is standard input itself\n"
    assert (done.returncode, done.stdout, done.stderr.decode()) == (2, b"", said)
    assert Path("t.log").read_bytes() == HOVER.read_bytes()


@pytest.mark.slow
def test_a_capture_is_not_read_on_while_it_is_written() -> None:
    Path("t.log").write_bytes(HOVER.read_bytes())
    with Path("t.log").open("ab") as stdout:
        done = run("convert", "t.log", "-", "-F", "candump", stdout=stdout)
    assert (done.returncode, done.stderr) == (2, b"tailbyte convert: standard output: is the capture t.log itself\n")
    assert Path("t.log").read_bytes() == HOVER.read_bytes()
    with Path("t.log").open("rb") as stdin, Path("other.log").open("wb") as stdout:
        assert run("convert", "-", "-", "-F", "candump", stdin=stdin, stdout=stdout).returncode == 0
    assert Path("other.log").stat().st_size > 1000


@pytest.mark.sampled(4)
@pytest.mark.parametrize("window", [("--from", "99"), ("--frames", "5000-"), ("--from", "6", "--to", "7")])
@pytest.mark.parametrize("output", ["out", "out.mcap", "one.csv"])
def test_a_window_with_nothing_in_it_keeps_what_is_there(command: Main, output: str, window: tuple[str, ...]) -> None:
    one = ("--table", "frames") if output == "one.csv" else ()
    assert command("export", HOVER, "-o", output, *one)[0] == 0
    before = files()
    status, out, err = command("export", HOVER, "-o", output, *one, *window, "--force")
    assert (status, out) == (2, "")
    assert err.splitlines()[-1] == f"tailbyte: {HOVER}: nothing is inside the window: {' '.join(window)}"
    assert files() == before


def test_an_event_alone_is_something(command: Main) -> None:
    Path("a.log").write_bytes(log(commands(0, 10**9)) + b"(1773475335.000000) can0 20000080#0000000000000000\n")
    assert command("export", "a.log", "-o", "out", "--from", "4")[0] == 0
    assert [pq.read_metadata(f"out/{name}.parquet").num_rows for name in ("frames", "events")] == [0, 1]


@pytest.mark.slow
def test_the_account_says_what_was_left_out(command: Main) -> None:
    frames = pq.read_table
    _, _, err = command("export", FAULTS, "-o", "whole")
    assert "outside" not in err
    for output in ("out", "out.mcap"):
        _, _, err = command("export", FAULTS, "-o", output, "--frames", "300-400")
        (account,) = [line for line in err.splitlines() if " written to " in line]
        if output == "out":
            whole, inside = (
                [frames(f"{place}/{name}.parquet").num_rows for name in ("frames", "transfers")]
                for place in ("whole", "out")
            )
        assert inside[0] == 101
        left = f", {whole[0] - 101} frames and {whole[1] - inside[1]} transfers outside the window"
        assert account.endswith(f" written to {output}{left}")


@pytest.mark.slow
def test_events_are_no_messages(command: Main) -> None:
    command("export", FAULTS, "-o", "out")
    basic = {"frames", "transfers", "events"}
    rows = {path.stem: pq.read_metadata(path).num_rows for path in Path("out").iterdir()}
    messages = sum(count for name, count in rows.items() if name not in basic)
    assert rows["events"] == 5
    _, _, err = command("export", FAULTS, "-o", "out.mcap")
    assert f"-- {messages} messages, 5 events, 29 findings and 1966 frames written to out.mcap\n" in err
    _, _, err = command("export", FAULTS, "-o", "out.mcap", "--table", "events")
    assert "-- 0 messages, 5 events and 0 frames written to out.mcap\n" in err


@pytest.mark.parametrize("form", ["parquet", "mcap"])
def test_the_name_of_the_output_is_harmless_to_a_terminal(command: Main, form: str) -> None:
    _, _, err = command("export", HOVER, "-o", "a\x1b[31m\u202eb", "-F", form)
    assert " written to a\\x1b[31m\\u202eb\n" in err
    assert err.replace("\n", "").isprintable()


def test_the_bar_says_when_frames_are_written(here: Path, monkeypatch: pytest.MonkeyPatch, command: Main) -> None:
    """Those that had to wait for the end, as it is not known before whose the first one is."""
    data = HOVER.read_bytes()
    stamp, bus, _ = data.split(maxsplit=2)
    (here / "late.log").write_bytes(b" ".join((stamp, bus, b"1055550A#00C0\n")) + data)
    monkeypatch.setattr("analyzer.decode.core.BATCH_ROWS", 50)
    monkeypatch.setattr("analyzer.sources.stored.CHUNK", 2000)
    monkeypatch.setattr("analyzer.sinks.late.MOST_WAITING", 100)
    drawn: list[str] = []
    monkeypatch.setattr("sys.stderr.isatty", lambda: True)
    monkeypatch.setattr("analyzer.cli.progress.PATIENCE", 0)
    monkeypatch.setattr("analyzer.cli.progress.PAUSE", 0)
    monkeypatch.setenv("TERM", "xterm")
    monkeypatch.setattr("analyzer.app.process.streams.tell", drawn.append)
    assert command("export", here / "late.log", "-o", here / "out")[0] == 0
    bars = [text for text in drawn if "\x1b[K" in text]
    assert "% [" in bars[0]
    assert bars[-2].startswith("\r\x1b[Kwriting frames  0:")
    assert bars[-1] == "\r\x1b[K"
