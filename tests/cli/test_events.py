"""The command events, and a flight as a window of every command that reads a file."""

from __future__ import annotations

import csv
import io
import json
from typing import TYPE_CHECKING

import pytest
from kit import CAPTURES
from kit.traffic import TURNING, capture

import analyzer
from analyzer.flight.kinds import KINDS
from analyzer.flight.thresholds import FILE, lasting, threshold
from analyzer.views.terminal import display_width

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    Command = Callable[..., tuple[int, str, str]]

HOVER, LOSS, BREAK = (CAPTURES / f"{name}.log" for name in ("hover-4", "command-loss", "bus-break"))


@pytest.fixture
def two(tmp_path: Path) -> Path:
    """Two flights of one ESC, 5 s apart: 500 reports, three frames each."""
    flying = (*range(1000, 5000), *range(10_000, 15_000))
    rpm = dict.fromkeys(flying, 3000)
    path = tmp_path / "two.log"
    path.write_text(
        capture((t, 11, "ESCStatus", TURNING | {"rpm": rpm.get(t, 0)}) for t in range(0, 20_000, 40)), encoding="ascii"
    )
    return path


@pytest.mark.parametrize("form", ["text", "json", "csv"])
def test_times_of_a_nanosecond(form: str, command: Command, tmp_path: Path) -> None:
    path = tmp_path / "fine.log"
    path.write_text(LOSS.read_text(encoding="ascii").replace(") ", "123) "), encoding="ascii")
    status, out, err = command("events", path, "-T", form)
    assert (status, err) == (0, "")
    assert "nothing is commanded" in out
    assert command("info", path, "--flight", "last")[0] == 0


def test_a_clock_that_steps_back_in_flight(command: Command, two: Path) -> None:
    """Nobody can say how long it was by these times."""
    lines = two.read_text(encoding="ascii").splitlines()
    middle = float(lines[len(lines) // 2][1:].split(")")[0]) - 7
    moved = (
        f"({float(t) - 7213 * (float(t) > middle):.6f}){rest}"
        for t, _, rest in (line[1:].partition(")") for line in lines)
    )
    two.write_text("\n".join(moved) + "\n", encoding="ascii")
    status, out, err = command("events", two)
    assert (status, err) == (0, "")
    assert " 0.0 s " not in out
    assert "clock: the clock steps back by 7213" in out


def test_text_of_a_story(command: Command) -> None:
    status, out, err = command("events", LOSS)
    assert (status, err) == (0, "")
    assert max(map(display_width, out.splitlines())) <= 80
    lines = out.splitlines()
    assert lines[lines.index("flights") + 1].split() == [
        "1", "08:02:11.379", "to", "08:02:13.168", "1.8", "s", "landed", "ch1-3", "by", "telemetry",
    ]  # fmt: skip
    words = " ".join(out.split())
    assert "08:02:12.500 2 ms node 10 commands stop: nothing is commanded, to the end" in words
    assert "08:02:12.602 33 ms ch1-3 fault: throttle loss, to the end" in words


def test_every_form_has_the_same_events(command: Command) -> None:
    _, lines, _ = command("events", BREAK, "-T", "jsonl")
    events = [json.loads(line) for line in lines.splitlines()]
    _, whole, _ = command("events", BREAK, "-T", "json")
    content = json.loads(whole)
    assert content["events"] == events
    assert [one["end"] for one in content["flights"]] == ["cut"]
    assert content["flights"][0]["chs"] == [1, 2, 3, 4]
    _, text, _ = command("events", BREAK, "-T", "csv")
    rows = list(csv.DictReader(io.StringIO(text)))
    assert [(int(row["frame"]), row["kind"], row["text"]) for row in rows] == [
        (one["frame"], one["kind"], one["text"]) for one in events
    ]
    table = analyzer.open_capture(BREAK).stats("events")
    assert table.column("text").to_pylist() == [one["text"] for one in events]
    assert [one["event"] for one in events] == list(range(1, len(events) + 1))
    assert all(one["t_ns"] is None or one["t_ns"] <= one["t_end_ns"] for one in events)
    assert {one["kind"] for one in events} <= set(KINDS)


def test_kinds(command: Command) -> None:
    _, out, _ = command("events", BREAK, "--kind", "gap", "--kind", "errors", "-T", "jsonl")
    assert [json.loads(line)["kind"] for line in out.splitlines()] == ["errors", "gap"]
    status, _, err = command("events", BREAK, "--kind", "crash")
    assert (status, "crash is none of fault, mode" in err) == (2, True)


def test_a_filter_shows_what_its_transfers_tell(command: Command) -> None:
    _, out, _ = command("events", LOSS, "-Y", "node == 12", "-T", "jsonl")
    events = [json.loads(line) for line in out.splitlines()]
    assert {one["node"] for one in events} == {12}
    _, out, _ = command("events", LOSS, "-T", "jsonl")
    assert events == [one for one in map(json.loads, out.splitlines()) if one["node"] == 12]


def test_what_nothing_can_be_told_of(tmp_path: Path, command: Command) -> None:
    empty, timeless = tmp_path / "empty.log", tmp_path / "timeless.log"
    empty.write_bytes(b"")
    timeless.write_text("can0  1F040A0A   [8]  00 01 02 03 04 05 06 C0\n", encoding="ascii")
    for path, expected in ((empty, 3), (timeless, 0)):
        status, out, _ = command("events", path)
        assert status == expected
        assert "flights  none" in out
        assert "events  none" in out
        assert "without times nothing can be told" in out
    assert command("events", tmp_path / "none.log")[0] == 3


def test_hostile_words_are_escaped(tmp_path: Path, command: Command) -> None:
    words = {"level": {"value": 3}, "source": [], "text": list(b"\x1b[2J gone")}
    path = tmp_path / "words.log"
    path.write_text(capture([(0, 42, "uavcan.protocol.debug.LogMessage", words)]), encoding="ascii")
    for options in ((), ("-T", "jsonl"), ("-T", "json")):
        _, out, _ = command("events", path, *options)
        assert "\x1b" not in out
        assert "gone" in out


# ---- a flight as a window


@pytest.mark.sampled(4)
@pytest.mark.parametrize(("flight", "frames"), [("1", "76-375"), ("2", "751-1125"), ("last", "751-1125")])
def test_a_flight_is_a_window(flight: str, frames: str, two: Path, command: Command) -> None:
    for name in ("decode", "info", "stats io,1"):
        words = name.split()
        narrow = command(*words, two, "--flight", flight)
        wide = command(*words, two, "--frames", frames)
        assert narrow[0] == wide[0] == 0
        assert narrow[1].replace(f"--flight {flight}", f"--frames {frames}") == wide[1]


def test_both_flights_are_listed(two: Path, command: Command) -> None:
    _, out, _ = command("stats", "flights", two, "-T", "csv")
    rows = list(csv.DictReader(io.StringIO(out)))
    assert [(row["frame"], row["frame_end"], row["end"]) for row in rows] == [
        ("76", "375", "landed"), ("751", "1125", "landed"),
    ]  # fmt: skip


def test_it_goes_with_other_limits_and_to_every_command(two: Path, tmp_path: Path, command: Command) -> None:
    _, out, _ = command("decode", two, "--flight", "2", "--frames", "-780", "-T", "jsonl")
    assert len(out.splitlines()) == 10
    assert command("convert", two, tmp_path / "cut.log", "--flight", "1")[0] == 0
    assert len((tmp_path / "cut.log").read_text().splitlines()) == 300
    assert command("export", two, "--table", "frames", "-F", "csv", "-o", tmp_path / "out", "--flight", "1")[0] == 0
    assert len((tmp_path / "out" / "frames.csv").read_text().splitlines()) == 301
    _, out, _ = command("check", two, HOVER, "--flight", "1")
    assert "300 frames, all accounted for" in out
    assert "3413 frames, all accounted for" in out
    assert command("events", two, "--flight", "2")[0] == 0


@pytest.mark.parametrize(
    ("flight", "reason"),
    [
        ("3", "no flight 3: it has 2"),
        ("0", "--flight: '0' is no flight (1, 2, ... or last)"),
        ("-1", "--flight"),
        ("first", "--flight: 'first' is no flight (1, 2, ... or last)"),
    ],
)
def test_a_flight_that_is_none(flight: str, reason: str, two: Path, command: Command) -> None:
    status, out, err = command("decode", two, f"--flight={flight}")
    assert (status, out) == (2, "")
    assert reason in err


def test_where_there_is_none(command: Command, tmp_path: Path) -> None:
    status, _, err = command("info", CAPTURES / "services.log", "--flight", "last")
    assert (status, "no flight: motors never turned for long enough" in err) == (2, True)
    assert command("info", tmp_path / "nothing.log", "--flight", "last")[0] == 3
    damaged = tmp_path / "damaged.log"
    damaged.write_bytes(b"nothing to read\n")
    status, _, err = command("info", damaged, "--flight", "1")
    assert (status, "it is damaged" in err) == (2, True)


def test_what_exists_only_once_has_no_second_reading(command: Command) -> None:
    status, _, err = command("info", "-", "--flight", "1")
    assert (status, "exists only once" in err) == (2, True)


# ---- tables


@pytest.mark.parametrize("form", ["csv", "parquet", "arrow"])
def test_they_are_tables_for_other_tools(form: str, tmp_path: Path, command: Command) -> None:
    names = "flights", "flight_events"
    chosen = [part for name in names for part in ("--table", name)]
    status, _, _ = command("export", LOSS, *chosen, "-F", form, "-o", tmp_path / "out")
    assert status == 0
    suffix = {"csv": "csv", "parquet": "parquet", "arrow": "arrow"}[form]
    assert {path.name for path in (tmp_path / "out").iterdir()} == {f"{name}.{suffix}" for name in names}
    if form == "csv":
        flights, events = (
            list(csv.DictReader(io.StringIO((tmp_path / "out" / f"{name}.csv").read_text()))) for name in names
        )
        _, text, _ = command("events", LOSS, "-T", "csv")
        shown = list(csv.DictReader(io.StringIO(text)))
        alike = ("event", "t_ns", "t_end_ns", "until_ns", "bus", "node", "ch", "kind", "text", "frame", "values")
        assert [[row[name] for name in alike] for row in events] == [[row[name] for name in alike] for row in shown]
        assert [(row["end"], row["chs"]) for row in flights] == [("landed", "[1,2,3]")]


def test_tables_of_a_window_and_of_nothing(tmp_path: Path, command: Command) -> None:
    path = tmp_path / "events.csv"
    assert command("export", LOSS, "--table", "flight_events", "-o", path, "--from", "4")[0] == 0
    rows = list(csv.DictReader(io.StringIO(path.read_text())))
    assert [row["text"] for row in rows if row["kind"] == "mode"] == ["coast down -> idle"] * 3
    assert {row["kind"] for row in rows} == {"mode", "parameter"}
    assert all(row["t_end"] >= "2026-03-14 08:02:14" for row in rows)
    none = tmp_path / "flights.csv"
    assert command("export", CAPTURES / "services.log", "--table", "flights", "-o", none)[0] == 0
    assert len(none.read_text().splitlines()) == 1
    status, _, err = command("export", LOSS, "--table", "flights", "-o", tmp_path / "x.mcap")
    assert (status, "flights is a table for Parquet" in err) == (2, True)


# ---- numbers


def test_every_threshold_says_where_it_comes_from() -> None:
    import tomllib  # noqa: PLC0415 - one test reads the file as it is

    entries = tomllib.loads(FILE.read_text(encoding="utf-8"))
    assert all(set(entry) == {"value", "origin"} and len(entry["origin"]) > 20 for entry in entries.values())
    assert lasting("turning") == 300_000_000
    assert threshold("saturated_percent") == 99.5
    product = "".join(path.read_text() for path in FILE.parent.rglob("*.py"))
    for name in entries:
        built = f'f"{name.partition("_")[0]}_{{' in product  # of a quantity
        assert built or f'"{name}"' in product or f'"{name.removesuffix("_s")}"' in product, name
