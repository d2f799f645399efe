"""States of a picture: only changes, by name; which reading of a status word a node uses, row by row."""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from kit.pictures import Drawn, draw, tables
from kit.simulated import flown

from analyzer.plot.lanes import Lanes

FLAGS = (
    "over_voltage", "under_voltage", "over_current", "throttle_loss", "throttle_abnormal", "mos_over_temperature",
    "capacitor_over_temperature", "stall", "amplifier_fault", "upper_bridge_fault", "lower_bridge_fault",
    "encoder_error",
)  # fmt: skip
MODES = {1: "off", 2: "idle", 3: "soft start", 4: "operating", 5: "coast down", 6: "error"}


@pytest.fixture(scope="module")
def text() -> str:
    return flown(12, escs=2, scenario="pack-sag").text


@pytest.fixture(scope="module")
def drawn(text: str) -> Drawn:
    return draw(text)[0]


def changes(rows: list[dict[str, Any]], column: str, first: list[int]) -> list[tuple[int, Any]]:
    out: list[tuple[int, Any]] = []
    for row in rows:
        if not out or out[-1][1] != row[column]:
            out.append((first[row["transfer"]], row[column]))
    return out


def shown(drawn: Drawn, entity: str) -> list[tuple[int, Any]]:
    return [(times["frame"], value) for times, value in drawn.points(entity)]


@pytest.mark.slow
def test_every_bit_and_the_mode_of_a_status_word(text: str, drawn: Drawn) -> None:
    found, first = tables(text)
    for index in range(2):
        rows = [row for row in found["ESCStatus"] if row["esc_index"] == index]
        modes = changes(rows, "error_count.mode", first)
        assert len(modes) > 0
        assert shown(drawn, f"/states/mode/esc{index + 1}") == [(frame, MODES[mode]) for frame, mode in modes]
        for flag in FLAGS:
            wanted = [(frame, "on" if bit else "off") for frame, bit in changes(rows, f"error_count.{flag}", first)]
            assert shown(drawn, f"/states/{flag}/esc{index + 1}") == wanted


@pytest.mark.slow
def test_states_of_a_power_unit_and_of_a_node(text: str, drawn: Drawn) -> None:
    found, first = tables(text)
    rows = [row for row in found["PUSHCAN.MotorStatus"] if row["unit"] == 1]
    names = {0x00: "no rotor lock", 0x11: "rotor lock", 0xCC: "fault"}
    wanted = [(frame, names[code]) for frame, code in changes(rows, "system_status", first)]
    assert shown(drawn, "/states/system_status/unit1") == wanted
    node = found["uavcan.protocol.NodeStatus"][0]["src"]
    health = [row for row in found["uavcan.protocol.NodeStatus"] if row["src"] == node]
    texts = ["ok", "warning", "error", "critical"]
    assert shown(drawn, f"/states/health/node{node}") == [(f, texts[k]) for f, k in changes(health, "health", first)]


@pytest.mark.slow
def test_a_flag_that_was_set_makes_its_lane_active(text: str) -> None:
    lanes = draw(text)[1].inventory.series
    assert lanes["/states/under_voltage/esc1"].active
    assert not lanes["/states/stall/esc1"].active
    assert lanes["/states/mode/esc1"].active
    assert lanes["/states/stall/esc1"].flag
    assert not lanes["/states/mode/esc1"].flag


def test_stock_nodes_count_errors_and_have_no_lanes() -> None:
    text = flown(6, escs=2, stock=True).text
    drawn, _ = draw(text)
    found, _ = tables(text)
    rows = [row for row in found["ESCStatus"] if row["esc_index"] == 0]
    assert drawn.values("/errors/esc1") == [float(row["error_count"]) for row in rows]
    assert drawn.under("/states/mode/esc") == drawn.under("/encoder/") == drawn.under("/states/stall/esc") == []
    assert len(drawn.values("/voltage/esc1")) == len(rows)


@pytest.mark.slow
def test_a_reading_can_be_forced() -> None:
    text = flown(6, escs=2, stock=True).text
    node = tables(text)[0]["ESCStatus"][0]["src"]
    drawn, _ = draw(text, forced={node: ["tm"]})
    index = tables(text)[0]["ESCStatus"][0]["esc_index"] + 1
    other = 3 - index
    assert drawn.under("/encoder/") == [f"/encoder/esc{index}"]
    assert drawn.under("/errors/") == [f"/errors/esc{other}"]
    tm = flown(6, escs=2).text
    forced, _ = draw(tm, forced={node: ["dronecan"]})
    assert f"/errors/esc{index}" in forced.rows


@pytest.mark.slow
def test_a_mode_change_in_a_mission() -> None:
    """Spinning up and down again goes through several modes, in both numberings of the ESC."""
    drawn, _ = draw(flown(30, escs=1, flight="mission").text)
    names = drawn.values("/states/mode/esc1")
    assert len(names) > 2
    assert all(one != two for one, two in pairwise(names))
    assert set(names) <= set(MODES.values())


@given(st.lists(st.lists(st.integers(0, 2), max_size=6), max_size=6))
def test_only_changes_are_shown_however_the_rows_come(parts: list[list[int]]) -> None:
    lanes, got = Lanes(), []
    for part in parts:
        rows = lanes.changes("lane", np.array(part, np.int64))
        got += [part[k] for k in rows]
    flat = [code for part in parts for code in part]
    assert got == [code for k, code in enumerate(flat) if k == 0 or flat[k - 1] != code]
