"""Devices on the board: values, lowest, highest, states, flags and pauses, told anew from the decoded tables."""

from __future__ import annotations

import itertools
import math
from typing import TYPE_CHECKING, Any

import pytest
from kit import encode
from kit.command import START
from kit.judged import registry
from kit.monitor import batches, board_of, capture, esc, named, shown, text_of
from kit.simulated import faulted

from analyzer.board.board import Board
from analyzer.board.sheet import MOST_DEVICES

if TYPE_CHECKING:
    from analyzer.board.snapshot import DeviceRow, DeviceTable, Snapshot

MS, SECOND = 1_000_000, 1_000_000_000
# What the plots of the dissector call them, and the columns of its table.
COLUMNS = {"voltage": "voltage", "current": "current", "temperature": "temperature_celsius", "speed": "rpm"}


def table(snapshot: Snapshot, kind: str = "esc") -> DeviceTable:
    return next(one for one in snapshot.devices if one.kind == kind)


def device(snapshot: Snapshot, label: str, kind: str = "esc") -> DeviceRow:
    return next(row for row in table(snapshot, kind).rows if row.label == label)


def rows_of(text: bytes, name: str) -> list[dict[str, Any]]:
    """The trusted rows of a table, one dictionary each."""
    found = [batch.messages[name].to_pylist() for batch in batches(text, 1 << 20) if name in batch.messages]
    return [row for part in found for row in part if row["trusted"] and row.get("packet_ok", True)]


@pytest.mark.parametrize("name", ["hover-4.log", "mission-8-faults.log"])
def test_values_lowest_and_highest_are_those_of_the_table(name: str) -> None:
    text = capture(name)
    snapshot = shown(text)
    by_index: dict[int, list[dict[str, Any]]] = {}
    for row in rows_of(text, "ESCStatus"):
        by_index.setdefault(row["esc_index"], []).append(row)
    assert len(by_index) >= 4
    assert [row.number for row in table(snapshot).rows] == [index + 1 for index in sorted(by_index)]
    for index, rows in by_index.items():
        one = device(snapshot, str(index + 1))
        for quantity, column in COLUMNS.items():
            values = [row[column] for row in rows]
            reading = one.readings[quantity, ""]
            assert (reading.last, reading.low, reading.high) == (values[-1], min(values), max(values)), (index, column)
        times = [row["t"].value for row in rows]
        assert one.gap == max(after - before for before, after in itertools.pairwise(times))
        assert one.node == rows[-1]["src"]


def test_what_is_commanded_stands_beside_what_is_reported() -> None:
    text = capture("hover-4.log")
    commands = [row["percent"] for row in rows_of(text, "RawCommand")]
    snapshot = shown(text)
    roles = [(head.quantity, head.role) for head in table(snapshot).heads]
    assert ("throttle", "commanded") in roles
    assert ("throttle", "reported") in roles
    for place in range(4):
        reading = device(snapshot, str(place + 1)).readings["throttle", "commanded"]
        values = [row[place] for row in commands]
        assert reading.last == pytest.approx(values[-1])
        assert (reading.low, reading.high) == (pytest.approx(min(values)), pytest.approx(max(values)))


def test_a_device_that_is_commanded_but_never_reports_is_shown() -> None:
    frames = [
        frame
        for k in range(20)
        for frame in encode.transfer("RawCommand", {"cmd": [0, 4000, 0]}, 1, k).frames(START + k * 10 * MS)
    ]
    snapshot = shown(text_of(frames))
    assert [row.label for row in table(snapshot).rows] == ["2"]  # the others are commanded to stand still
    (row,) = table(snapshot).rows
    assert (row.age, row.gap, row.node, row.states) == (None, None, 0, ())


def test_states_are_named_and_flags_are_those_set_now() -> None:
    snapshot = shown(capture("mission-8-faults.log"))
    assert {row.states for row in table(snapshot).rows} == {("operating",)}
    assert {row.label: row.flags for row in table(snapshot).rows if row.flags} == {"3": ("mos over temperature",)}


def test_a_flag_that_is_gone_is_latched_with_its_times() -> None:
    text = capture("bus-break.log")
    rows = [row for row in rows_of(text, "ESCStatus") if row["esc_index"] == 2]
    times = [row["t"].value for row in rows if row["error_count"] & 1 << 3]
    snapshot = shown(text)
    (one,) = (one for one in snapshot.latched if one.kind == "flag" and one.subject == "ESC 3")
    assert (one.text, one.first, one.last, one.now) == ("throttle loss", times[0], times[-1], False)
    assert device(snapshot, "3").flags == ()


def test_a_mark_begins_anew_and_keeps_what_holds() -> None:
    board, now = board_of(capture("mission-8-faults.log"))
    before = device(board.snapshot(now), "3")
    board.mark(now)
    after = board.snapshot(now)
    row = device(after, "3")
    reading = row.readings["temperature", ""]
    assert reading.last == before.readings["temperature", ""].last
    assert (reading.low, reading.high, row.gap) == (None, None, None)
    assert (row.flags, row.states) == (before.flags, before.states)
    flags = {(one.subject, one.text, one.count, one.now) for one in after.latched if one.kind == "flag"}
    assert flags == {(f"{kind} 3", "mos over temperature", 1, True) for kind in ("ESC", "unit")}
    assert (after.marks, after.since) == (1, now)


def test_lowest_and_highest_after_a_mark_are_those_since() -> None:
    text = capture("hover-4.log")
    board, parts, now = Board(registry(), {"can0": None}), list(batches(text)), 0
    for k, batch in enumerate(parts):
        if k == 4:
            board.mark(now)
        now = batch.frames.column("t")[-1].value
        board.feed(batch, now)
    values = [
        row["voltage"]
        for batch in parts[4:]
        for row in batch.messages["ESCStatus"].to_pylist()
        if row["esc_index"] == 0 and row["trusted"]
    ]
    reading = device(board.snapshot(now), "1").readings["voltage", ""]
    assert (reading.low, reading.high) == (min(values), max(values))


def test_age_counts_on_while_nothing_comes_and_a_row_becomes_stale() -> None:
    board, now = board_of(capture("hover-4.log"))
    fresh, later = device(board.snapshot(now), "1"), device(board.snapshot(now + 5 * SECOND), "1")
    assert fresh.age is not None
    assert later.age == fresh.age + 5 * SECOND
    assert (fresh.stale, later.stale) == (False, True)
    assert any(one.subject == "ESC 1" and one.now for one in board.snapshot(now + 5 * SECOND).latched)


def test_ages_are_told_on_the_clock_of_the_frames() -> None:
    """A recorder whose clock is years away from this machine's."""
    board = Board(registry(), {"can0": None})
    for k, batch in enumerate(batches(capture("hover-4.log"))):
        board.feed(batch, 42 * SECOND + k)
    assert device(board.snapshot(43 * SECOND), "1").age < 2 * SECOND


def test_rows_that_are_gone_are_cleared_and_come_back() -> None:
    text = capture("hover-4.log")
    board, now = board_of(text)
    board.clear(now + 60 * SECOND)
    gone = board.snapshot(now + 60 * SECOND)
    assert (gone.devices, gone.nodes, gone.latched) == ((), (), ())
    for batch in batches(text):
        board.feed(batch, now + 61 * SECOND)
    back = board.snapshot(now + 61 * SECOND)
    assert len(table(back).rows) == 4
    assert len(back.nodes) == 6
    again = board.snapshot(now + 90 * SECOND)
    assert [row.stale for row in table(again).rows] == [True] * 4
    assert {"ESC 1", "can0 node 11"} <= {one.subject for one in again.latched}


def test_a_node_that_reads_the_word_as_a_count_has_no_flags() -> None:
    """The standard reading of the same field: no mode, no flags."""
    frames = [one for k in range(40) for one in esc(20, k, START + k * 20 * MS, error_count=0x0FF)]
    row = device(shown(text_of(frames)), "1")
    assert (row.states, row.flags) == ((), ())
    assert row.readings["errors", ""].last == 0x0FF


def test_infinite_and_missing_numbers_leave_the_last_good_one() -> None:
    volts = (40.0, 42.0, math.inf, math.nan)
    frames = [one for k, value in enumerate(volts) for one in esc(20, k, START + k * 20 * MS, voltage=value)]
    for step in (1, 100):
        reading = device(shown(text_of(frames), step), "1").readings["voltage", ""]
        assert (reading.last, reading.low, reading.high) == (42.0, 40.0, 42.0)


def test_two_nodes_that_report_one_device_are_two_rows() -> None:
    rows = table(shown(capture("duplicate-node.log"))).rows
    assert len({row.label for row in rows}) == len(rows)
    frames = [one for k in range(10) for node in (20, 21) for one in esc(node, k, START + k * 20 * MS + node * MS)]
    assert [row.label for row in table(shown(text_of(frames))).rows] == ["1", "1 (node 21)"]


@pytest.mark.parametrize("step", [1, 7, 800])
def test_the_node_that_spoke_first_gives_a_device_its_name(step: int) -> None:
    frames = [*esc(21, 0, START), *esc(20, 0, START + 10 * MS)]
    assert [(row.label, row.node) for row in table(shown(text_of(frames), step)).rows] == [
        ("1", 21),
        ("1 (node 20)", 20),
    ]


@pytest.mark.parametrize("step", [1, 5, 800])
def test_times_of_a_flag_are_those_of_the_first_and_last_row_with_it(step: int) -> None:
    operating, stall = 4 << 12, 1 << 7
    words = [operating, operating | stall, operating, operating | stall, operating | stall, operating, operating]
    frames = [one for k, word in enumerate(words) for one in esc(20, k, START + k * 20 * MS, error_count=word)]
    (one,) = shown(text_of(frames), step).latched
    assert (one.subject, one.text, one.count, one.now) == ("ESC 1", "stall", 2, False)
    assert (one.first, one.last) == (START + 20 * MS, START + 80 * MS)


def test_pauses_are_those_of_what_a_device_reports_most_often() -> None:
    frames = [one for k in range(100) for one in esc(20, k, START + k * 20 * MS)]
    for k in range(4):  # of the first ESC, all zero: 7 bytes, one frame
        frames += encode.Transfer("message", 1036, 20, bytes(7), 0, k).frames(START + 1 + k * 500 * MS)
    row = device(shown(text_of(sorted(frames, key=lambda one: one.t))), "1")
    assert ("temperature", "motor") in row.readings
    assert row.gap == 20 * MS


@pytest.mark.slow
def test_devices_are_bounded_and_the_rest_is_counted() -> None:
    pairs = [(node, index) for node in range(1, 21) for index in range(20)]
    frames = [one for k, (node, index) in enumerate(pairs) for one in esc(node, index, START + k * MS, esc_index=index)]
    snapshot = shown(text_of(frames))
    assert len(table(snapshot).rows) == MOST_DEVICES
    assert snapshot.beyond == 400 - MOST_DEVICES
    assert shown(text_of(frames), 7) == snapshot


@pytest.mark.slow
@pytest.mark.parametrize("name", ["hover-4.log", "bus-break.log", "mission-8-faults.log", "duplicate-node.log"])
def test_what_is_shown_does_not_depend_on_the_batches(name: str) -> None:
    text = capture(name)
    text = b"".join(text.splitlines(keepends=True)[:4000])
    whole = shown(text, 1 << 20)
    assert [shown(text, step) == whole for step in (37, 800)] == [True, True]


def test_names_are_kept_as_they_came() -> None:
    board, now = board_of(text_of(named(30, b"[red]x[/]\x1b[2J")))
    (row,) = board.snapshot(now).nodes
    assert row.name == "[red]x[/]\x1b[2J"


def test_twenty_devices_each_have_a_row() -> None:
    assert len(table(shown(faulted(escs=20, seconds=1.5).text.encode())).rows) == 20
