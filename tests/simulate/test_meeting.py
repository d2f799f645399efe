"""Faults that meet: each keeps a transfer of its own, whatever else was asked for, and nothing falls over."""

from __future__ import annotations

import random
from itertools import combinations
from typing import Any

import pytest
from kit.judged import registry
from kit.simulated import Flight, fly, prove

from analyzer.simulate import Simulation, SimulationSettings
from analyzer.simulate.faults import catalogue

SECOND = 10**9
# They change the same transfers of everybody from their time on, or the whole capture.
EVERYWHERE = {"TRF-020", "TRF-028", "TRF-008"}
# They are about the bus or its recorder as a whole, not about transfers of their own.
WHOLE = {rule for rule in catalogue.faults() if rule.startswith(("BUS", "CAP"))}
STAGED = [rule for rule, fault in catalogue.faults().items() if fault.start is None and rule not in WHOLE]


def places(flight: Flight) -> list[tuple[str, set[int]]]:
    return [(answer["rule"], set(answer["frames"])) for answer in flight.key["faults"]]


@pytest.mark.slow
@pytest.mark.parametrize("other", ["TRF-005", "TRF-010", "TYP-308", "TYP-302"])
def test_no_two_faults_share_a_transfer(other: str) -> None:
    for rule in ("TYP-007", "TYP-008", "TYP-302", "TYP-303", "TYP-304", "TYP-308", "TRF-003", "TRF-012"):
        orders = [f"{one}@1.5:node=12:type=ESCStatus" for one in (rule, other)]
        flight = fly(*orders, seconds=2.5, seed=5)
        first, second = (frames for _, frames in places(flight))
        assert first.isdisjoint(second), rule
        if rule != other:
            prove(rule, flight)


@pytest.mark.sampled(22)
@pytest.mark.parametrize("rule", STAGED)
def test_a_rate_of_one_happens(rule: str) -> None:
    flight = fly(rates=(f"{rule}=1",), seconds=2.5, seed=5)
    assert len(flight.answers(rule)) >= 1
    assert all(answer["frames"] for answer in flight.key["faults"])


def test_a_rate_leaves_alone_what_another_fault_has_changed() -> None:
    flight = fly("TYP-302@1.5:node=12:count=5", rates=("TRF-010=0.5",), seconds=2.5, seed=5)
    frames = places(flight)
    assert len(frames) > 20
    listed = [number for _, numbers in frames for number in numbers]
    assert len(listed) == len(set(listed))


@pytest.mark.slow
@pytest.mark.parametrize("seed", [1, 6])
def test_all_of_them_in_one_flight(seed: int) -> None:
    rules = [rule for rule in catalogue.faults() if rule not in EVERYWHERE | WHOLE]
    flight = fly(*rules, seconds=10, seed=seed, escs=8)
    assert len(flight.key["faults"]) > 110
    once = [(rule, frames) for rule, frames in places(flight) if len(frames) < 12]
    for (one, mine), (other, theirs) in combinations(once, 2):
        assert mine.isdisjoint(theirs) or {one, other} & {"PUSH-201", "PUSH-102"}, (one, other)


def test_a_channel_that_is_left_out_while_it_is_negative() -> None:
    flight = fly("BUS-016@1.5:node=14", "BUS-026@1.5", "BUS-017@1.6:node=14", seconds=6, seed=5)
    assert flight.answers("BUS-026")


@pytest.mark.sampled(5)
@pytest.mark.parametrize("seed", range(6))
def test_any_mixture_with_any_rates_ends_well(seed: int) -> None:
    dice = random.Random(seed)
    rules = list(catalogue.faults())
    orders = [catalogue.order(rule) for rule in dice.sample(rules, 20)]
    orders += [catalogue.rate(f"{rule}={dice.choice((0.05, 0.5, 1))}") for rule in dice.sample(rules, 10)]
    story: dict[str, Any] = {"scenario": dice.choice(list(catalogue.stories()))} if seed % 2 else {}
    settings = SimulationSettings(
        escs=dice.choice((2, 4, 8)), duration=3 * SECOND, seed=seed, orders=tuple(orders), **story
    )
    run = Simulation(settings, registry())
    count = sum(1 for frame in run.frames() if not (frame.error or frame.garbled))
    key = run.key()
    assert key["capture"]["frames"] == count > 0
    assert all(answer["frames"] or answer["lines"] for answer in key["faults"])
    assert all(1 <= number <= count for answer in key["faults"] for number in answer["frames"])
