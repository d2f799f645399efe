"""Findings of values beyond a limit tell the first value and the worst one."""

from __future__ import annotations

import pytest
from kit.judged import judge, whole
from kit.traffic import TURNING, capture, motors
from kit.vendors import SPACE

HOT = {"input_voltage": 480, "current": 10}


def reports(*changed: dict[str, float]) -> str:
    return capture((20.0 * k, 12, "ESCStatus", TURNING | values) for k, values in enumerate(changed))


def temperatures(*degrees: int) -> str:
    return capture((20.0 * k, 12, f"{SPACE}StatusMsg2", HOT | {"temperature": t}) for k, t in enumerate(degrees))


@pytest.mark.parametrize(
    ("degrees", "text"),
    [
        ((104, 105, 138, 110), "temperature 105 degC at onset, 138 degC at worst, safe is below 105"),
        ((138, 105), "temperature 138 degC, safe is below 105"), ((110,), "temperature 110 degC, safe is below 105"),
        ((106, 90, 106), "temperature 106 degC, safe is below 105"),
    ],
)  # fmt: skip
def test_temperatures(degrees: tuple[int, ...], text: str) -> None:
    assert [one.text for one in whole(temperatures(*degrees), ("HW-001",))] == [text]


@pytest.mark.parametrize(
    ("rule", "text", "found"),
    [
        ("TYP-302", reports({"power_rating_pct": 101}, {"power_rating_pct": 120}), ["101 % at onset, 120 % at worst"]),
        ("TYP-308", reports({"voltage": 121}, {"voltage": -90}, {"voltage": 130}),
         ["voltage = 121.0 at onset, -90.0 at worst"]),
        ("TYP-308", reports({"voltage": 200, "current": 1100}, {"voltage": 300, "current": 1200}),
         ["current = 1100.0 at onset, 1200.0 at worst", "voltage = 200.0 at onset, 300.0 at worst"]),
        ("PUSH-402", motors({"position": 36_100}, {"position": 40_000}),
         ["361.00 degrees at onset, 400.00 degrees at worst"]),
        ("PUSH-403", motors({"pwm": 7000}, {"pwm": 5000}, {"pwm": 24_000}), ["700.0 us at onset, 500.0 us at worst"]),
        ("PUSH-404", motors({"throttle": 251}, {"throttle": 255}), ["100.4 % at onset, 102.0 % at worst"]),
        ("TYP-101", capture((20.0 * k, 1, "RawCommand", {"cmd": [5, low]}) for k, low in enumerate((-5, -900, -7))),
         ["ch2 = -5 at onset, -900 at worst"]),
        ("TYP-013", capture((20.0 * k, 12, f"{SPACE}StatusMsg2", HOT | {"temperature": 20, "input_voltage": low})
                            for k, low in enumerate((-1, -50))),
         ["input_voltage = -0.1 V at onset, -5 V at worst, at least 0 allowed"]),
    ],
)  # fmt: skip
def test_values_beyond_a_limit(rule: str, text: str, found: list[str]) -> None:
    assert sorted(one.text for one in judge(text, (rule,))) == found
    assert sorted(one.text for one in judge(text, (rule,), 4)) == found
