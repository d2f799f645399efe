"""BUS-040: throttle that is reported against throttle that is commanded."""

from __future__ import annotations

import pytest
from kit.judged import judge
from kit.simulated import flight
from kit.traffic import TURNING, Planned, capture

RULE = ("BUS-040",)
STEPS = pytest.mark.parametrize("step", [None, 7])
FULL = 8191


def flown(
    cmd: int, pct: int, seconds: float = 10, *, mode: int = 4, bits: int = 0, every: int = 20, until: float = 1e9
) -> str:
    """Commands for two channels each 20 ms, and the second ESC's reports each 100 ms."""
    sent: list[Planned] = []
    for at in range(0, int(seconds * 1000), every):
        if at < until:
            sent.append((float(at), 1, "RawCommand", {"cmd": [500, cmd]}))
        if at % 100 < every:
            word = {"error_count": mode << 12 | bits, "power_rating_pct": pct, "esc_index": 1}
            sent.append((at + 5.0, 12, "ESCStatus", TURNING | word))
    return capture(sent)


@STEPS
def test_ten_percent_instead_of_37(step: int | None) -> None:
    (one,) = judge(flown(round(0.37 * FULL), 10), RULE, step)
    assert (one.severity, one.node, one.type, one.count) == ("warning", 12, "ESCStatus", 1)
    assert one.text == "ch2 at 37 %, reports 10 % (51 reports in 5.0 s and on)"


@pytest.mark.parametrize(
    "text",
    [
        flown(round(0.37 * FULL), 37), flown(round(0.37 * FULL), 23), flown(round(0.37 * FULL), 50),
        flown(3000, 10, 4.9), flown(3000, 10, mode=6), flown(3000, 10, mode=3), flown(3000, 10, bits=1 << 6),
        flown(-3000, 10), flown(3000, 10, until=1000),
    ],
)  # fmt: skip
def test_what_is_near_enough_or_has_another_reason(text: str) -> None:
    assert judge(text, RULE) == []


def test_one_right_report_in_between_begins_anew() -> None:
    sent: list[Planned] = []
    for at in range(0, 9000, 20):
        sent.append((float(at), 1, "RawCommand", {"cmd": [3000]}))
        if at % 100 == 0:
            word = {"error_count": 4 << 12, "power_rating_pct": 37 if at == 4500 else 10, "esc_index": 0}
            sent.append((at + 5.0, 12, "ESCStatus", TURNING | word))
    assert judge(capture(sent), RULE) == []


@pytest.mark.slow
@pytest.mark.parametrize("plan", ["hover", "mission", "bench"])
def test_a_clean_flight_has_none(plan: str) -> None:
    assert judge(flight(flight=plan, seconds=20), RULE) == []


@pytest.mark.slow
def test_a_fault_is_found() -> None:
    assert [one.count for one in judge(flight("BUS-040@3", seconds=14), RULE)] == [1]
