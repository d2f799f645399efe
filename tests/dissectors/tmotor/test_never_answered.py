"""BUS-044: queries that nobody ever answers."""

from __future__ import annotations

from typing import Any

import pytest
from kit.flight import Vehicle
from kit.judged import judge, whole
from kit.simulated import flight

RULE = ("BUS-044",)
QUERY, CONTROL, FEEDBACK, STATUS = (
    "PUSHSCI.FocQuery", "PUSHSCI.OutputControl", "PUSHCAN.FocFeedback", "PUSHCAN.MotorStatus",
)  # fmt: skip


def asked(
    packet: str = QUERY, unit: int = 0xFF, *, every: int = 1000, times: int = 6, answers: tuple[str, int] | None = None,
    nodes: tuple[int, ...] = (11, 12), until: int = 9000, start: int = 0, **values: Any,
) -> Vehicle:  # fmt: skip
    """ESCs that report each 100 ms, and a node that asks; the query of that number may be answered."""
    vehicle = Vehicle()
    for k in range(90):
        vehicle.send(k * 100 + 3, "RawCommand", 1, {"cmd": [0, 0]})
    for k, node in enumerate(nodes):
        vehicle.statuses(start + k, until, node, 100, **{key: values.pop(key) for key in ("mode",) if key in values})
    for k in range(times):
        vehicle.push(1000 + k * every, packet, 126, unit, **values)
        if answers is not None and answers[1] == k:
            vehicle.push(1040 + k * every, answers[0], 12, 0xA2)
    return vehicle


@pytest.mark.sampled(4)
@pytest.mark.parametrize(
    ("packet", "unit", "text"),
    [
        (QUERY, 0xFF, "all units for FOC parameters (0x1A) 6 times in 5.0 s: no answer, while 2 ESCs reported"),
        (QUERY, 0xA2, "unit 0xA2 for FOC parameters (0x1A) 6 times in 5.0 s: no answer, while 1 ESC reported"),
        (CONTROL, 0xA1, "unit 0xA1 for status (0x06, mode 00) 6 times in 5.0 s: no answer, while 1 ESC reported"),
    ],
)
def test_queries_without_any_answer(packet: str, unit: int, text: str) -> None:
    (one,) = whole(asked(packet, unit).finish(), RULE, (7,))
    assert (one.severity, one.node, one.type, one.text) == ("warning", 126, "PUSHSCI", f"node 126 asked {text}")


@pytest.mark.parametrize(
    "vehicle",
    [
        asked(answers=(FEEDBACK, 0)), asked(answers=(FEEDBACK, 5)), asked(CONTROL, 0xA1, answers=(STATUS, 3)),
        asked(times=2), asked(every=200), asked(nodes=()), asked(unit=0xA5), asked(until=1000), asked(start=7000),
        asked(CONTROL, 0xA1, control_mode=0x66), asked(mode=0, nodes=(11,)),
    ],
)  # fmt: skip
def test_what_is_answered_or_asks_nobody(vehicle: Vehicle) -> None:
    assert judge(vehicle.finish(), RULE) == []


def test_an_answer_of_another_kind_is_none() -> None:
    assert len(judge(asked(answers=(STATUS, 2)).finish(), RULE)) == 1


def test_a_damaged_answer_is_one() -> None:
    vehicle = asked(answers=(FEEDBACK, 2))
    sent = next(one for one in vehicle.sent if one.name == "PUSHCAN")
    lines = vehicle.finish().splitlines(keepends=True)
    del lines[sent.frames[3] - 1]
    assert judge("".join(lines), RULE) == []


@pytest.mark.slow
@pytest.mark.parametrize("plan", ["hover", "mission", "bench", "startup"])
def test_a_clean_flight_has_none(plan: str) -> None:
    assert judge(flight(flight=plan, seconds=20), RULE) == []


@pytest.mark.slow
def test_a_fault_is_found() -> None:
    assert [one.count for one in judge(flight("BUS-044", seconds=14), RULE)] == [1]
