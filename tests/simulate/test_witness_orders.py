"""What is said about a fault, `RULE@TIME:key=value` and `RULE=P`, is what happens in the bytes."""

from __future__ import annotations

import pytest
from kit.simulated import Flight, clean, fly, named, prove
from witness import finder

SECOND, MILLISECOND = 10**9, 10**6
SEEDS = (2, 3, 4)
# One for each way of doing it: on single frames, while frames are cut, on payloads, injected, over seconds.
VARIED = ("CAN-001", "CAN-013", "TRF-003", "TRF-010", "TRF-016", "TRF-020", "TRF-022", "TRF-026")


@pytest.mark.slow
@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("rule", VARIED)
def test_any_seed_will_do(rule: str, seed: int) -> None:
    prove(rule, fly(rule, seconds=6, seed=seed))


@pytest.mark.sampled(2)
@pytest.mark.parametrize("rule", ["CAN-001", "TRF-003", "TRF-010", "TRF-017"])
def test_at_its_time(rule: str) -> None:
    flight = fly(f"{rule}@1.5", seconds=3)
    prove(rule, flight)
    (answer,) = flight.answers(rule)
    assert 1.5 <= answer["time"] < 1.6
    assert answer["t_ns"] == flight.key["settings"]["start_ns"] + round(answer["time"] * SECOND)


def test_what_comes_before_a_fault_is_not_changed_by_it() -> None:
    flight, same = fly("TRF-003@1.5", seconds=3), clean(seconds=3)
    first = flight.answers("TRF-003")[0]["frames"][0]
    assert [(f.t, f.id, f.data) for f in flight.log.frames[: first - 1]] == [
        (f.t, f.id, f.data) for f in same.log.frames[: first - 1]
    ]


@pytest.mark.sampled(2)
@pytest.mark.parametrize("rule", ["CAN-005", "CAN-014", "TRF-003", "TRF-010"])
def test_so_often(rule: str) -> None:
    flight = fly(f"{rule}@1:count=3", seconds=5)
    prove(rule, flight)
    answers = [named(rule, answer) for answer in flight.answers(rule)]
    assert len(answers) == 3
    assert len(set.union(*answers)) == sum(len(frames) for frames in answers)
    assert sorted(finder(rule)(flight.log), key=min) == finder(rule)(flight.log)
    assert len(finder(rule)(flight.log)) == 3


@pytest.mark.sampled(3)
@pytest.mark.parametrize("rule", ["CAN-014", "TRF-003", "TRF-010", "TRF-017"])
@pytest.mark.parametrize("node", [11, 13])
def test_of_that_node(rule: str, node: int) -> None:
    flight = fly(f"{rule}:node={node}", seconds=4)
    prove(rule, flight)
    (answer,) = flight.answers(rule)
    assert answer["node"] == node
    assert {flight.log[number].src for number in answer["frames"]} == {node}


@pytest.mark.sampled(3)
@pytest.mark.parametrize("rule", ["CAN-014", "TRF-003", "TRF-010"])
@pytest.mark.parametrize("name", ["ESCStatus", "PUSHCAN"])
def test_of_that_type(rule: str, name: str) -> None:
    flight = fly(f"{rule}:type={name}", seconds=4)
    prove(rule, flight)
    (answer,) = flight.answers(rule)
    assert answer["type"] == name
    assert {flight.log[number].name for number in answer["frames"]} == {name}


def test_of_nobody_finds_no_occasion() -> None:
    flight = fly("TRF-003:node=99", seconds=2)
    assert (flight.unused, flight.key["faults"]) == (("TRF-003:node=99",), [])
    assert [f.data for f in flight.log.frames] == [f.data for f in clean(seconds=2).log.frames]


def often(rule: str, share: float, seconds: float = 4) -> Flight:
    """A flight in which every transfer that suits the fault gets it with a probability."""
    flight = fly(rates=[f"{rule}={share}"], seconds=seconds)
    found = finder(rule)(flight.log)
    answers = [named(rule, answer) for answer in flight.answers(rule)]
    assert [answer for answer in answers if not any(answer & one for one in found)] == []
    assert [one for one in found if not any(answer & one for answer in answers)] == []
    return flight


@pytest.mark.sampled(2)
@pytest.mark.parametrize("rule", ["TRF-003", "TRF-010"])
def test_with_a_probability(rule: str) -> None:
    """Of n transfers that suit it n * P are changed, give or take four times the standard deviation."""
    answers = often(rule, 0.1).answers(rule)
    kinds = {answer["type"] for answer in answers}
    chances = len([one for one in clean(seconds=4).log.transfers if one.name in kinds])
    assert abs(len(answers) - chances * 0.1) <= 4 * (chances * 0.1 * 0.9) ** 0.5
    assert {answer["node"] for answer in answers} == {11, 12, 13, 14}
    assert often(rule, 0).answers(rule) == []


def test_with_certainty() -> None:
    flight = often("CAN-014", 1, seconds=2)
    answers = flight.answers("CAN-014")
    kinds = {answer["type"] for answer in answers}
    assert [set(answer["frames"]) for answer in answers] == [
        one.numbers for one in flight.log.transfers if one.name in kinds
    ]


def test_faults_that_change_no_transfer_have_a_chance_each_second() -> None:
    assert [len(often("CAN-001", share).answers("CAN-001")) for share in (0, 1)] == [0, 3]


def test_lines_of_error_frames() -> None:
    flight = fly("CAN-004@1:count=2", "CAN-001@1.5", seconds=4)
    log, errors = flight.log, flight.answers("CAN-004")
    assert sorted(line for answer in errors for line in answer["lines"]) == [frame.line for frame in log.errors]
    assert [answer["frames"] for answer in errors] == [[], []]
    (standard,) = flight.answers("CAN-001")
    assert {(log[number].extended, log[number].line > number) for number in standard["frames"]} == {(False, True)}
    assert (flight.key["capture"]["frames"], flight.key["capture"]["error_frames"]) == (
        len(log.frames),
        len(log.errors),
    )


def test_many_faults_in_one_flight() -> None:
    """Each is found where the key says, and whatever is found belongs to one of them."""
    rules = [
        "CAN-001",
        "CAN-005",
        "CAN-014",
        "CAN-019",
        "TRF-003",
        "TRF-004",
        "TRF-010",
        "TRF-012",
        "TRF-017",
        "TRF-026",
    ]
    flight = fly(*(f"{rule}@{1 + at / 5:.1f}" for at, rule in enumerate(rules)), seconds=4)
    assert [entry["rule"] for entry in flight.key["faults"]] == rules
    listed = set().union(*(entry["frames"] for entry in flight.key["faults"]))
    for rule in rules:
        found = finder(rule)(flight.log)
        (answer,) = flight.answers(rule)
        assert any(named(rule, answer) & one for one in found), rule
        assert [one for one in found if not one & listed] == []
