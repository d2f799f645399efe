"""What a whole flight must show if the vehicle is a vehicle: power, speed, heat and modes that belong together."""

from __future__ import annotations

from bisect import bisect
from itertools import pairwise
from statistics import correlation, mean

import pytest
from kit.simulated import FLIGHT_PLANS, Flown, flown, status_bits

from dissectors.times import MILLISECOND, SECOND

# 4.4.3: from one operating mode to the next; 6 is none of a healthy ESC's.
LEGAL = {(1, 2), (2, 3), (3, 4), (4, 5), (5, 2), (5, 3), (3, 5), (2, 4), (2, 5), (2, 7), (2, 8), (7, 5), (8, 5), (4, 2)}
STATUS = "ESCStatus"


@pytest.fixture(scope="module")
def flight() -> Flown:
    return flown(30, flight="mission", escs=6)


@pytest.fixture(scope="module")
def bench() -> Flown:
    return flown(40, flight="bench", escs=3)


@pytest.mark.slow
def test_the_voltage_sags_for_all_when_current_flows(flight: Flown) -> None:
    rows = [one.values for one in flight.of(STATUS)]
    groups = [rows[at : at + 6] for at in range(0, len(rows) - 6, 6)]
    current = [sum(row["current"] for row in group) for group in groups]
    voltage = [mean(row["voltage"] for row in group) for group in groups]
    assert correlation(current, voltage) < -0.9
    assert max(voltage) - min(voltage) > 1
    for group in groups[150:]:  # five seconds: spinning up is too sudden for a row of reports
        spread = [row["voltage"] for row in group]
        assert max(spread) - min(spread) < 0.8


@pytest.mark.slow
def test_speed_follows_the_throttle(flight: Flown) -> None:
    commands = flight.of("RawCommand")
    times = [one.t + 20 * MILLISECOND for one in commands]
    for node in flight.escs:
        reports = [one for one in flight.of(STATUS, node) if 4 * SECOND < one.t < 22 * SECOND]
        speeds = [abs(one.values["rpm"]) for one in reports]
        throttles = [commands[bisect(times, one.t) - 1].values["cmd"][node - 11] for one in reports]
        assert correlation(throttles, speeds) > 0.8
        assert 1500 < mean(speeds) < 3500
        assert max(speeds) < 4500


def test_neighbours_turn_against_each_other(flight: Flown) -> None:
    for node in flight.escs:
        signs = {one.values["rpm"] > 0 for one in flight.of(STATUS, node) if one.values["rpm"]}
        assert signs == {node % 2 == 1}


def test_charge_only_leaves_the_pack_and_heat_stays_for_a_while(flight: Flown) -> None:
    assert 0.5 < flight.vehicle.pack.charge < 0.99
    resting = [one.values["voltage"] for one in flight.of(STATUS) if one.values["current"] < 0.2]
    assert mean(resting[:20]) > mean(resting[-20:]) + 0.1
    for node in flight.escs:
        temperatures = [one.values["temperature"] for one in flight.of(STATUS, node)]
        thirds = [mean(temperatures[at * 300 : at * 300 + 300]) for at in range(3)]
        assert thirds[0] + 1 < thirds[1] < thirds[2] < 80


def test_the_flight_ends_on_the_ground(flight: Flown) -> None:
    airframe = flight.vehicle.plan.airframe
    assert airframe.height == 0
    for node in flight.escs:
        last = flight.of(STATUS, node)[-1]
        assert last.values["rpm"] == 0
        assert status_bits(last)[1] == 2


@pytest.mark.sampled(4)
@pytest.mark.parametrize("plan", FLIGHT_PLANS)
def test_operating_modes_come_in_a_legal_order(plan: str, bench: Flown) -> None:
    one = bench if plan == "bench" else flown(8, flight=plan)
    for node in one.escs:
        modes = [status_bits(row)[1] for row in one.of(STATUS, node)]
        assert {(a, b) for a, b in pairwise(modes) if a != b} <= LEGAL
        assert modes[0] in {1, 2}
        if plan in {"hover", "mission"}:
            assert set(modes) >= {1, 2, 3, 4}
        assert plan != "startup" or set(modes) == {1, 2}


def test_the_bench_shows_every_mode_but_error(bench: Flown) -> None:
    assert {status_bits(row)[1] for row in bench.of(STATUS)} == {1, 2, 3, 4, 5, 7, 8}
    assert {values["control_mode"] for _, values in bench.packets("OutputControl")} == {
        *(0x00, 0xEE, 0x22, 0x88, 0x66, 0x55, 0x5A, 0x44, 0x4A, 0x33, 0x3A, 0x11, 0x1A, 0xBB)
    }
    locked = [one for one, values in bench.packets("MotorStatus") if values["system_status"] == 0x11]
    assert locked
    fold = [row.values["rpm"] * (1 if row.node % 2 else -1) for row in bench.of(STATUS) if status_bits(row)[1] == 7]
    assert len(fold) > 5
    assert fold[-1] == pytest.approx(90, abs=6)


def test_every_motor_has_its_turn_on_the_bench(bench: Flown) -> None:
    for node in bench.escs:
        powers = {row.values["power_rating_pct"] for row in bench.of(STATUS, node)}
        assert powers >= {0, 6, 15, 30, 45, 60}


@pytest.mark.parametrize("plan", ["bench", "hover"])
def test_the_encoder_turns_as_fast_as_the_motor(plan: str, bench: Flown) -> None:
    """While it turns less than half round between two reports, and nobody zeroes it."""
    one, checked = bench if plan == "bench" else flown(8, flight=plan), 0
    for node in one.escs:
        for before, after in pairwise(one.of(STATUS, node)):
            speeds, gap = (before.values["rpm"], after.values["rpm"]), (after.t - before.t) / SECOND
            steady = abs(speeds[0] - speeds[1]) < 8
            if before.t > 4 * SECOND and steady and 0 < abs(mean(speeds)) * 6 * gap < 170:
                turned = (status_bits(after)[2] - status_bits(before)[2]) * 360 / 16384
                assert (turned - mean(speeds) * 6 * gap + 180) % 360 - 180 == pytest.approx(0, abs=3)
                checked += 1
    assert checked > 100 or plan == "hover"


@pytest.mark.sampled(3)
@pytest.mark.parametrize("plan", FLIGHT_PLANS)
def test_both_reports_of_an_esc_say_the_same(plan: str) -> None:
    """PUSH-409, BUS-032: MotorStatus and the ESCStatus of the same instant."""
    one = flown(8, flight=plan, escs=4)
    status = {(row.node, row.t): row for row in one.of(STATUS)}
    found = 0
    for row, values in one.packets("MotorStatus"):
        other = status[row.node, row.t]
        bits, mode, encoder = status_bits(other)
        assert values["voltage"] / 100 == pytest.approx(other.values["voltage"], abs=1e-9)
        assert values["current"] / 100 == pytest.approx(other.values["current"], abs=1e-9)
        assert values["temperature"] / 100 == pytest.approx(other.values["temperature"], abs=1e-9)
        assert values["speed"] == other.values["rpm"]
        assert values["fault"] == bits == 0
        assert values["position"] / 100 == pytest.approx(encoder * 360 / 16384, abs=0.011)
        assert values["throttle"] * 0.4 == pytest.approx(other.values["power_rating_pct"], abs=0.71)
        assert values["pwm"] == 0 if mode == 1 else 10_400 <= values["pwm"] <= 19_400
        found += 1
    assert found > 40
