"""PUSH-306 and PUSH-307: what control packets ask, and what the motor shows."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest
from kit import encode
from kit.judged import judge, proved
from kit.simulated import flight
from kit.traffic import Planned, capture, motor

if TYPE_CHECKING:
    from collections.abc import Callable

RULES = ("PUSH-306", "PUSH-307")
STEPS = pytest.mark.parametrize("step", [None, 1, 7])


def order(at: float, mode: int, point: int = 0, unit: int = 0xA1) -> Planned:
    packet = encode.packet("PUSHSCI.OutputControl", 0, unit, control_mode=mode, set_point=point)
    return at, 126, "PUSHSCI", packet


def shown(
    values: Callable[[int], dict[str, int]], *, start: int = 100, stop: int = 8000, unit: int = 0xA1
) -> list[Planned]:
    """Status packets each 200 ms; `values` by ms."""
    still = {"speed": 0, "position": 0, "current": 0, "system_status": 0}
    return [(float(at), 11, "PUSHCAN", motor(0, unit, **(still | values(at)))) for at in range(start, stop, 200)]


def texts(*sent: Planned, step: int | None = None) -> list[tuple[str, str]]:
    found = judge(capture(sorted(sent, key=lambda one: one[0])), RULES, step)
    assert all((one.node, one.type, one.count) == (11, "PUSHCAN", 1) for one in found)
    return [(one.severity, one.text) for one in found]


BROKEN: list[tuple[int, int, dict[str, int], str, str]] = [
    (0x33, 3000, {"speed": 1210}, "warning", "3000 rpm asked, 1210 rpm reported"),
    (0x3A, 3000, {"speed": 0}, "warning", "3000 rpm asked, 0 rpm reported"),
    (0x33, 0, {"speed": 400}, "warning", "0 rpm asked, 400 rpm reported"),
    (0x44, 2000, {"current": 300}, "note", "20.0 A asked, 3.0 A reported"),
    (0x11, 900, {"position": 18_000}, "warning", "90.0 deg asked, 180.0 deg reported"),
    (0x11, 3595, {"position": 2000}, "warning", "359.5 deg asked, 20.0 deg reported"),
    (0x88, 0, {"system_status": 0}, "warning", "system status 0x00 instead of 0x11"),
]


@STEPS
@pytest.mark.parametrize(("mode", "point", "values", "severity", "told"), BROKEN)
def test_what_is_not_followed(
    mode: int, point: int, values: dict[str, int], severity: str, told: str, step: int | None
) -> None:
    found = texts(order(0, mode, point), *shown(lambda _: values), step=step)
    assert found == [(severity, f"unit 1, mode 0x{mode:02X}: {told}")]


def test_a_lock_that_slips() -> None:
    found = texts(order(0, 0x88), *shown(lambda at: {"system_status": 0x11, "position": at * 2, "speed": 3}))
    assert found == [("warning", "unit 1, mode 0x88: system status 0x11, but the rotor moved 12 deg at 3 rpm")]


FOLLOWED: list[tuple[int, int, dict[str, int]]] = [
    (0x33, 3000, {"speed": 2560}), (0x33, 3000, {"speed": -3000}), (0x33, 300, {"speed": 160}),
    (0x3A, 3000, {"speed": 3000}), (0x44, 2000, {"current": 1450}), (0x4A, 100, {"current": -350}),
    (0x11, 900, {"position": 9900}), (0x11, 3595, {"position": 300}), (0x1A, 900, {"position": 27_000}),
    (0x1A, 900, {"position": 9000}), (0x88, 0, {"system_status": 0x11, "position": 4000}),
    (0x00, 0, {"speed": 3000}), (0x55, 5000, {}), (0xEE, 0, {}), (0xBB, 1000, {}), (0x66, 0, {"speed": 900}),
]  # fmt: skip


@pytest.mark.parametrize(("mode", "point", "values"), FOLLOWED)
def test_what_is_followed_or_says_nothing(mode: int, point: int, values: dict[str, int]) -> None:
    assert texts(order(0, mode, point), *shown(lambda _: values)) == []


@STEPS
def test_what_has_a_reason(step: int | None) -> None:
    slow = shown(lambda _: {"speed": 500})
    assert texts(order(0, 0x33, 3000), *shown(lambda at: {"speed": min(at // 2, 3000)}), step=step) == []  # on its way
    assert texts(order(0, 0x33, 3000), order(3500, 0x00), *slow, step=step) == []
    assert texts(order(0, 0x33, 3000), *shown(lambda _: {}, stop=3900), step=step) == []  # not for long enough
    assert texts(order(0, 0x33, 3000), *shown(lambda _: {}, unit=0xA2), step=step) == []
    again = [order(float(at), 0x33, 1000 + at) for at in range(0, 8000, 1000)]
    assert texts(*again, *slow, step=step) == []
    flies = [(float(at), 1, "RawCommand", {"cmd": [2000]}) for at in range(5, 8000, 50)]
    assert texts(order(0, 0x33, 3000), *slow, *flies, step=step) == []  # throttle drives it
    rests = [(float(at), 1, "RawCommand", {"cmd": [0, 2000]}) for at in range(5, 8000, 50)]
    assert len(texts(order(0, 0x33, 3000), *slow, *rests, step=step)) == 1
    repeated = [order(float(at), 0x33, 3000) for at in range(0, 8000, 500)]
    assert len(texts(*repeated, *slow, step=step)) == 1


FAULTS = ("PUSH-306", "PUSH-306:mode=0x11:value=900", "PUSH-307", "PUSH-307:how=slips")


@pytest.mark.slow
@pytest.mark.parametrize("fault", FAULTS)
@pytest.mark.parametrize("plan", ["hover", "bench"])
def test_a_fault_is_found_where_the_witness_finds_it(fault: str, plan: str) -> None:
    said = proved(fault[:8], flight(fault, seconds=20, flight=plan))
    assert [(one.severity, one.count) for one in said] == [("warning", 1)]


@pytest.mark.slow
@pytest.mark.parametrize("escs", [1, 2, 4])
@pytest.mark.parametrize("seconds", [20, 60])
def test_a_clean_bench_has_none(escs: int, seconds: int) -> None:
    assert judge(flight(flight="bench", seconds=seconds, escs=escs), RULES) == []
