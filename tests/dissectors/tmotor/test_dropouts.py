"""ESCs that stop reporting, and those that only report less often, or what nobody can read."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import pytest
from kit.flight import MS, START, Vehicle, found, node_status

if TYPE_CHECKING:
    from collections.abc import Callable

    from kit.encode import Frame, Transfer


def alive(vehicle: Vehicle, stop: float, node: int = 1, period: float = 1000) -> None:
    """All that a slow bus carries: another node that says it is alive."""
    for k in range(round(stop / period)):
        vehicle.send(k * period + 3, "uavcan.protocol.NodeStatus", node, node_status(k * period))


def unsent(vehicle: Vehicle, count: int, node: int = 11) -> None:
    """Transfers whose IDs are missing."""
    for _ in range(count):
        vehicle.count(("ESCStatus", node, None))


@pytest.mark.sampled(3)
@pytest.mark.parametrize("slow", [520, 1000, 2500])
def test_a_lower_rate_without_a_loss_is_no_dropout(slow: int) -> None:
    vehicle = Vehicle()
    alive(vehicle, 16_000, period=100)
    vehicle.statuses(0, 2000, period=100)
    vehicle.statuses(1900 + slow, 8000, period=slow)
    vehicle.statuses(8000, 10_000, period=100)
    vehicle.statuses(9900 + slow, 16_000, period=slow)
    assert found(vehicle, "BUS-025") == []


def test_a_lower_rate_that_the_end_of_the_capture_cuts_is_no_dropout() -> None:
    vehicle = Vehicle()
    vehicle.commands(0, 3500, 0)
    vehicle.statuses(0, 2000, period=100)
    vehicle.status(2900)
    assert found(vehicle, "BUS-025") == []


@pytest.mark.parametrize("lost", [9, 40])
def test_reports_that_were_lost_are_a_dropout(lost: int) -> None:
    vehicle = Vehicle()
    alive(vehicle, 8000, period=100)
    vehicle.statuses(0, 2000, period=100)
    unsent(vehicle, lost)
    vehicle.statuses(2900, 8000, period=1000)
    (one,) = found(vehicle, "BUS-025")
    assert (one.node, one.count, one.text) == (11, 1, "index 0 silent for 1000 ms, period 100 ms")


def test_a_break_at_the_rate_from_before_is_a_dropout() -> None:
    vehicle = Vehicle()
    alive(vehicle, 8000, period=100)
    vehicle.statuses(0, 2000, period=100)
    vehicle.statuses(2900, 8000, period=100)
    (one,) = found(vehicle, "BUS-025")
    assert one.text == "index 0 silent for 1000 ms, period 100 ms"


def test_an_esc_that_comes_back_for_one_report_is_silent_twice() -> None:
    vehicle = Vehicle()
    alive(vehicle, 20_000, period=100)
    vehicle.statuses(0, 2000, period=100)
    vehicle.status(3000)
    (one,) = found(vehicle, "BUS-025")
    assert (one.count, len(one.frames)) == (2, 2)


@pytest.mark.parametrize("reports", [3, 4, 7])
def test_an_esc_that_dies_after_few_reports_on_a_slow_bus(reports: int) -> None:
    vehicle = Vehicle()
    alive(vehicle, 20_000)
    sent = [vehicle.status(1000 * k) for k in range(reports)]
    (one,) = found(vehicle, "BUS-025")
    assert one.frames == (sent[-1].frames[0],)


@pytest.mark.parametrize("end", [5100, 6900])
def test_the_end_of_the_capture_is_no_dropout(end: int) -> None:
    """Five periods of 1 s have to pass."""
    vehicle = Vehicle()
    alive(vehicle, end, period=100)
    vehicle.statuses(0, 3000, period=1000)
    assert found(vehicle, "BUS-025") == []


@pytest.mark.slow
def test_a_fast_esc_on_a_bus_that_only_a_slow_node_keeps_awake() -> None:
    vehicle = Vehicle()
    alive(vehicle, 15_000)
    vehicle.statuses(0, 3000, period=20)
    (one,) = found(vehicle, "BUS-025")
    assert one.count == 1


def wrong_crc(one: Transfer) -> list[Frame]:
    return replace(one, signature=1).frames()


def too_short(one: Transfer) -> list[Frame]:
    return replace(one, payload=one.payload[:-3]).frames()


def no_start(one: Transfer) -> list[Frame]:
    return one.frames()[1:]


def no_end(one: Transfer) -> list[Frame]:
    return one.frames()[:-1]


def damaged(vehicle: Vehicle, start: int, stop: int, damage: Callable[[Transfer], list[Frame]], period: int) -> None:
    """Reports of node 11 that nobody can read."""
    for ms in range(start, stop, period):
        one = replace(Vehicle().status(ms).transfer, transfer_id=vehicle.count(("ESCStatus", 11, None)) % 32)
        vehicle.bus.send(START + ms * MS, damage(one))


@pytest.mark.sampled(8)
@pytest.mark.parametrize("period", [500, 20])
@pytest.mark.parametrize("damage", [wrong_crc, too_short, no_start, no_end])
def test_an_esc_whose_reports_nobody_can_read_is_not_silent(
    damage: Callable[[Transfer], list[Frame]], period: int
) -> None:
    vehicle = Vehicle()
    alive(vehicle, 16_000, period=100)
    vehicle.statuses(0, 4000, period=period)
    damaged(vehicle, 4000, 12_000, damage, period)
    vehicle.statuses(12_000, 16_000, period=period)
    assert found(vehicle, "BUS-025") == []


@pytest.mark.slow
@pytest.mark.parametrize("damage", [wrong_crc, no_end])
def test_an_esc_that_falls_silent_after_that_is_silent_from_then_on(damage: Callable[[Transfer], list[Frame]]) -> None:
    vehicle = Vehicle()
    alive(vehicle, 10_000, period=100)
    vehicle.statuses(0, 2000)
    damaged(vehicle, 2000, 6000, damage, 20)
    (one,) = found(vehicle, "BUS-025")
    assert (one.count, one.text[:21]) == (1, "index 0 silent for 39")


@pytest.mark.slow
def test_another_index_of_the_node_is_no_sign_of_life() -> None:
    vehicle = Vehicle()
    alive(vehicle, 4000, period=100)
    for k in range(200):
        for index in range(4):
            if index != 2 or k < 100:
                vehicle.status(20 * k + index, 11, esc_index=index)
    (one,) = found(vehicle, "BUS-025")
    assert one.text.startswith("index 2 silent for 2001 ms")
