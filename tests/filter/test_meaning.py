"""What filters mean: names, words, units, times, presence, nulls; and what they ask of a batch."""

from __future__ import annotations

import time
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from kit import CAPTURES

import analyzer
import dissectors
from analyzer.app.request import Request
from analyzer.app.run import Run
from analyzer.filter import FilterError, compile_expression, compile_filter

if TYPE_CHECKING:
    from collections.abc import Callable

    from analyzer.decode.engine import Batch

REGISTRY = dissectors.load()


def batches(name: str) -> list[Batch]:
    return list(Run(Request((str(CAPTURES / name),), threads=1)).batches())


@pytest.fixture(scope="module")
def failure() -> list[Batch]:
    return batches("esc-failure.mcap")


@pytest.fixture(scope="module")
def faults() -> list[Batch]:
    return batches("faults.log")


def count(some: list[Batch], text: str, **given: Any) -> int:
    matcher = compile_filter(text, REGISTRY).matcher(**given)
    return sum(int(matcher.feed(batch).transfers.sum()) for batch in some)


# Filters that say the same in other words.
SAME = [
    ("ESCStatus.mode == 6", 'ESCStatus.mode == "error"'),
    ("ESCStatus.mode == 6", 'ESCStatus.status.mode == "Error mode"'),
    ("ESCStatus.mode == 6", "ESCStatus.error_count.mode == error"),
    ("ESCStatus.mode == 6", 'ESCStatus.mode in {"error"}'),
    ("ESCStatus.mode == 6", 'ESCStatus.mode matches "^ERR"'),
    ("ESCStatus.mode == 6", 'ESCStatus.mode contains "rr"'),
    ("ESCStatus.voltage < 48.5", "ESCStatus.voltage < 48.5 V"),
    ("ESCStatus.voltage < 48.5", "ESCStatus.voltage < 48500mV"),
    ("ESCStatus.power_rating_pct > 50", "ESCStatus.power_rating_pct > 50 %"),
    ("ESCStatus.power_rating_pct > 50", "50% < ESCStatus.power_rating_pct"),
    ("frame.time_relative < 0.25", "frame.time_relative < 250 ms"),
    ("ESCStatus.temperature_celsius > 100", "uavcan.equipment.esc.Status.temperature_celsius > 100 degC"),
    ("src == 11", "dronecan.src == 0xb"),
    ("src == 11", "dronecan.src == 013"),
    ("src == 11", "dronecan.src == 0b1011"),
    ("RawCommand.cmd[0] > 4000", "max(RawCommand.cmd[0]) > 4000"),
    ("RawCommand.cmd > 4000", "max(RawCommand.cmd) > 4000"),
    ("all RawCommand.cmd > 4000", "min(RawCommand.cmd) > 4000"),
    ("RawCommand.cmd[-1] > 4000", "RawCommand.cmd[3] > 4000"),
    ("RawCommand.cmd[0:2] > 4000", "RawCommand.cmd[0] > 4000 || RawCommand.cmd[1] > 4000"),
    ("MotorStatus.speed > 1000", "PUSHCAN.MotorStatus.speed > 1000 rpm"),
    ("exists(ESCStatus.rpm)", "ESCStatus.rpm"),
    ("ESCStatus", 'dronecan.type == "ESCStatus"'),
    ("PUSHCAN.MotorStatus.fault", "PUSHCAN.MotorStatus.fault != 0"),
    ("ESCStatus.status.mos_over_temperature", "ESCStatus.mos_over_temperature == true"),
    ('GetNodeInfo.name contains "tmotor"', 'GetNodeInfo.Response.name matches "TMOTOR"'),
    ("payload[0:2] == 00:00", "payload[0] == 00 && payload[1] == 0x00"),
    ("payload[0-1] == 00:00", "payload[:2] == 00:00"),
    ("payload[1:] contains 4d", 'payload[1:] contains "M"'),
    ("ESCStatus.rpm / 1000 == 3", "ESCStatus.rpm >= 3000 && ESCStatus.rpm < 4000"),
    ("within(ESCStatus.rpm, 3000, 10 %)", "ESCStatus.rpm >= 2700 && ESCStatus.rpm <= 3300"),
    ("within(ESCStatus.voltage, 48 V, 500 mV)", "ESCStatus.voltage >= 47.5 && ESCStatus.voltage <= 48.5"),
    ("RawCommand.cmd > can.len", "max(RawCommand.cmd) > min(can.len)"),
    ("can.len > RawCommand.cmd", "max(can.len) > min(RawCommand.cmd)"),
    ("RawCommand.cmd == RawCommand.percent", "any RawCommand.cmd == 0"),
    ("can.id == can.id && ESCStatus", "ESCStatus"),
    ("ESCStatus.rpm mod 2 == 0", "ESCStatus.rpm & 1 == 0"),
]  # fmt: skip


@pytest.mark.parametrize(("one", "other"), SAME)
def test_two_ways_to_say_it(failure: list[Batch], one: str, other: str) -> None:
    found = count(failure, one)
    assert found == count(failure, other)
    assert 0 < found < 4769


@pytest.mark.parametrize(("name", "ch", "node"), [("mission-8-faults.log", 2, 12), ("reordering.log", 1, 11)])
def test_broken_reports_are_of_the_channel_of_their_node(name: str, ch: int, node: int) -> None:
    some = batches(name)
    broken = count(some, f"ESCStatus && src == {node} && dronecan.status != ok && !exists(ESCStatus.esc_index)")
    assert count(some, f"ESCStatus && ch == {ch} && !exists(ESCStatus.esc_index)") == broken > 0


def test_a_node_is_the_channel_that_it_has_told_in_a_message_of_its_own() -> None:
    some = batches("hobbywing.log")
    told = count(some, "GetEscID && src == 13 && frame.time_relative < 0.1")
    assert told == 1
    assert count(some, "ch == 3") == count(some, "src == 13 && frame.time_relative > 0.095") > 100
    assert count(some, "ch") > count(some, "ch == 3") == count(some, "ch == 3 && src == 13")


@pytest.mark.parametrize("ch", [1, 2])
def test_settings_are_of_the_channel_that_they_are_for(ch: int) -> None:
    some = batches("mission-8-faults.log")
    for name in ("ParamCfg", "ParamGet"):
        assert count(some, f"{name} && ch == {ch}") == count(some, f"{name}.esc_index == {ch - 1}") > 0
    assert count(some, "ParamCfg.esc_index == 255 && ch") == 0 < count(some, "ParamCfg.esc_index == 255")


@pytest.mark.parametrize("text", ["RawCommand.cmd > RawCommand.percent", "can.len > RawCommand.cmd", "unit", "ch == 1"])
def test_a_frame_of_a_list_has_what_its_transfer_has(failure: list[Batch], text: str) -> None:
    matcher = compile_filter(text.replace("can.len", "5"), REGISTRY).matcher(frame_list=True)
    for batch in failure:
        matches = matcher.feed(batch)
        places, members = matches.members
        wanted = [
            p
            for row, some in enumerate(batch.transfers.column("frame").to_pylist())
            if matches.transfers[row]
            for p in some
        ]
        assert sorted(places[members].tolist()) == sorted(wanted)


def test_a_null_never_matches_but_its_negation_does(failure: list[Batch]) -> None:
    every = count(failure, "src >= 0")
    assert count(failure, "ESCStatus.rpm < 0 || ESCStatus.rpm >= 0") == count(failure, "ESCStatus")
    assert count(failure, "!(ESCStatus.rpm >= -99999)") == every - count(failure, "ESCStatus")
    assert count(failure, "ESCStatus.rpm != 12345") == count(failure, "ESCStatus")


def test_what_the_manual_says_of_rows_without_a_field(faults: list[Batch]) -> None:
    """The table in `tailbyte help filter`, below "Rows without the field"."""
    every = sum(len(batch.transfers) for batch in faults)
    commands = count(faults, "exists(RawCommand.cmd)")
    some, zero, elsewhere = (count(faults, f"RawCommand.cmd {test}") for test in ("== 0", "!= 0", "!== 0"))
    assert 0 < commands < every
    assert zero == commands - some  # all differ, of rows that have it
    assert elsewhere <= commands
    for text in ("!(RawCommand.cmd == 0)", "RawCommand.cmd not in {0}", "not RawCommand.cmd in {0}"):
        assert count(faults, text) == every - some
    assert count(faults, "exists(RawCommand.cmd) && RawCommand.cmd not in {0}") == zero
    channel = [count(faults, f"ESCStatus.esc_index {test}") for test in ("== 0", "!= 0", "not in {0}")]
    assert channel[0] + channel[1] == count(faults, "exists(ESCStatus.esc_index)")
    assert channel[2] == every - channel[0] > channel[1] > 0


def test_a_type_selects_its_broken_transfers_too(faults: list[Batch]) -> None:
    broken = count(faults, 'ESCStatus && dronecan.status == "interrupted"')
    assert broken == count(faults, 'dronecan.type == "ESCStatus" && dronecan.status == "interrupted"') > 0
    assert count(faults, 'ESCStatus.rpm && dronecan.status == "interrupted"') == 0
    assert count(faults, 'ESCStatus.rpm && dronecan.status == "bad crc"') > 0


def test_times_of_day(failure: list[Batch], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("TZ", "UTC")
    time.tzset()
    later = count(failure, "frame.time_relative >= 4")
    moment = failure[0].frames.column("t")[0].value + 4_000_000_000
    day, clock = str(np.datetime64(moment, "ns")).split("T")
    seconds = f"{moment // 10**9}.{moment % 10**9:09}"
    for text in (
        f'time >= "{clock}"',
        f'time >= "{day} {clock}"',
        f'time >= "{day} {clock}Z"',
        f"time_epoch >= {seconds}",
    ):
        assert count(failure, f"frame.{text}") == later > 0


def test_labels_and_findings(failure: list[Batch]) -> None:
    class Named:
        def between(self, first: int, last: int) -> dict[int, list[str]]:
            return {place: ["TRF-003"] for place in range(first, min(last, 9) + 1)}

    assert count(failure, 'node.label == "front left"', labels={11: "front left"}) == count(failure, "node == 11")
    named = count(failure, 'finding.rule == "TRF-003"', named=Named())
    assert named == count(failure, "any frame.number <= 10") > 0
    assert count(failure, "finding.severity == error", named=Named(), severities={"TRF-003": "error"}) == named
    assert compile_filter("finding.rule", REGISTRY).asks_findings


def test_only_the_tables_that_are_needed_are_made(failure: list[Batch]) -> None:
    made: list[str] = []

    class Watched(dict[str, Any]):
        def __getitem__(self, name: str) -> Any:
            made.append(name)
            return super().__getitem__(name)

    watched = [replace(batch, messages=Watched(batch.messages)) for batch in failure]
    assert count(watched, "node == 11 && !RawCommand && can.len < 8 && ESCStatus") > 0
    assert made == []
    assert count(watched, "src == 10 && ESCStatus.rpm > 0") == 0
    assert made == []
    assert count(watched, "ESCStatus.rpm > 0 && src == 11") > 0
    assert set(made) == {"ESCStatus"}
    assert compile_filter("ESCStatus.rpm > 0 && src == 11", REGISTRY).tables == {"ESCStatus"}


def test_an_expression_gives_numbers(failure: list[Batch]) -> None:
    volts, first = compile_expression("ESCStatus.voltage", REGISTRY), compile_expression("RawCommand.cmd", REGISTRY)
    assert (volts.unit, volts.tables) == ("V", {"ESCStatus"})
    for batch in failure:
        found, every = volts.feed(batch), first.feed(batch)
        assert len(found.values) == len(found.valid) == len(batch.transfers)
        assert found.valid.sum() == len(batch.messages["ESCStatus"])
        assert len(every.every) == sum(map(len, batch.messages["RawCommand"].column("cmd").to_pylist()))
        row = batch.messages["RawCommand"].column("transfer")[0].as_py() - batch.first_transfer
        assert every.values[row] == batch.messages["RawCommand"].column("cmd")[0][0].as_py()
    with pytest.raises(FilterError, match="a value is expected here, not a condition"):
        compile_expression("ESCStatus.voltage > 3", REGISTRY)


def test_lag_looks_back_at_the_same_sender(failure: list[Batch]) -> None:
    now, before = compile_expression("ESCStatus.rpm", REGISTRY), compile_expression("lag(ESCStatus.rpm, 1 s)", REGISTRY)
    said: dict[int, list[tuple[int, float]]] = {}
    for batch in failure:
        a, b = now.feed(batch), before.feed(batch)
        src, t = (batch.transfers.column(name).to_numpy(zero_copy_only=False).astype(np.int64) for name in ("src", "t"))
        for row in a.valid.nonzero()[0].tolist():
            known = [value for when, value in said.get(src[row], ()) if when <= t[row] - 10**9]
            assert bool(b.valid[row]) == bool(known)
            assert not known or b.values[row] == known[-1]
            said.setdefault(src[row], []).append((t[row], a.values[row]))
    assert len(said) > 1


def test_what_was_never_seen() -> None:
    made = compile_filter("PUSHCAN.MotorStatus.speed > 1 && !RawCommand && ParamGet.esc_index == 1", REGISTRY)
    assert made.never_seen({"RawCommand", "ESCStatus"}) == ["PUSHCAN.MotorStatus", "ParamGet"]


def test_a_filter_is_one_line_of_python() -> None:
    path = str(CAPTURES / "faults.log")
    capture = analyzer.open_capture(path, filter="src == 11")
    assert set(capture.table("transfers").column("src").to_pylist()) == {11}
    narrow = capture.filter("ESCStatus")
    table = narrow.table("ESCStatus")
    assert 0 < len(table) <= len(narrow.table("transfers"))
    frames = {place for places in narrow.table("transfers").column("frame").to_pylist() for place in places}
    assert len(narrow.table("frames")) >= len(frames)
    esc, every = narrow.table("esc"), analyzer.open_capture(path).table("esc")
    assert 0 < len(esc) < len(every)
    assert set(esc.column("node").to_pylist()) == {11}
    with pytest.raises(FilterError):
        analyzer.open_capture(path, filter="src = 11")


@pytest.mark.parametrize(
    ("text", "same"),
    [
        ("exists(ESCStatus)", "ESCStatus"),
        ("!exists(ESCStatus)", "!ESCStatus"),
        ("ESCStatus.voltage in {44 V..48 V}", "ESCStatus.voltage in {44 V .. 48 V}"),
        ("ESCStatus.voltage in {44V..48V}", "ESCStatus.voltage in {44..48 V}"),
    ],
)
def test_what_means_the_same(text: str, same: str, command: Callable[..., tuple[int, str, str]]) -> None:
    found = [command("decode", CAPTURES / "hover-4.log", "-Y", one) for one in (text, same)]
    assert found[0] == found[1]
    assert found[0][0] == 0


@pytest.mark.parametrize(
    ("text", "holds"),
    [
        ("frame.data[7] & 0x20", lambda data: len(data) > 7 and data[7] & 0x20),
        ("frame.data[7] & 20", lambda data: len(data) > 7 and data[7] & 0x20),
        ("20 & frame.data[7]", lambda data: len(data) > 7 and data[7] & 0x20),
        ("frame.data[7] & e0 == c0", lambda data: len(data) > 7 and data[7] & 0xE0 == 0xC0),
        ("(frame.data[7] & f0) & 10 == 10", lambda data: len(data) > 7 and data[7] & 0x10),
        ("frame.data[7] & 8", lambda data: len(data) > 7 and data[7] & 8),
        ("frame.data[7] + 20 > 212", lambda data: len(data) > 7 and data[7] + 20 > 212),
        ("(data.data[-1] & 0x1f) == 3", lambda data: data and data[-1] & 0x1F == 3),
        ("frame.data[0:1] & 0x80", lambda data: data and data[0] & 0x80),
        ("frame.data[2-2] + 1 > 200", lambda data: len(data) > 2 and data[2] + 1 > 200),
    ],
)
def test_a_byte_is_a_number(faults: list[Batch], text: str, holds: Callable[[bytes], Any]) -> None:
    matcher = compile_filter(text, REGISTRY).matcher(frame_list=True)
    for batch in faults:
        expected = [bool(holds(data)) for data in batch.frames.column("data").to_pylist()]
        remote = np.asarray(batch.frames.column("flags")) & 2 != 0
        assert any(expected)
        assert matcher.feed(batch).frames[~remote].tolist() == np.array(expected)[~remote].tolist()


def test_several_bytes_are_no_number() -> None:
    with pytest.raises(FilterError, match="cannot be calculated"):
        compile_filter("frame.data[0:2] & 1", REGISTRY)
