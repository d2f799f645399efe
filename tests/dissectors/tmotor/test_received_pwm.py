"""BUS-043: the PWM width that an ESC receives against throttle that is commanded."""

from __future__ import annotations

from typing import Any

import pytest
from kit import encode
from kit.judged import judge, whole
from kit.simulated import flight
from kit.traffic import TURNING, Planned, capture, motor

RULE = ("BUS-043",)
FULL = 8191
PART = round(0.37 * FULL)
TEN = 11_300  # 0.1 us


def width(throttle: int, zero: int = 10_400) -> int:
    return zero + round(9000 * throttle / FULL)


def flown(
    pwm: Any = TEN, cmd: Any = PART, seconds: float = 10, *, until: float = 1e9, node: int = 12, unit: int = 0xA2,
    status: bool = True, others: tuple[Planned, ...] = (), **values: int,
) -> str:  # fmt: skip
    """Commands for two channels each 20 ms, packets and reports of the second ESC each 100 ms; both may be courses."""
    sent: list[Planned] = list(others)
    for at in range(0, int(seconds * 1000), 20):
        throttle = cmd(at) if callable(cmd) else cmd
        if at < until:
            sent.append((float(at), 1, "RawCommand", {"cmd": [500, throttle]}))
        if at % 100 == 0:
            if status:
                word = {"error_count": 4 << 12, "power_rating_pct": 37, "esc_index": 1}
                sent.append((at + 3.0, node, "ESCStatus", TURNING | word))
            shown = pwm(at) if callable(pwm) else pwm
            packet = motor(at // 100, unit, **({"pwm": shown, "throttle": 92} | values))
            sent.append((at + 5.0, node, "PUSHCAN", packet))
    return capture(sorted(sent, key=lambda one: one[0]))


def control(mode: int, unit: int = 0xA2) -> Planned:
    return (1.0, 126, "PUSHSCI", encode.packet("PUSHSCI.OutputControl", 0, unit, control_mode=mode, set_point=900))


def answer(priority: int) -> Planned:
    said = {"hardware_version": b"1", "software_version": b"2", "throttle_priority": priority}
    return (7.0, 12, "PUSHCAN", encode.packet("PUSHCAN.FocFeedback", 200, 0xA2, **said))


@pytest.mark.parametrize("status", [True, False])
def test_ten_percent_instead_of_37(status: bool) -> None:
    (one,) = whole(flown(status=status), RULE, (7,))
    assert (one.severity, one.node, one.type, one.count) == ("warning", 12, "PUSHCAN", 1)
    assert one.text == "ch2 at 37 %, PWM 1130.0 us is 10 % (51 packets in 5.0 s and on)"


@pytest.mark.sampled(4)
@pytest.mark.parametrize(
    ("pwm", "cmd", "count"),
    [
        (lambda at: width(PART) if at < 4000 else 10_400, PART, 1),  # it followed before: rest is told, too
        (lambda at: width(PART) if at < 6000 else 10_400, PART, 0),
        (lambda at: width(at // 3) if at < 4000 else TEN, lambda at: at // 3 if at < 4000 else 4000, 1),
        (lambda at: TEN + at % 1000, PART, 1),
        (lambda at: 18_000 + at % 1000, lambda at: PART if at < 3000 else 1000, 1),  # a step proves nothing
        (lambda at: 18_000 + at % 1000, lambda at: PART if abs(at - 5000) > 1000 else 4000 * (at % 400 < 200), 0),
        (width(PART), PART, 0), (width(PART, 10_500), PART, 0), (width(PART + 1000), PART, 0),
        (lambda at: width(at % 5000), lambda at: at % 5000, 0),
        (lambda at: 10_000 + round(10_000 * (at % 8000) / FULL), lambda at: at % 8000, 0),  # a wire with its own scale
    ],
)  # fmt: skip
def test_courses(pwm: Any, cmd: Any, count: int) -> None:
    assert len(whole(flown(pwm, cmd, 10), RULE, (7,))) == count


@pytest.mark.parametrize("pwm", [0, 10_000, 10_400, 10_500, 11_000, 15_000, 0xFFFF, 5000, 23_000])
def test_an_input_that_nobody_drives(pwm: int) -> None:
    assert judge(flown(pwm), RULE) == []


@pytest.mark.parametrize(
    "text",
    [
        flown(seconds=4.9), flown(until=1000), flown(cmd=-PART), flown(cmd=0), flown(fault=1 << 3),
        flown(cmd=lambda at: PART + 1500 * (at // 100 % 2)),  # throttle that changes quickly
        flown(TEN, lambda at: 2000 + at // 5),  # stands, whatever the throttle
        flown(lambda at: TEN if at % 4000 else width(PART)),
        flown(others=(control(0x33),)), flown(others=(control(0x33, 0xFF),)), flown(others=(answer(0),)),
        flown(others=((2.0, 12, "PUSHCAN", motor(7, 0xA3)),)),
        flown(others=((2.0, 13, "PUSHCAN", motor(7, 0xA2)),), status=False),
        flown(unit=0xA4, status=False),
    ],
)  # fmt: skip
def test_what_has_another_reason(text: str) -> None:
    assert judge(text, RULE) == []


@pytest.mark.parametrize("other", [control(0x00), control(0x33, 0xA1), answer(1)])
def test_what_excuses_nothing(other: Planned) -> None:
    assert len(judge(flown(others=(other,)), RULE)) == 1


@pytest.mark.slow
@pytest.mark.parametrize("plan", ["hover", "mission", "bench"])
def test_a_clean_flight_has_none(plan: str) -> None:
    assert judge(flight(flight=plan, seconds=20), RULE) == []


@pytest.mark.slow
def test_a_fault_is_found() -> None:
    assert [one.count for one in judge(flight("BUS-043@3", seconds=14), RULE)] == [1]
