"""A clean flight is clean: rules that join several types and nodes find nothing, for any plan and number of ESCs."""

from __future__ import annotations

from bisect import bisect_left, bisect_right
from itertools import pairwise
from statistics import median
from typing import Any

import pytest
from kit.simulated import FLIGHT_PLANS, Flown, end, flown, status_bits

from dissectors.times import MILLISECOND, SECOND

WAYS = [(plan, escs) for plan in FLIGHT_PLANS for escs in (1, 4, 8)] + [("hover", 2), ("mission", 3), ("bench", 5)]


@pytest.fixture(params=WAYS, ids=lambda way: f"{way[0]}-{way[1]}")
def flight(request: pytest.FixtureRequest) -> Flown:
    plan, escs = request.param
    return flown(9, flight=plan, escs=escs, seed=5)


@pytest.mark.sampled(6)
def test_every_node_says_that_it_is_well(flight: Flown) -> None:
    """BUS-020, BUS-021, BUS-022, BUS-010."""
    for node in {one.node for one in flight.sent if not one.anonymous}:
        status = flight.of("uavcan.protocol.NodeStatus", node)
        assert {(one.values["health"], one.values["mode"]) for one in status} == {(0, 0)}
        uptimes = [one.values["uptime_sec"] for one in status]
        assert uptimes == sorted(uptimes)
        own = [end(one) for one in flight.sent if one.node == node]
        times = [own[0], *map(end, status), flight.frames[-1].t]
        assert max(after - before for before, after in pairwise(times)) < 700 * MILLISECOND


@pytest.mark.sampled(10)
def test_commands_have_no_pause_and_one_source(flight: Flown) -> None:
    """BUS-006, BUS-007, BUS-023; TYP-101, TYP-102."""
    commands = flight.of("RawCommand")
    assert {one.node for one in commands} == {10}
    gaps = [end(after) - end(before) for before, after in pairwise(commands)]
    assert median(gaps) == pytest.approx(2_500_000, rel=0.01)
    assert max(gaps) < 5 * MILLISECOND
    assert all(0 <= value <= 8191 for one in commands for value in one.values["cmd"])


@pytest.mark.sampled(9)
def test_reports_have_no_pause_and_one_source(flight: Flown) -> None:
    """BUS-009, BUS-018, BUS-025, BUS-026, BUS-027."""
    assert {(one.node - 11, one.values["esc_index"]) for one in flight.of("ESCStatus")} == {
        (index, index) for index in range(len(flight.escs))
    }
    for node in flight.escs:
        times = [end(one) for one in flight.of("ESCStatus", node)]
        assert max(after - before for before, after in pairwise(times)) < 60 * MILLISECOND
        assert times[-1] > flight.frames[-1].t - 60 * MILLISECOND
    assert {len(one.values["cmd"]) for one in flight.of("RawCommand")} == {len(flight.escs)}


@pytest.mark.sampled(9)
def test_status_is_plausible_and_without_faults(flight: Flown) -> None:
    """TYP-302 to TYP-306, TYP-308, TYP-009."""
    for node in flight.escs:
        coarse = 0
        for one in flight.of("ESCStatus", node):
            bits, mode, encoder = status_bits(one)
            assert bits == 0
            assert mode in range(1, 9)
            assert mode != 6
            assert encoder < 16384
            values = one.values
            assert 30 < values["voltage"] < 52
            assert 0 < values["current"] < 100
            assert 15 < values["temperature"] < 100
            assert abs(values["rpm"]) < 5000
            assert 0 <= values["power_rating_pct"] <= 100
            coarse += values["voltage"] % 0.25 == 0
        assert coarse < 0.5 * len(flight.of("ESCStatus", node))


@pytest.mark.sampled(10)
def test_throttle_and_speed_agree(flight: Flown) -> None:
    """BUS-028: over 10 % for a second the motor turns; at zero for two seconds it stands, or is below 500 rpm."""
    commands = flight.of("RawCommand")
    times = [end(one) for one in commands]
    for node in flight.escs:
        channel = [one.values["cmd"][node - 11] for one in commands]
        for one in flight.of("ESCStatus", node):
            now = bisect_right(times, one.t)
            second = channel[bisect_left(times, one.t - SECOND) : now]
            if times[0] < one.t - SECOND and min(second) > 819:
                assert one.values["rpm"]
            two = channel[bisect_left(times, one.t - 2 * SECOND) : now]
            if times[0] < one.t - 2 * SECOND and not any(two):
                assert abs(one.values["rpm"]) <= 500


@pytest.mark.sampled(11)
def test_no_frame_looks_like_words_of_16_bits(flight: Flown) -> None:
    """TYP-105: one channel of several that is not zero could be mistaken for it."""
    for one in flight.of("RawCommand"):
        cmd = one.values["cmd"]
        assert len(cmd) != 4 or not cmd[0] or any(cmd[1:])


@pytest.mark.sampled(11)
def test_motor_status_stays_within_its_limits(flight: Flown) -> None:
    """PUSH-401 to PUSH-409, by status of up to 100 ms before or after."""
    for node in flight.escs:
        status = flight.of("ESCStatus", node)
        times = [one.t for one in status]
        last: dict[str, Any] = {"power_on_count": 0, "runtime": 0}
        for one, values in flight.packets("MotorStatus", node):
            assert values["system_status"] in {0x00, 0x11}
            assert values["position"] <= 36_000
            assert values["pwm"] == 0 or 10_400 <= values["pwm"] <= 19_400
            assert values["throttle"] <= 250
            assert values["temperature"] < 20_000
            assert abs(values["speed"]) < 32_767
            assert values["power_on_count"] >= last["power_on_count"]
            assert values["runtime"] >= last["runtime"]
            last = values
            near = min(status[max(0, bisect_left(times, one.t) - 1) :][:3], key=lambda row: abs(row.t - one.t))
            assert abs(near.t - one.t) < 100 * MILLISECOND
            assert values["voltage"] / 100 == pytest.approx(near.values["voltage"], rel=0.02)
            assert values["speed"] == pytest.approx(near.values["rpm"], rel=0.05)
            assert values["current"] / 100 == pytest.approx(near.values["current"], rel=0.1)


@pytest.mark.sampled(10)
def test_every_service_is_answered_at_once(flight: Flown) -> None:
    """TRF-021 to TRF-025."""
    requests = [one for one in flight.sent if one.message.kind == "request" and end(one) < flight.frames[-1].t - SECOND]
    responses = {
        (one.name.replace("Response", "Request"), one.dst, one.node, one.transfer_id): one
        for one in flight.sent
        if one.message.kind == "response"
    }
    assert {one.dst for one in requests} >= set(list(flight.escs)[:4])
    for one in requests:
        answer = responses[one.name, one.node, one.dst, one.transfer_id]
        assert end(one) < end(answer) < end(one) + 100 * MILLISECOND
        assert answer.priority == one.priority


@pytest.mark.sampled(3)
@pytest.mark.parametrize("plan", FLIGHT_PLANS)
def test_stock_escs_speak_standard_dronecan_alone(plan: str) -> None:
    """`error_count` counts, slowly and below what would read as an operating mode; temperatures are kelvin."""
    flight = flown(9, flight=plan, escs=3, stock=True)
    assert not {"PUSHCAN", "PUSHSCI", "ParamCfg", "ParamGet"} & {one.name for one in flight.sent}
    for node in flight.escs:
        counts = [one.values["error_count"] for one in flight.of("ESCStatus", node)]
        assert counts[0] == 0
        assert {after - before for before, after in pairwise(counts)} <= {0, 1}
        assert counts[-1] < 1 << 12
        assert all(280 < one.values["temperature"] < 400 for one in flight.of("ESCStatus", node))
    asked = flight.of("uavcan.protocol.param.GetSet.Request")
    assert {next(iter(one.values["value"])) for one in asked} == {"empty", "integer_value"}
    for one in flight.of("uavcan.protocol.param.GetSet.Response"):
        assert one.values["value"] == {"integer_value": 30}
