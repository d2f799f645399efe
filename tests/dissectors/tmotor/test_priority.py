"""BUS-041: CAN throttle for an ESC that says it takes PWM first."""

from __future__ import annotations

import pytest
from kit import encode
from kit.judged import judge
from kit.simulated import flight
from kit.traffic import TURNING, Planned, capture

RULE = ("BUS-041",)
STEPS = pytest.mark.parametrize("step", [None, 1, 7])
NAMES = [field.partition(":")[0] for field in encode.TYPES["ParamGet"].layout.split()]
REPORT: Planned = (0.0, 12, "ESCStatus", TURNING | {"esc_index": 1})


def says(at: float, priority: int) -> Planned:
    return at, 12, "ParamGet", dict.fromkeys(NAMES, 0) | {"esc_index": 1, "esc_signal_priority": priority, "rsvd": []}


def feeds(at: float, priority: int) -> Planned:
    texts = {"hardware_version": b"H", "software_version": b"S"}
    return at, 12, "PUSHCAN", encode.packet("PUSHCAN.FocFeedback", 0, 0xA2, throttle_priority=priority, **texts)


def throttle(at: float, *cmd: int) -> Planned:
    return at, 1, "RawCommand", {"cmd": list(cmd)}


@STEPS
@pytest.mark.parametrize("told", [says, feeds])
def test_throttle_for_an_esc_that_takes_pwm(told: type[object], step: int | None) -> None:
    found = judge(capture([REPORT, told(100, 0), throttle(200, 0, 3000), throttle(210, 0, 3100)]), RULE, step)  # type: ignore[call-arg,list-item]
    assert [(one.severity, one.node, one.count, one.text) for one in found] == [
        ("note", 1, 1, "ch2 = 3000, but node 12 takes PWM first")
    ]


@STEPS
def test_what_says_nothing(step: int | None) -> None:
    def count(*sent: Planned) -> int:
        return sum(one.count for one in judge(capture([REPORT, *sent]), RULE, step))

    assert count(says(100, 1), throttle(200, 0, 3000)) == 0
    assert count(says(100, 0), throttle(200, 3000, 0), throttle(210, 3000, -5), throttle(220, 3000)) == 0
    assert count(throttle(90, 0, 3000), says(100, 0)) == 0
    assert count(says(100, 0), says(150, 1), throttle(200, 0, 3000)) == 0
    late = (250.0, *REPORT[1:])
    assert sum(one.count for one in judge(capture([says(100, 0), throttle(200, 0, 3000), late]), RULE, step)) == 0
    assert count(says(100, 0), throttle(150, 0, 5), says(160, 1), says(170, 0), throttle(200, 0, 3000)) == 2


@pytest.mark.slow
def test_a_clean_flight_has_none() -> None:
    assert judge(flight(seconds=8), RULE) == []


@pytest.mark.slow
def test_a_simulated_esc_that_takes_pwm_first() -> None:
    (one,) = judge(flight("BUS-041@4:node=13", seconds=6), RULE)
    assert (one.severity, one.count, one.text.partition("=")[2].partition(",")[2]) == (
        "note", 1, " but node 13 takes PWM first",
    )  # fmt: skip
