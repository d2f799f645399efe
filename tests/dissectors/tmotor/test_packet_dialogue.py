"""PUSH-102, -103, -201, -304 and -409: what is asked and answered, and two displays of one motor."""

from __future__ import annotations

from typing import Any

import pytest
from kit import encode
from kit.judged import judge, proved, said
from kit.simulated import flight
from kit.traffic import TURNING, Planned, capture, motor

RULES = ("PUSH-102", "PUSH-103", "PUSH-201", "PUSH-304", "PUSH-409")
STEPS = pytest.mark.parametrize("step", [None, 1, 7])
SET = {"acceleration_limit": 400, "led": 0xFFFF, "throttle_priority": 1, "bus_rate": 0xFF, "report_rate": 50}
FED = {"acceleration_limit": 400, "led": 7, "throttle_priority": 1, "bus_rate": 2, "report_rate": 50}


def asked(at: float, name: str, unit: int = 0xA1, **values: int) -> Planned:
    return at, 126, "PUSHSCI", encode.packet(f"PUSHSCI.{name}", 0, unit, **values)


def fed(at: float, unit: int = 0xA1, node: int = 10, **values: Any) -> Planned:
    texts = {"hardware_version": b"H", "software_version": b"S"}
    return at, node, "PUSHCAN", encode.packet("PUSHCAN.FocFeedback", 0, unit, **(texts | FED | values))


def status(at: float, unit: int = 0xA1, node: int = 10) -> Planned:
    return at, node, "PUSHCAN", motor(0, unit)


def end(at: float) -> Planned:
    """Something at the end of the capture."""
    return at, 99, "ESCStatus", TURNING


@pytest.mark.slow
@pytest.mark.parametrize("rule", RULES)
def test_a_fault_is_found_where_the_witness_finds_it(rule: str) -> None:
    assert [one.count for one in proved(rule, flight(f"{rule}@4", seconds=10))] == [1]


@pytest.mark.slow
def test_a_clean_flight_has_none() -> None:
    assert judge(flight(seconds=20), RULES) == []


@pytest.mark.sampled(2)
@STEPS
@pytest.mark.parametrize(
    ("rule", "question", "answer", "limit"),
    [
        ("PUSH-102", "FocParameters", fed, 1000),
        ("PUSH-201", "FocQuery", fed, 1000),
        ("PUSH-304", "OutputControl", status, 200),
    ],
)
def test_answers_in_time(rule: str, question: str, answer: Any, limit: int, step: int | None) -> None:
    def silent(*answers: Planned, until: float = 9000) -> int:
        return len(said(rule, capture([asked(50, question), *answers, end(until)]), step))

    assert silent(answer(50 + limit)) == 0
    assert silent(answer(51 + limit)) == 1
    assert silent(answer(60, 0xA2)) == 1
    assert silent(until=50 + limit) == 1
    assert silent(until=40 + limit) == 0


def test_what_is_said_without_an_answer() -> None:
    text = capture([status(0), asked(50, "OutputControl", 0xA3), asked(60, "FocQuery", 0xA4), end(5000)])
    found = [(one.rule, one.severity, one.node, one.type, one.first, one.text) for one in judge(text, RULES)]
    assert found == [
        ("PUSH-304", "note", 126, "PUSHSCI", 6, "no status of unit 0xA3 within 200 ms"),
        ("PUSH-201", "note", 126, "PUSHSCI", 9, "no answer of unit 0xA4 within 1.0 s"),
    ]


@STEPS
def test_a_query_of_all_units_is_for_those_seen_before(step: int | None) -> None:
    """Unit 1 was silent for too long, 2 does not answer, 3 does, 4 comes later."""
    text = capture([
        status(0, 0xA1, 10), status(200, 0xA2, 11), status(3050, 0xA3, 12), asked(3100, "FocQuery", 0xFF),
        status(3150, 0xA4, 13), fed(3200, 0xA3, 12), end(9000),
    ])  # fmt: skip
    assert [one.text for one in said("PUSH-201", text, step)] == ["no answer of unit 0xA2 within 1.0 s"]


@STEPS
@pytest.mark.parametrize(
    ("values", "expected"),
    [
        ({}, []),
        ({"acceleration_limit": 390}, ["acceleration set to 400, fed back as 390"]),
        ({"led": 15, "bus_rate": 0}, []),  # left unchanged
        ({"throttle_priority": 0}, ["throttle priority set to 1, fed back as 0"]),
        ({"report_rate": 100}, ["report rate set to 50, fed back as 100"]),
    ],
)
def test_what_is_fed_back(values: dict[str, int], expected: list[str], step: int | None) -> None:
    text = capture([asked(0, "FocParameters", **SET), fed(500, **values), fed(600, report_rate=7), end(5000)])
    found = said("PUSH-103", text, step)
    assert [one.text for one in found] == expected
    assert all((one.node, one.type, one.count) == (10, "PUSHCAN", 1) for one in found)


@STEPS
@pytest.mark.parametrize(("index", "count"), [(None, 1), (0, 0), (0xFF, 0), (1, 1)])
def test_parameters_that_came_in_between(index: int | None, count: int, step: int | None) -> None:
    sending = [asked(0, "FocParameters", **SET), fed(500, report_rate=100), end(5000)]
    if index is not None:
        names = [field.partition(":")[0] for field in encode.TYPES["ParamCfg"].layout.split()]
        sending.insert(1, (250, 126, "ParamCfg", dict.fromkeys(names, 0) | {"esc_index": index}))
    assert len(said("PUSH-103", capture(sending), step)) == count


def test_a_late_feedback_is_not_compared() -> None:
    assert said("PUSH-103", capture([asked(0, "FocParameters", **SET), fed(1001, report_rate=100)])) == []


def displays(*statuses: tuple[float, dict[str, float]], at: float = 100, node: int = 10, **values: int) -> str:
    """A status packet among some ESCStatus, and what comes much later."""
    sending: list[Planned] = [(when, 10, "ESCStatus", TURNING | some) for when, some in statuses]
    sending.append((at, node, "PUSHCAN", motor(0, **values)))
    return capture([*sorted(sending, key=lambda one: one[0]), end(at + 5000)])


AROUND: list[tuple[float, dict[str, float]]] = [(60, {}), (140, {})]


@STEPS
@pytest.mark.parametrize(
    ("values", "expected"),
    [
        ({}, []),
        ({"voltage": 4940}, []),
        ({"voltage": 4960}, ["voltage 49.6, ESCStatus 48.5"]),
        ({"voltage": 4740}, ["voltage 47.4, ESCStatus 48.5"]),
        ({"speed": 3161}, []),
        ({"speed": 3162}, ["speed 3162.0, ESCStatus 3011.0"]),
        ({"current": 219}, []),  # the least tolerance is 1 A
        ({"current": 221}, ["current 2.2, ESCStatus 1.2"]),
    ],
)
def test_displays_that_differ(values: dict[str, int], expected: list[str], step: int | None) -> None:
    found = said("PUSH-409", displays(*AROUND, **values), step)
    assert [one.text for one in found] == expected
    assert all((one.node, one.type, one.count, one.first) == (10, "PUSHCAN", 1, 4) for one in found)


@STEPS
@pytest.mark.parametrize(
    ("statuses", "count"),
    [
        ([(60, {})], 0),
        ([(140, {})], 0),
        ([(0, {}), (200, {})], 1),
        ([(-1, {}), (200, {})], 0),
        ([(0, {}), (201, {})], 0),
        ([(60, {}), (140, {"rpm": 4000})], 0),  # the motor speeds up
        ([(20, {"rpm": 4000}), (60, {}), (140, {})], 0),  # it was there shortly before
        ([(60, {"rpm": 5000}), (140, {"rpm": 6000})], 1),
    ],
)
def test_what_is_compared(statuses: list[tuple[float, dict[str, float]]], count: int, step: int | None) -> None:
    assert len(said("PUSH-409", displays(*statuses, speed=4000), step)) == count


def test_other_nodes_and_the_end_of_a_capture() -> None:
    assert said("PUSH-409", displays(*AROUND, node=11, speed=4000)) == []
    sending: list[Planned] = [(0, 10, "ESCStatus", TURNING), (50, 10, "PUSHCAN", motor(0, speed=4000))]
    assert said("PUSH-409", capture(sending)) == []
    assert len(said("PUSH-409", capture([*sending, (120, 10, "ESCStatus", TURNING)]))) == 1
