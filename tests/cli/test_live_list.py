"""The list of a live session: what `decode` shows of its recording, for readers that are slow, full, or gone."""

from __future__ import annotations

import json
import subprocess
from typing import TYPE_CHECKING

import pytest
from kit.command import BUS, CAPTURES, LIMIT, Reader, start_with_bus

from analyzer.app.live.list import TransferList
from analyzer.cli import main
from analyzer.views.options import WriterOptions
from dissectors import load

if TYPE_CHECKING:
    from pathlib import Path

pytestmark = pytest.mark.usefixtures("no_can_configuration")
FAULTY = CAPTURES / "mission-8-faults.log"
PIPE = subprocess.PIPE


def entries(form: str, text: str) -> list[str]:
    """The transfers of a list in the order of their first frames; in it they stand as they are completed.

    How doubtful fields are read is left out: what is live is shown before that is decided.
    """
    if form == "json":
        assert text.startswith("[\n")
        assert text.endswith("\n]\n")
        return sorted(map(json.dumps, json.loads(text)))
    return sorted(line for line in text.splitlines() if not line.lstrip().startswith(("[read as", "[undecided")))


@pytest.mark.slow
@pytest.mark.parametrize(
    "options",
    [
        "",
        "-t ad",
        "-t d",
        "-V -x",
        "-P -O ESCStatus",
        "-T json",
        "-T jsonl",
        "-T csv",
        "-T fields -e frame.number -e frame.time_relative -e dronecan.src -e ESCStatus.voltage",
    ],
)
def test_it_is_that_of_decode(options: str, tmp_path: Path) -> None:
    """Line by line, but for the order of those that were not complete when others were listed."""
    record = tmp_path / "x.log"
    with start_with_bus(
        FAULTY, "live", BUS, *options.split(), "-c", 900, "-w", record, stdout=PIPE, stderr=PIPE
    ) as live:
        out, err = live.communicate(timeout=LIMIT)
    with start_with_bus("-", "decode", *options.split(), record, stdout=PIPE, stderr=PIPE) as decode:
        expected, _ = decode.communicate(timeout=LIMIT)
    assert b"has ended" not in err
    assert b"not listed" not in err
    assert b"Traceback" not in err
    assert record.read_bytes().count(b"\n") == 900
    form = options.split()[1] if options.startswith("-T") else "text"
    assert entries(form, out.decode()) == entries(form, expected.decode())
    assert out.count(b"\n") > 200


@pytest.mark.sampled(2)
@pytest.mark.parametrize(("form", "expected"), [("json", "[\n]\n"), ("csv", "frame,"), ("text", ""), ("jsonl", "")])
def test_a_bus_that_stays_silent_has_a_list_too(form: str, expected: str, capfd: pytest.CaptureFixture[str]) -> None:
    assert main(["live", "virtual:silent", "--list", "-T", form, "-a", "duration:10ms"]) == 4
    out = capfd.readouterr().out
    assert out == expected if form != "csv" else out.startswith(expected) and out.count("\n") == 1


@pytest.mark.slow
def test_a_reader_that_has_seen_enough(tmp_path: Path) -> None:
    """Ends it quietly: the recording is finished, and the exit status is that of the verdict."""
    record = tmp_path / "x.log"
    hover = CAPTURES / "hover-4.log"
    live = start_with_bus(hover, "live", BUS, "-w", record, "--fail-on", "never", stdout=PIPE, stderr=PIPE)
    with live:
        assert live.stdout is not None
        assert live.stderr is not None
        Reader(live.stdout.fileno()).until(b"ESCStatus")
        live.stdout.close()
        err = live.stderr.read()
        assert live.wait(LIMIT) in {0, 4}  # it may be too little to judge
    assert b"Broken" not in err
    assert b"tailbyte: " not in err
    assert b" received + 0 dropped, as far as its driver tells\n" in err
    assert record.read_bytes().endswith(b"\n")


@pytest.mark.slow
def test_a_reader_of_the_recording_that_has_seen_enough() -> None:
    hover = CAPTURES / "hover-4.log"
    live = start_with_bus(hover, "live", BUS, "-w", "-", "--fail-on", "never", stdout=PIPE, stderr=PIPE)
    with live:
        assert live.stdout is not None
        assert live.stderr is not None
        Reader(live.stdout.fileno()).until(b"#")
        live.stdout.close()
        err = live.stderr.read()
        assert live.wait(LIMIT) in {0, 4}  # it may be too little to judge
    assert b"-- enough: nobody reads the recording any more\n" in err
    assert b"tailbyte: " not in err


@pytest.mark.slow
def test_an_output_that_is_full() -> None:
    with open("/dev/full", "wb") as full:  # noqa: PTH123 - not a path of ours
        live = start_with_bus(FAULTY, "live", BUS, "--fail-on", "never", stdout=full, stderr=PIPE)
    with live:
        _, err = live.communicate(timeout=LIMIT)
    assert live.returncode in {3, 4}  # it may be too little to judge
    assert err.count(b"tailbyte: standard output: No space left on device\n") == 1
    assert b"Traceback" not in err


class Slow:
    """A printer whose reader has stopped."""

    gone = False
    problem: str | None = None
    lost = 0


class Session:
    """As much of one as a list asks for."""

    def __init__(self) -> None:
        self.problems: list[str] = []
        self.stops = 0

    def stop(self) -> None:
        self.stops += 1


def test_what_a_slow_reader_misses_is_counted_and_said() -> None:
    told: list[str] = []
    printer, session = Slow(), Session()
    shown = TransferList(WriterOptions(), load(), printer, several=False, say=told.append)  # type: ignore[arg-type]
    printer.lost = 1200
    shown.look(session)  # type: ignore[arg-type]
    shown.look(session)  # type: ignore[arg-type]
    printer.lost = 1201
    shown.look(session)  # type: ignore[arg-type]
    start = "-- not listed, as whoever reads the list is too slow for it: "
    assert told == [f"{start}1,200 more\n", f"{start}1 more\n"]
    assert (session.stops, session.problems) == (0, [])
    printer.problem = "No space left on device"
    shown.look(session)  # type: ignore[arg-type]
    shown.look(session)  # type: ignore[arg-type]
    assert session.stops
    assert session.problems == ["standard output: No space left on device"]
