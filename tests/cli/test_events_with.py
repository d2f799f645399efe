"""`--with flight.bin`: the autopilot's words in `events` and `export`, and what is said when they cannot be had."""

from __future__ import annotations

import csv
import io
import json
import re
from typing import TYPE_CHECKING

import pytest
from kit import CAPTURES, dataflash
from kit.dataflash import rcou, words
from kit.simulated import flown

from analyzer.views.terminal import display_width

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    Command = Callable[..., tuple[int, str, str]]

SECOND = 10**9
BEFORE = 30 * SECOND
OTHER = CAPTURES / "startup.log"


@pytest.fixture(scope="module")
def pair(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    """A capture, and the log of the autopilot that commanded in it."""
    folder = tmp_path_factory.mktemp("with")
    made = flown(10, flight="hover", seed=1)
    commands = [(one.frames[0].t, one.values["cmd"]) for one in made.of("RawCommand")]
    said = words(
        BEFORE // 1000, (-5, "MSG", "ArduCopter V4.5.7 (2a3dc4b7)"), (6, "ERR", 5, 1), (6.5, "MODE", 6, 6, 3),
        (7, "MSG", "Radio \x1b[31mfailsafe"),
    )  # fmt: skip
    log, capture = folder / "flight.bin", folder / "flight.log"
    log.write_bytes(dataflash.log(rcou(commands, -BEFORE), said))
    capture.write_text(made.text, encoding="ascii")
    return capture, log


@pytest.mark.slow
def test_its_words_stand_among_the_events(pair: tuple[Path, Path], command: Command) -> None:
    capture, log = pair
    status, out, err = command("events", capture, "--with", log)
    assert (status, err) == (0, "")
    assert max(map(display_width, out.splitlines())) <= 80
    text = " ".join(out.split())
    assert re.search(r"\d ms autopilot autopilot error: radio failsafe: began: no signal of the pilot", text)
    assert "autopilot mode: RTL (flies home and lands), why: radio failsafe" in text
    assert r"autopilot message: Radio \x1b[31mfailsafe" in text
    assert f"{log}: its clock began 30.00" in text
    assert re.search(r"before the first frame, to within \d\.\d ms: \d+ moves of its outputs", text)
    alone = [line.split() for line in command("events", capture)[1].splitlines()]
    assert [line for line in map(str.split, out.splitlines()) if line in alone] == alone


@pytest.mark.slow
def test_every_form_has_them(pair: tuple[Path, Path], command: Command, tmp_path: Path) -> None:
    capture, log = pair
    status, whole, _ = command("events", capture, "--with", log, "-T", "json")
    found = json.loads(whole)
    assert status == 0
    own = [event for event in found["events"] if event["source"] == "autopilot"]
    assert [event["kind"] for event in own] == ["message", "autopilot error", "mode", "message"]
    assert {event["source"] for event in found["events"]} == {"autopilot", "bus"}
    (part,) = found["autopilot"]["parts"]
    assert found["autopilot"]["name"] == str(log)
    assert part["error_ns"] < 6_000_000
    assert own[1]["t_end_ns"] - own[1]["t_ns"] == 2 * part["error_ns"]
    assert abs((own[1]["t_ns"] + own[1]["t_end_ns"]) / 2 - part["offset_ns"] - BEFORE - 6 * SECOND) < 1_000
    _, lines, _ = command("events", capture, "--with", log, "-T", "jsonl")
    assert [json.loads(line) for line in lines.splitlines()] == found["events"]
    path = tmp_path / "events.csv"
    assert command("export", capture, "--with", log, "--table", "flight_events", "-o", path)[0] == 0
    rows = list(csv.DictReader(io.StringIO(path.read_text())))
    assert [(row["source"], row["text"]) for row in rows] == [(one["source"], one["text"]) for one in found["events"]]
    _, short, _ = command("events", capture, "--with", log, "-T", "csv", "--kind", "autopilot error")
    assert [row["type"] for row in csv.DictReader(io.StringIO(short))] == ["ERR"]


def test_without_a_log_nothing_is_said_of_one(pair: tuple[Path, Path], command: Command) -> None:
    found = json.loads(command("events", pair[0], "-T", "json")[1])
    assert "autopilot" not in found
    assert {event["source"] for event in found["events"]} == {"bus"}


def test_words_of_a_window_are_those_in_its_time(pair: tuple[Path, Path], command: Command, tmp_path: Path) -> None:
    capture, log = pair
    path = tmp_path / "events.csv"
    export = "export", capture, "--with", log, "--table", "flight_events", "-o", path
    assert command(*export, "--from", "6.2")[0] == 0
    types = [row["type"] for row in csv.DictReader(io.StringIO(path.read_text())) if row["source"] == "autopilot"]
    assert types == ["MODE", "MSG"]


def test_a_filter_chooses_rows_of_the_bus(pair: tuple[Path, Path], command: Command) -> None:
    capture, log = pair
    _, out, _ = command("events", capture, "--with", log, "-Y", "node == 11", "-T", "json")
    assert {event["source"] for event in json.loads(out)["events"]} == {"bus"}


def test_a_start_that_is_given(pair: tuple[Path, Path], command: Command) -> None:
    capture, log = pair
    for offset in ("--offset=-28s", "--offset=-28"):
        status, out, _ = command("events", capture, "--with", log, offset, "-T", "json")
        found = json.loads(out)
        assert (status, found["autopilot"]["by"], found["autopilot"]["parts"][0]["error_ns"]) == (0, "given", 0)
        own = [event for event in found["events"] if event["source"] == "autopilot"]
        assert own[1]["t_ns"] == own[1]["t_end_ns"]


@pytest.mark.sampled(4)
@pytest.mark.parametrize("form", ["text", "json"])
def test_a_log_of_another_flight_is_refused_in_one_line(form: str, pair: tuple[Path, Path], command: Command) -> None:
    _, log = pair
    capture = CAPTURES / "hover-4.log"
    status, out, err = command("events", capture, "--with", log, "-T", form)
    assert (status, len(err.splitlines())) == (3, 1)
    assert err.startswith(f"tailbyte: {log}: its outputs are nowhere the commands on the bus")
    assert err.endswith("; nothing of it is told\n")
    if form == "json":
        found = json.loads(out)
        assert (found["autopilot"]["parts"], {event["source"] for event in found["events"]}) == ([], {"bus"})
    else:
        assert out == command("events", capture)[1]


def test_a_log_that_ends_early_keeps_what_stands_before(
    pair: tuple[Path, Path], command: Command, tmp_path: Path
) -> None:
    capture, log = pair
    cut = tmp_path / "cut.bin"
    cut.write_bytes(log.read_bytes()[:-40])
    status, out, err = command("events", capture, "--with", cut)
    assert (status, len(err.splitlines())) == (3, 1)
    assert f"{cut}: byte " in err
    assert "dataflash log ends early: " in err
    assert "RTL (flies home and lands)" in out


@pytest.mark.sampled(4)
@pytest.mark.parametrize(
    ("content", "why"),
    [
        (b"", "is empty"),
        (OTHER.read_bytes(), "looks like candump text, not like a dataflash log"),
        (None, "No such file or directory"),
    ],
    ids=["empty", "foreign", "missing"],
)
def test_what_is_no_log_leaves_the_events_of_the_bus(
    content: bytes | None, why: str, pair: tuple[Path, Path], command: Command, tmp_path: Path
) -> None:
    other = tmp_path / "other.bin"
    if content is not None:
        other.write_bytes(content)
    status, out, err = command("events", pair[0], "--with", other)
    assert (status, err) == (3, f"tailbyte: {other}: {why}\n")
    assert out == command("events", pair[0])[1]
    path = tmp_path / "events.csv"
    status, _, err = command("export", pair[0], "--with", other, "--table", "flight_events", "-o", path)
    assert (status, why in err, path.exists()) == (3, True, True)


@pytest.mark.parametrize(
    ("arguments", "why"),
    [
        (("events", "{}", "--offset", "5s"), "there is no --with FLIGHT.bin"),
        (("events", "{}", "--with", "x.bin", "--offset", "5s", "--offset", "6s"), "give one time"),
        (("events", "{}", "--with", "x.bin", "--offset", "soon"), "'soon' is not a duration"),
        (("events", "{}", "--with", "-"), "--with reads a file"),
        (("export", "{}", "--with", "x.bin", "--table", "flights", "-o", "x.csv"), "give --table flight_events"),
    ],
)
def test_wrong_usage(arguments: tuple[str, ...], why: str, pair: tuple[Path, Path], command: Command) -> None:
    status, _, err = command(*(one.format(pair[0]) for one in arguments))
    assert (status, why in err) == (2, True), err
