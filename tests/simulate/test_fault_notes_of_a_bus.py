"""Faults of a bus and of a recorder that are only notes, which the campaign leaves out; and their settings."""

from __future__ import annotations

import re
from functools import cache
from typing import Any, NamedTuple

import pytest
from bench.campaign import pages, shows, worst
from kit.judged import outcome
from kit.simulated import Flown, simulation

from analyzer.simulate.faults import catalogue

FULL, HALF = 1_000_000, 500_000
NOTES = tuple(rule for rule in catalogue.faults() if rule[:3] in {"BUS", "CAP"} and pages()[rule].severity == "note")
# What is only judged with a known bit rate; the first of them at less than 1 Mbit/s.
BIT_RATES = {"BUS-003": HALF, "BUS-004": FULL}


class Told(NamedTuple):
    """A flight as candump text, the answers of its key, and the frames that each answer is about."""

    text: str
    answers: list[dict[str, Any]]


@cache
def fly(order: str = "", bit_rate: int = FULL, seconds: int = 8, escs: int = 4) -> Told:
    orders = (order,) if order else ()
    made = Flown(simulation(seconds, bit_rate=bit_rate, escs=escs, orders=orders))
    return Told(made.text, made.simulation.key()["faults"])


@cache
def blamed(order: str, bit_rate: int, rate: int | None) -> frozenset[tuple[str, str, int]]:
    """Errors and warnings of a flight: rule, severity, node."""
    runs = outcome(fly(order, bit_rate).text, ("all",), bit_rate=rate).runs
    return frozenset((key.rule, key.severity, key.node) for key, _ in worst(runs))


@pytest.mark.sampled(9)
@pytest.mark.parametrize("rule", NOTES)
def test_a_fault_is_in_the_key_and_its_rule_finds_it_there(rule: str) -> None:
    rate = BIT_RATES.get(rule)
    flown = fly(rule, rate or FULL)
    (answer,) = (one for one in flown.answers if one["rule"] == rule)
    assert answer["frames"] or answer["lines"]
    found = outcome(flown.text, (rule,), bit_rate=rate).runs
    assert any(key.rule == rule and shows(run, answer) for key, run in found)
    clean = outcome(fly(bit_rate=rate or FULL).text, (rule,), bit_rate=rate).runs
    known = {(key.node, key.key, run.count) for key, run in clean}
    assert {(key.node, key.key, run.count) for key, run in found} - known, "the clean flight has it, too"


@pytest.mark.sampled(3)
@pytest.mark.parametrize("rule", NOTES)
def test_nothing_else_is_blamed(rule: str) -> None:
    rate = BIT_RATES.get(rule)
    (answer,) = (one for one in fly(rule, rate or FULL).answers if one["rule"] == rule)
    allowed = {rule, *answer["also"], *pages()[rule].body.get("also", ())}
    usual = blamed("", rate or FULL, rate)
    assert [one for one in sorted(blamed(rule, rate or FULL, rate) - usual) if one[0] not in allowed] == []


@pytest.mark.parametrize("order", ["BUS-001", "BUS-002", "BUS-024"])
def test_a_bus_that_cannot_carry_it_has_no_such_fault(order: str) -> None:
    assert fly(order, 125_000, 4).answers == []


def test_a_limit_for_slower_buses_is_for_slower_buses() -> None:
    assert fly("BUS-003", FULL, 4).answers == []


@pytest.mark.sampled(3)
@pytest.mark.parametrize(("escs", "frames"), [(2, 2600), (4, 3000), (8, 3000)])
def test_reports_of_any_number_of_escs_can_be_too_many(escs: int, frames: int) -> None:
    flown = fly(f"BUS-001@3:frames={frames}", FULL, 6, escs)
    (found,) = outcome(flown.text, ("BUS-001",)).runs
    assert found[1].count == 1
    (answer,) = flown.answers
    assert shows(found[1], answer)


def test_one_esc_alone_is_never_too_much() -> None:
    assert fly("BUS-001", FULL, 4, 1).answers == []


@pytest.mark.sampled(2)
@pytest.mark.parametrize(("at", "seconds"), [("2", 6), ("3.5", 8), ("5.5", 8)])
def test_a_report_nobody_asked_for_finds_its_moment(at: str, seconds: int) -> None:
    flown = fly(f"BUS-014@{at}", FULL, seconds)
    (answer,) = flown.answers
    found = outcome(flown.text, ("BUS-014",)).runs
    assert [(run.count, run.first[1] + 1) for _, run in found] == [(1, answer["frames"][0])]


@pytest.mark.sampled(2)
@pytest.mark.parametrize("rule", ["BUS-020", "CAP-002"])
def test_a_silence_begins_behind_the_frame_that_the_key_names_first(rule: str) -> None:
    flown = fly(rule)
    (answer,) = flown.answers
    ((_, run),) = outcome(flown.text, (rule,)).runs
    assert run.count == 1
    assert 0 <= run.first[0] - answer["t_ns"] < 10**8
    assert len(answer["frames"]) >= 2


def test_so_many_escs_are_there_as_were_asked_for() -> None:
    ((_, run),) = outcome(fly("BUS-008@2:nodes=9", FULL, 4, 5).text, ("BUS-008",)).runs
    assert run.examples[0].text == "9 ESC nodes"


@pytest.mark.slow
def test_the_zero_point_of_an_encoder_is_off_by_what_was_asked_for() -> None:
    found = outcome(fly("BUS-032:by=20:node=12").text, ("BUS-032",)).runs
    assert {key.node for key, _ in found} == {12}
    encoder, position = map(float, re.findall(r"\d+\.\d", found[0][1].examples[0].text))
    assert (encoder - position) % 360 == pytest.approx(20, abs=0.2)
