"""Restarts that an ESC's own counters prove."""

from __future__ import annotations

import pytest
from kit.flight import Vehicle, found, node_status

UNIT = 0xA1


def flying(*counts: int, period: float = 200) -> Vehicle:
    """Status packets of node 11 with these power-on counts."""
    vehicle = Vehicle()
    for k, count in enumerate(counts):
        vehicle.push(period * k, "PUSHCAN.MotorStatus", 11, UNIT, power_on_count=count, runtime=10 + k)
    return vehicle


@pytest.mark.parametrize(
    ("counts", "told"),
    [
        ((41, 41, 42, 42), ["power-on count 41, then 42"]),
        ((65535, 65535, 0, 0), ["power-on count 65535, then 0"]),
        ((41, 41, 42, 42, 42), ["power-on count 41, then 42"]),
        ((41, 41, 41), []),
        ((41, 40, 41, 41), []),  # PUSH-407 tells the first step
        ((41, 47, 47), []),  # nobody starts six times in 0.2 s
    ],
)
def test_a_power_on_count_that_rises(counts: tuple[int, ...], told: list[str]) -> None:
    said = found(flying(*counts), "BUS-037")
    assert [one.text for one in said] == told


@pytest.mark.parametrize(
    ("runtimes", "told"),
    [
        ((8120, 8120, 0, 0, 1), ["runtime 8120, then 0"]),
        ((8120, 8120, 8060, 8060), []),  # no restart: PUSH-407
        ((65535, 65535, 0, 0), []),  # a wrap
        ((1, 1, 0, 1), []),
    ],
)
def test_a_runtime_that_begins_at_zero(runtimes: tuple[int, ...], told: list[str]) -> None:
    vehicle = Vehicle()
    for k, runtime in enumerate(runtimes):
        vehicle.push(200 * k, "PUSHCAN.MotorStatus", 11, UNIT, power_on_count=0, runtime=runtime)
    assert [one.text for one in found(vehicle, "BUS-037")] == told


def test_parameters_tell_it_too_and_once() -> None:
    vehicle = flying(41, 41, 41, 41, 41, 42, 42, 42)
    vehicle.parameters(100, 11, esc_startup_times=41)
    vehicle.parameters(1500, 11, esc_startup_times=42)
    (one,) = found(vehicle, "BUS-037")
    assert (one.node, one.count, one.type) == (11, 1, "PUSHCAN")
    asked = Vehicle()
    asked.parameters(100, 11, esc_startup_times=41)
    asked.parameters(1500, 11, esc_startup_times=42)
    (one,) = found(asked, "BUS-037")
    assert (one.node, one.count, one.type) == (11, 1, "ParamGet")


@pytest.mark.parametrize(("fell", "count"), [(True, 0), (False, 1)])
def test_a_restart_that_the_uptime_tells_is_not_told_twice(fell: bool, count: int) -> None:
    vehicle = flying(*[41] * 5, *[42] * 20)
    for k in range(5):
        up = k - 1 if fell and k else 12 + k
        vehicle.send(1000 * k + 3, "uavcan.protocol.NodeStatus", 11, node_status(0, up))
    assert len(found(vehicle, "BUS-037")) == count


@pytest.mark.slow
def test_a_restart_is_no_dropout() -> None:
    for powered, count in ((42, 0), (41, 1)):
        vehicle = flying(*[41] * 10)
        vehicle.statuses(0, 2000, period=50)
        vehicle.statuses(3500, 8000, period=50)
        for k in range(20):
            vehicle.push(3550 + 200 * k, "PUSHCAN.MotorStatus", 11, UNIT, power_on_count=powered, runtime=20 + k)
        for k in range(80):
            vehicle.send(100 * k, "uavcan.protocol.NodeStatus", 1, node_status(100 * k))
        assert len(found(vehicle, "BUS-025")) == count
