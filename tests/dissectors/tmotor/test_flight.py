"""A whole vehicle in flight: a pack that breaks down, and a recording that ends with motors turning."""

from __future__ import annotations

import pytest
from kit import CAPTURES
from kit.flight import Vehicle, found
from kit.judged import judge, registry
from kit.simulated import flight

import analyzer
from analyzer.app.criteria import Criteria
from analyzer.app.judged import JudgedRun
from analyzer.app.request import Request, RuleChoice
from analyzer.app.run import Run
from analyzer.report import headline
from analyzer.window.limits import Moment, Window

LOW = 1 << 1


def sagging(*, rpm: int = 3000, low: tuple[int, ...] = (11, 12, 13), again: bool = False, **more: int) -> Vehicle:
    """Three ESCs for 0.3 s; those that are `low` report under-voltage from 100 to 200 ms, and from 250 ms `again`."""
    vehicle = Vehicle()
    vehicle.commands(0, 300, *([2000 if rpm else 0] * 3))
    for k, node in enumerate((11, 12, 13)):
        vehicle.statuses(k, 100 + k, node, rpm=rpm, **more)
        bits = LOW if node in low else 0
        vehicle.statuses(100 + k, 200 + k, node, rpm=rpm, bits=bits, voltage=41.0, **more)
        vehicle.statuses(200 + k, 260 + k, node, rpm=rpm, **more)
        vehicle.statuses(260 + k, 300 + k, node, rpm=rpm, bits=bits * again, **more)
    return vehicle


def test_every_esc_reports_under_voltage() -> None:
    (one,) = found(sagging(), "BUS-036")
    assert (one.severity, one.node, one.count, one.text) == ("error", 13, 1, "3 ESCs, 41.0 V")


def test_an_episode_is_told_once_and_the_next_one_again() -> None:
    assert [one.count for one in found(sagging(again=True), "BUS-036")] == [2]


@pytest.mark.parametrize(
    "vehicle",
    [
        pytest.param(lambda: sagging(low=(11, 12)), id="one is well"),
        pytest.param(lambda: sagging(rpm=0), id="at rest"),
    ],
)
def test_what_is_no_pack_that_breaks_down(vehicle: object) -> None:
    assert found(vehicle(), "BUS-036") == []


def test_stock_escs_count_errors_in_that_bit() -> None:
    readings = {node: ["dronecan"] for node in (11, 12, 13)}
    assert found(sagging(), "BUS-036", dialects=readings) == []


def test_one_esc_alone_may_have_a_loose_plug() -> None:
    vehicle = Vehicle()
    vehicle.commands(0, 300, 2000)
    vehicle.statuses(0, 300, rpm=3000, bits=LOW)
    assert found(vehicle, "BUS-036") == []


def test_motors_that_begin_to_turn_on_a_pack_that_is_low_already() -> None:
    vehicle = Vehicle()
    for node in (11, 12):
        vehicle.statuses(node, 100, node, bits=LOW)
        vehicle.statuses(100 + node, 200, node, rpm=800, bits=LOW)
    assert [one.count for one in found(vehicle, "BUS-036")] == [1]


def ending(*, throttle: int = 2000, rpm: int = 3000, reports: int = 1500, rest: int = 0) -> Vehicle:
    """1.5 s with one ESC, which reports for so many ms; `rest` ms more with throttle 0 and a motor that stands."""
    vehicle = Vehicle()
    vehicle.commands(0, 1500, throttle)
    vehicle.statuses(5, reports, rpm=rpm)
    vehicle.commands(1500, 1500 + rest, 0)
    vehicle.statuses(1505, 1500 + rest, rpm=0)
    return vehicle


def test_a_recording_that_ends_with_motors_turning() -> None:
    (one,) = found(ending(), "CAP-005")
    assert (one.severity, one.node) == ("warning", -1)
    assert one.text == "1 ESC at up to 3000 rpm, throttle on 1 channel"


def test_a_motor_that_coasts_is_turning() -> None:
    (one,) = found(ending(throttle=0, rpm=-200), "CAP-005")
    assert one.text == "1 ESC at up to 200 rpm, throttle on 0 channels"


def test_an_esc_that_fell_silent_turned_before() -> None:
    assert found(ending(throttle=0, reports=400), "CAP-005") == []
    (one,) = found(ending(reports=400), "CAP-005")
    assert one.text == "no ESC told a speed, throttle on 1 channel"


def test_a_landing_is_no_end_in_flight() -> None:
    assert found(ending(rest=100), "CAP-005") == []
    assert found(ending(throttle=0, rpm=0), "CAP-005") == []


def test_a_window_says_nothing_of_the_end() -> None:

    def verdicts(window: Window) -> dict[str, str]:
        request = Request((str(CAPTURES / "hover-4.log"),), window=window)
        criteria = Criteria(RuleChoice(), registry())
        judged = JudgedRun(Run(request, registry=registry()), criteria)
        for _ in judged.batches(judged.run.inside()):
            pass
        return {one.rule: one.verdict for one in criteria.report([judged.taken("1")]).rules}

    assert verdicts(Window())["CAP-005"] == "WARN"
    assert verdicts(Window(start=Moment.parse("1")))["CAP-005"] == "WARN"
    assert verdicts(Window(stop=Moment.parse("3")))["CAP-005"] == "INCONCLUSIVE"
    assert verdicts(Window(frames=(1, 2000)))["CAP-005"] == "INCONCLUSIVE"


@pytest.mark.slow
def test_the_stories_of_the_repository() -> None:
    """What a tired person reads of five flights, and what CI gets."""
    told = {
        name: (report.gate.exit_status, head.verdict, head.worst)
        for name in ("esc-failure.mcap", "command-loss.log", "pack-sag.log", "bus-break.log", "recording-ends.log")
        for report in [analyzer.check(CAPTURES / name)]
        for head in [headline.of(report)]
    }
    assert {name: (status, word) for name, (status, word, _) in told.items()} == {
        "esc-failure.mcap": (1, "FAIL"),
        "command-loss.log": (1, "FAIL"),
        "pack-sag.log": (1, "FAIL"),
        "bus-break.log": (1, "FAIL"),
        "recording-ends.log": (0, "PASS WITH WARNINGS"),
    }
    assert {name: worst.partition(" (")[0] for name, (_, _, worst) in told.items()} == {
        "esc-failure.mcap": "ch1 node 11: ESC in error mode",
        "command-loss.log": "node 10: Throttle commands stopped",
        "pack-sag.log": "ch2 node 12: Every ESC reports under-voltage in flight",
        "bus-break.log": "can0: Many error frames",
        "recording-ends.log": "can0: The recording ends with motors turning",
    }
    assert told["esc-failure.mcap"][2].endswith(" from 08:02:14.702 UTC to the end")


@pytest.mark.parametrize("rule", ["BUS-036", "CAP-005"])
def test_a_fault_of_the_simulator_is_found(rule: str) -> None:

    assert [one.rule for one in judge(flight(f"{rule}@2"), (rule,))] == [rule]
