"""The table `esc`: every report of an ESC with the command that it had, whatever the vendor and however it is cut."""

from __future__ import annotations

import json
from bisect import bisect_right
from typing import TYPE_CHECKING, Any

import pytest
from kit.command import CAPTURES
from kit.encode import log_line, transfer
from kit.exported import plain
from kit.traffic import MS, START, STATUS, TURNING, log, throttle

import analyzer
import dissectors
from analyzer.devices.escs import Escs, beside
from analyzer.tables import ESC, empty

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from dissectors import Registry

FLIGHT, HOBBYWING = CAPTURES / "mission-8-faults.log", CAPTURES / "hobbywing.log"
FULL = 8191
Rows = list[dict[str, Any]]


@pytest.fixture
def made(decode: Callable[..., Any], registry: Registry) -> Callable[..., Rows]:
    def rows(*text: Any, types: Registry = registry) -> Rows:
        escs = Escs(types)
        found = []
        for batch in decode(*(one.encode() if isinstance(one, str) else one for one in text), types=types).batches:
            found += escs.feed(batch).to_pylist()
        return found

    return rows


def test_a_flight_cell_by_cell() -> None:
    capture = analyzer.open_capture(FLIGHT)
    rows, reports = plain(capture.table("esc")), plain(capture.table("ESCStatus"))
    transfers, commands = plain(capture.table("transfers")), plain(capture.table("RawCommand"))
    ends = [transfers[one["transfer"]]["t_end"] for one in commands]
    assert ends == sorted(ends)
    assert [row["transfer"] for row in rows] == [one["transfer"] for one in reports if one["trusted"]]
    reports = [one for one in reports if one["trusted"]]
    modes = json.loads(capture.table("ESCStatus").schema.field("error_count.mode").metadata[b"enum"])
    ages = set()
    for row, one in zip(rows, reports, strict=True):
        assert (row["t"], row["bus"], row["node"], row["ch"]) == (one["t"], 0, one["src"], one["esc_index"] + 1)
        assert [row[name] for name in ("rpm", "reported", "voltage", "current", "temperature")] == [
            one[name] for name in ("rpm", "power_rating_pct", "voltage", "current", "temperature_celsius")
        ]
        assert row["mode"] == modes[str(one["error_count.mode"])]
        flags = [name for name, value in one.items() if name.startswith("error_count.") and value is True]
        assert row["faults"] == ", ".join(name.partition(".")[2].replace("_", " ") for name in flags)
        at = bisect_right(ends, one["t"]) - 1
        assert (row["commanded"] is None) == (row["command_age"] is None) == (at < 0)
        if at >= 0:
            assert row["commanded"] == pytest.approx(commands[at]["percent"][one["esc_index"]], rel=1e-6)
            assert row["command_age"] == one["t"] - commands[at]["t"]
            ages.add(row["command_age"])
    assert 0 < min(ages) < max(ages) < 4 * MS


@pytest.mark.sampled(4)
@pytest.mark.parametrize("name", ["hobbywing.log", "mission-8-faults.log"])
def test_any_cut_gives_the_same(made: Callable[..., Rows], flush: object, name: str) -> None:
    text = b"".join((CAPTURES / name).read_bytes().splitlines(keepends=True)[:400])
    lines = text.splitlines(keepends=True)
    whole = made(text)
    assert len(whole) > 30
    for size in (1, 7):
        pieces = [part for k in range(0, len(lines), size) for part in (b"".join(lines[k : k + size]), flush)]
        assert made(*pieces) == whole


def test_a_command_that_is_not_complete_counts_for_nothing(made: Callable[..., Rows], flush: object) -> None:
    """Neither one that comes between the frames of the report: the ESC did not have it."""
    first, between = throttle(0, FULL).frames(START), throttle(1, 0).frames(START + 3 * MS)
    one, two, three = transfer("ESCStatus", TURNING, 11, 0).frames(START + 2 * MS)
    text = [log_line(frame) + "\n" for frame in (*first, one, *between, two, three)]
    for cut in range(len(text) + 1):
        (row,) = made("".join(text[:cut]), flush, "".join(text[cut:]))
        assert (row["commanded"], row["command_age"].value) == (100, 2 * MS)


def test_flags_and_modes_in_words(made: Callable[..., Rows]) -> None:
    word = 6 << 12 | 1 << 5 | 1 << 7
    (row,) = made(log((0.0, transfer("ESCStatus", TURNING | {"error_count": word}, 11, 0))))
    assert (row["mode"], row["faults"]) == ("error", "mos over temperature, stall")
    (row,) = made(log((0.0, transfer("ESCStatus", TURNING | {"error_count": 15 << 12}, 11, 0)), (1.0, push())))
    assert row["mode"] in ("15 (undefined)", None)


def push() -> Any:
    return transfer("PUSHCAN", {"data_sequence": 0, "data": [0] * 25}, 11, 0)


def test_a_counter_of_errors_is_no_mode(made: Callable[..., Rows]) -> None:
    (row,) = made(log((0.0, transfer("ESCStatus", STATUS | {"esc_index": 2, "temperature": 300.0}, 10, 0))))
    assert (row["mode"], row["faults"], row["ch"]) == (None, None, 3)
    assert row["temperature"] == pytest.approx(26.85, abs=0.2)


def test_without_times_nobody_knows_the_command(made: Callable[..., Rows]) -> None:
    text = log((0.0, throttle(0, FULL)), (2.0, transfer("ESCStatus", TURNING, 11, 0)))
    console = "".join(
        f"  can0  {name}   [{len(data) // 2}]  {' '.join(data[k : k + 2] for k in range(0, len(data), 2))}\n"
        for name, data in (line.split()[2].split("#") for line in text.splitlines())
    )
    (row,) = made(console)
    assert (row["t"], row["commanded"], row["command_age"], row["rpm"]) == (None, None, None, 3011)


def test_another_vendor_by_data() -> None:
    """Hobbywing's ESCs report in three messages, and say which channel they follow in a fourth."""
    rows = plain(analyzer.open_capture(HOBBYWING).table("esc"))
    assert {row["type"].rpartition(".")[2] for row in rows} == {"StatusMsg1", "StatusMsg2"}
    first = rows[0]
    assert (first["node"], first["ch"], first["commanded"], first["voltage"]) == (11, None, None, None)
    late = [row for row in rows if row["t"] > rows[0]["t"] + 1100 * MS]
    assert {(row["node"], row["ch"]) for row in late} == {(10 + k, k) for k in range(1, 5)}
    assert all(None not in (row["commanded"], row["rpm"], row["voltage"], row["temperature"]) for row in late)
    assert {row["mode"] for row in rows} == {None}


def test_what_an_esc_said_long_ago_does_not_count(made: Callable[..., Rows]) -> None:
    lines = HOBBYWING.read_text().splitlines(keepends=True)
    volts = [line for line in lines if line.split()[2][2:6] == f"{20051:X}"]  # StatusMsg2
    assert volts
    start = float(lines[0][1:18])
    kept = [line for line in lines if line not in volts or float(line[1:18]) < start + 0.5]
    rows = made("".join(kept))
    times = [row["t"].value for row in rows]
    old = [row for row, t in zip(rows, times, strict=True) if t > times[0] + 1600 * MS]
    assert old
    assert {row["voltage"] for row in old} == {None}
    assert None not in {row["rpm"] for row in old}


PLOTS = """\
[quantity]
speed = { title = "Speed", unit = "rpm" }

[table.Spin]
who = { path = "motor", column = "number", first = 1 }
line.speed = { column = "speed" }
states.word = {}
esc = { rpm = "speed", mode = "word.mode", faults = "word" }

[table.Push]
who = { path = "motor", elements = true, first = 1 }
esc = { commanded = "push" }
"""
PROFILE = """\
[message.Spin]
dsdl = "20900.Spin.uavcan"
type = "acme.Spin"
[message.Spin.field.word.bits]
mode = { at = "0-1", enum = { 0 = "rest", 1 = "go" } }
too_hot = 2
[message.Push]
dsdl = "20901.Push.uavcan"
type = "acme.Push"
"""


def test_a_vendor_is_a_folder(decode: Callable[..., Any], tmp_path: Path) -> None:
    folder = tmp_path / "acme"
    folder.mkdir()
    (folder / "20900.Spin.uavcan").write_text("uint16 speed\nuint8 number\nuint8 word\n")
    (folder / "20901.Push.uavcan").write_text("uint8[<=4] push\n")
    (folder / "profile.toml").write_text(PROFILE)
    (folder / "plots.toml").write_text(PLOTS)
    types = dissectors.load([folder])
    line = "(1700000000.{:06d}) can0 {:08X}#{}C{}\n"
    identifier = lambda kind, node: 0x10 << 24 | kind << 8 | node  # noqa: E731
    text = line.format(0, identifier(20901, 1), "1E28", 0)  # 30 %, 40 %
    text += line.format(1000, identifier(20900, 7), "E8030105", 0)  # 1000 rpm, motor 2, go, too hot
    got = decode(text.encode(), types=types)
    (row,) = Escs(types).feed(got.batches[0]).to_pylist()
    assert [row[name] for name in ("node", "ch", "type", "commanded", "rpm", "mode", "faults")] == [
        7, 2, "Spin", 40.0, 1000.0, "go", "too hot",
    ]  # fmt: skip
    assert row["voltage"] is row["reported"] is None


def test_batches_without_reports_have_no_such_table(decode: Callable[..., Any], registry: Registry) -> None:
    got = decode(log((0.0, throttle(0))).encode())
    assert all("esc" not in batch.messages for batch in beside(got.batches, registry))
    assert [Escs(registry).feed(batch) for batch in got.batches] == [empty(ESC)] * len(got.batches)
