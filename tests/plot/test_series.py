"""Every line of a picture holds the points of the decode: the same rows, times, frames and values."""

from __future__ import annotations

import math
import re
from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from kit.pictures import Drawn, draw, tables
from kit.simulated import flown

from analyzer.devices import units
from analyzer.plot import inventory
from analyzer.plot.derived import Integrals
from analyzer.simulate import START
from dissectors.kit import NO_TIME, SECOND

SETTINGS = {"escs": 4, "flight": "mission", "seed": 3}


@pytest.fixture(scope="module")
def text() -> str:
    return flown(8, **SETTINGS).text


@pytest.fixture(scope="module")
def decoded(text: str) -> tuple[dict[str, list[dict[str, Any]]], list[int]]:
    return tables(text)


@pytest.fixture(scope="module")
def drawn(text: str) -> Drawn:
    return draw(text)[0]


def same(drawn: Drawn, entity: str, rows: list[dict[str, Any]], values: list[Any], first: list[int]) -> None:
    """The line has exactly these rows, on every timeline."""
    assert rows
    start = zero(drawn)
    wanted = [
        ({"time": row["t"], "since_start": row["t"] - start, "frame": first[row["transfer"]]}, value)
        for row, value in zip(rows, values, strict=True)
        if value is not None
    ]
    assert drawn.points(entity) == wanted


def zero(drawn: Drawn) -> int:
    times, _ = drawn.points("/bus_load/can0")[0]
    return times["time"] - times["since_start"]


@pytest.mark.sampled(2)
@pytest.mark.parametrize(
    ("entity", "column"),
    [
        ("voltage", "voltage"),
        ("current", "current"),
        ("temperature", "temperature_celsius"),
        ("speed", "rpm"),
        ("throttle/reported", "power_rating_pct"),
        ("encoder", "error_count.encoder"),
    ],
)
def test_reports_of_an_esc(drawn: Drawn, decoded: Any, entity: str, column: str) -> None:
    found, first = decoded
    for index in range(4):
        rows = [row for row in found["ESCStatus"] if row["esc_index"] == index]
        same(drawn, f"/{entity}/esc{index + 1}", rows, [row[column] for row in rows], first)
    assert f"/{entity}/esc5" not in drawn.rows
    assert f"/{entity}/esc0" not in drawn.rows


@pytest.mark.parametrize(
    ("entity", "column"),
    [
        ("voltage", "voltage"),
        ("current", "current"),
        ("temperature", "temperature_celsius"),
        ("speed", "speed"),
        ("throttle/reported", "throttle"),
        ("encoder", "position"),
        ("runtime", "runtime.unwrapped"),
    ],
)
def test_packets_of_a_power_unit(drawn: Drawn, decoded: Any, entity: str, column: str) -> None:
    found, first = decoded
    for unit in {row["unit"] for row in found["PUSHCAN.MotorStatus"]}:
        rows = [row for row in found["PUSHCAN.MotorStatus"] if row["unit"] == unit]
        same(drawn, f"/{entity}/unit{unit:.0f}", rows, [row[column] for row in rows], first)


def test_commands_are_a_line_for_each_channel(drawn: Drawn, decoded: Any) -> None:
    found, first = decoded
    rows = found["RawCommand"]
    for channel in range(4):
        same(drawn, f"/throttle/commanded/esc{channel + 1}", rows, [row["percent"][channel] for row in rows], first)


def test_power_is_voltage_times_current_and_energy_adds_it_up(drawn: Drawn, decoded: Any) -> None:
    found, first = decoded
    rows = [row for row in found["ESCStatus"] if row["esc_index"] == 0]
    power = [row["voltage"] * row["current"] for row in rows]
    same(drawn, "/power/esc1", rows, power, first)
    total, sums = 0.0, [0.0]
    for k in range(1, len(rows)):
        total += (power[k] + power[k - 1]) / 2 * (rows[k]["t"] - rows[k - 1]["t"]) / 1e9 / 3600
        sums.append(total)
    assert drawn.values("/energy/esc1") == pytest.approx(sums, rel=1e-12)
    assert sums[-1] > 0


def test_the_period_of_commands_and_how_it_changes(drawn: Drawn, decoded: Any) -> None:
    found, _ = decoded
    times = [row["t"] for row in found["RawCommand"]]
    node = found["RawCommand"][0]["src"]
    periods = [(b - a) / 1e6 for a, b in pairwise(times)]
    assert drawn.values(f"/command_period/node{node}") == pytest.approx(periods, rel=1e-12)
    changes = [abs(b - a) for a, b in pairwise(periods)]
    assert drawn.values(f"/command_jitter/node{node}") == pytest.approx(changes, abs=1e-9)


def test_uptime_of_every_node(drawn: Drawn, decoded: Any) -> None:
    found, first = decoded
    status = found["uavcan.protocol.NodeStatus"]
    for node in {row["src"] for row in status}:
        rows = [row for row in status if row["src"] == node]
        same(drawn, f"/uptime/node{node}", rows, [row["uptime_sec"] for row in rows], first)


def test_any_other_number_is_shown_under_its_own_name(drawn: Drawn, decoded: Any) -> None:
    found, first = decoded
    sent = found["ParamGet"]
    for node in {row["src"] for row in sent}:
        rows = [row for row in sent if row["src"] == node]
        for column in ("esc_uuid", "esc_timing", "esc_startup_times", "esc_led_mode.frequency"):
            same(drawn, f"/messages/ParamGet/{column}/node{node}", rows, [row[column] for row in rows], first)


def test_nothing_is_shown_twice_or_left_out(drawn: Drawn) -> None:
    """Every number of a report stands in exactly one place."""
    own = drawn.under("/messages/ESCStatus")
    assert own == []
    generic = {path.split("/")[3] for path in drawn.under("/messages/PUSHCAN.MotorStatus")}
    assert generic == {"power_on_count", "motor_status"}
    assert {path.split("/")[2] for path in drawn.under("/messages/")} >= {"ParamGet", "PUSHCAN", "PUSHCAN.MotorStatus"}


def test_every_series_has_a_name_and_a_device_its_colour(drawn: Drawn) -> None:
    styles = {path: parts for path, parts in drawn.static.items() if "SeriesLines:names" in parts}
    assert {path for path in drawn.rows if "Scalars:scalars" in drawn.rows[path][0][1]} <= {*styles, *drawn.static}
    colours = {
        index: {tuple(styles[f"/{name}/esc{index}"]["SeriesLines:colors"]) for name in ("voltage", "power", "speed")}
        for index in range(1, 5)
    }
    assert all(len(found) == 1 for found in colours.values())
    assert len({min(found) for found in colours.values()}) == 4


@pytest.mark.slow
def test_where_batches_end_does_not_matter(text: str) -> None:
    whole, picture = draw(text)
    for size in (1 << 15, 7777):
        cut, other = draw(text, size=size)
        assert other.inventory.series.keys() == picture.inventory.series.keys()
        assert cut.static == whole.static
        for path, rows in whole.rows.items():
            assert by_place(cut.rows[path]) == by_place(rows), path
        assert {p: one.count for p, one in other.inventory.series.items()} == {
            p: one.count for p, one in picture.inventory.series.items()
        }


def by_place(rows: list[Any]) -> list[Any]:
    return sorted(rows, key=lambda row: (row[0].get("frame", 0), str(row)))


@pytest.mark.slow
def test_a_capture_without_times_has_frames_only(text: str) -> None:
    plain = "".join(f"{line.partition(') ')[2]}\n" for line in text.splitlines())
    drawn, _ = draw(plain)
    assert {tuple(times) for rows in drawn.rows.values() for times, _ in rows} == {("frame",)}
    assert len(drawn.rows["/voltage/esc1"]) == len(draw(text)[0].rows["/voltage/esc1"])
    assert "/bus_load/can0" not in drawn.rows
    assert "/energy/esc1" not in drawn.rows


def test_a_capture_with_relative_times_has_no_dates(text: str) -> None:
    lines = []
    for line in text.splitlines():
        stamp, _, rest = line[1:].partition(") ")
        whole, _, digits = stamp.partition(".")
        lines.append(f"({int(whole) - START // 10**9:d}.{digits}) {rest}\n")
    drawn, _ = draw("".join(lines))
    assert {tuple(times) for times, _ in drawn.points("/voltage/esc1")} == {("since_start", "frame")}


@pytest.mark.slow
def test_a_broken_transfer_is_a_marker_and_no_point(text: str) -> None:
    lines = text.splitlines(keepends=True)
    found, first = tables(text)
    row = next(row for row in found["ESCStatus"] if row["esc_index"] == 1)
    lost = first[row["transfer"]]  # the frame behind its first
    node = f"{row['src']:02X}"
    victim = next(k for k in range(lost, len(lines)) if lines[k].split()[2].partition("#")[0].endswith(node))
    del lines[victim]
    drawn, _ = draw("".join(lines))
    assert len(drawn.rows["/voltage/esc2"]) == len(draw(text)[0].rows["/voltage/esc2"]) - 1
    broken = [point for path in drawn.under("/broken/") for point in drawn.points(path)]
    assert [(times["frame"], value) for times, value in broken] == [(lost, float(row["src"]))]


@pytest.mark.slow
def test_two_nodes_with_one_number_stay_apart(text: str) -> None:
    """The first one has the plain name, the other one is named beside it."""
    found, _ = tables(text)
    node = next(row["src"] for row in found["ESCStatus"] if row["esc_index"] == 0)
    lines = []
    for line in text.splitlines(keepends=True):
        lines.append(line)
        if line.split()[2].partition("#")[0].endswith(f"{node:02X}"):
            lines.append(re.sub(r"(\w{6})\w\w#", r"\g<1>7E#", line))
    drawn, picture = draw("".join(lines))
    assert (
        drawn.values("/voltage/esc1_node126") == drawn.values("/voltage/esc1") == draw(text)[0].values("/voltage/esc1")
    )
    assert picture.inventory.series["/voltage/esc1_node126"].title == "ESC 1 (node 126)"
    assert drawn.values("/uptime/node126") == drawn.values(f"/uptime/node{node}")


@pytest.mark.slow
def test_a_second_bus_is_named(text: str) -> None:
    """ESC 1 of a second bus carries the name of the bus."""
    other = text.replace(" can0 ", " can1 ")
    both = sorted(text.splitlines(keepends=True) + other.splitlines(keepends=True), key=lambda line: line.split()[0])
    drawn, picture = draw("".join(both))
    assert drawn.values("/voltage/can1/esc1") == drawn.values("/voltage/esc1") != []
    assert picture.inventory.series["/voltage/can1/esc1"].title == "can1 ESC 1"
    assert {"/bus_load/can0", "/bus_load/can1"} <= drawn.rows.keys()


def test_devices_are_bounded(text: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """What comes after the last one that has room is counted."""
    monkeypatch.setattr(units, "MOST_UNITS", 3)
    monkeypatch.setattr(inventory, "MOST_SERIES", 20)
    drawn, picture = draw(text)
    assert len(picture.inventory.series) == 20
    assert picture.inventory.beyond > 0
    assert set(drawn.rows) <= set(picture.inventory.series)


def test_not_a_number_is_kept_as_it_was_sent(drawn: Drawn) -> None:
    assert not any(math.isnan(value) for value in drawn.values("/voltage/esc1"))


def test_without_times_there_is_no_sum() -> None:
    sums = Integrals()
    assert np.isnan(sums.add("a", np.full(3, NO_TIME), np.ones(3), 1.0)).all()
    assert sums.add("a", np.array([0, SECOND]), np.ones(2), 1.0).tolist() == [0.0, 1.0]
    assert sums.add("a", np.full(2, NO_TIME), np.ones(2), 1.0).tolist() == [1.0, 1.0]
