"""Every fault of the CAN and TRF layers is in the bytes: a reader of its own finds it, and nothing more of it."""

from __future__ import annotations

import json
from collections import Counter
from functools import lru_cache
from typing import TYPE_CHECKING, Any

import dronecan
import pytest
from kit import CAPTURES, VECTORS
from kit.judged import registry
from kit.simulated import Flight, clean, fly, prove
from witness import can, finder
from witness.reader import Log

from analyzer.rules.catalogue import LAYERS, load
from analyzer.simulate.faults import catalogue

if TYPE_CHECKING:
    from pathlib import Path

CATALOGUE = [row["id"] for row in json.loads((VECTORS / "rules.json").read_text())]
RULES = [rule for rule in CATALOGUE if rule.startswith(("CAN-", "TRF-"))]
SECONDS = 6.0


# These change the transfers that follow, too: whatever the node counts goes on from there, or all is shown once more.
LASTING = {"TRF-018", "TRF-019", "TRF-028"}


@pytest.mark.slow
@pytest.mark.parametrize("rule", RULES)
def test_the_fault_is_in_the_bytes(rule: str) -> None:
    flight, same = fly(rule, seconds=SECONDS), clean(seconds=SECONDS)
    prove(rule, flight)
    assert other_breaches(rule, flight) <= {other for answer in flight.answers(rule) for other in answer["also"]}
    assert commands(flight) <= {"com.tmotor.esc.FocCtrl"}
    if rule not in LASTING:
        assert flight.unlisted(same) == Counter()


def other_breaches(rule: str, flight: Flight) -> set[str]:
    """The rules of these layers that the flight breaches beside the one that was asked for."""
    return {other for other in RULES if other != rule and finder(other)(flight.log)}


def commands(flight: Flight) -> set[str]:
    """The types that a fault has sent or changed and that move something."""
    listed = {number for answer in flight.key["faults"] for number in answer["frames"]}
    names = {one.name for one in flight.log.transfers if one.numbers & listed and one.name}
    return {name for name in names if registry().resolve(name).actuates}


@pytest.mark.slow
@pytest.mark.parametrize("plan", ["hover", "mission", "bench", "startup"])
def test_a_clean_flight_breaches_nothing(plan: str) -> None:
    """Nodes that ask for their ID as they start are anonymous; no other rule has an exception."""
    log = clean(seconds=SECONDS, flight=plan).log
    assert {rule for rule in RULES if finder(rule)(log)} == ({"CAN-008"} if plan == "startup" else set())
    assert {one.status for one in log.transfers} == {"ok"}
    assert log.orphans == []


def violations() -> list[object]:
    blocks = json.loads((VECTORS / "violations.json").read_text())
    return [
        pytest.param(rule, block, id=f"{block['name']}-{rule}")
        for block in blocks
        for rule in block["expect"]
        if rule in RULES and (block["name"], rule) not in ENDED
    ]


# The end of these transfers came, behind a break: they are over, and nothing is abandoned a second time.
ENDED = {("missing_middle", "TRF-006"), ("swapped_2_3", "TRF-006")}


@lru_cache
def capture(path: Path) -> Log:
    return Log(path.read_text())


@pytest.mark.parametrize(("rule", "block"), violations())
def test_the_witness_sees_the_golden_violations(rule: str, block: dict[str, Any]) -> None:
    log = capture(VECTORS / "violations.log")
    rows = set(range(block["first_line"], block["last_line"] + 1))
    assert any(finding <= rows for finding in finder(rule)(log))


@pytest.mark.parametrize("rule", RULES)
@pytest.mark.parametrize("name", ["hover", "services"])
def test_the_witness_accuses_no_healthy_bus(name: str, rule: str) -> None:
    anonymous = name == "services" and rule == "CAN-008"  # a node asks for its ID
    assert bool(finder(rule)(capture(CAPTURES / f"{name}.log"))) == anonymous


def test_types_that_the_witness_knows_by_number_only() -> None:
    known = {type_.default_dtid: type_ for type_ in dronecan.TYPENAMES.values() if type_.kind == type_.KIND_MESSAGE}
    assert {key: known[key[1]].get_data_type_signature() for key in can.OTHERS} == can.OTHERS
    vendors = {
        number
        for number, type_ in known.items()
        if number is not None and number < 20_000 and type_.full_name.startswith("com.")
    }
    assert vendors == can.VENDORS


@pytest.mark.parametrize("layer", ["CAN", "TRF", "TYP", "PUSH"])
def test_every_rule_has_a_fault(layer: str) -> None:
    rules = {rule for rule in CATALOGUE if rule.startswith(layer)}
    assert {rule for rule in catalogue.faults() if rule.startswith(layer)} >= rules
    assert catalogue.faults().keys() <= load(registry()).keys()


def test_every_page_without_a_fault_says_so() -> None:
    """Rules of vendors that the simulator does not play have layers of their own."""
    pages = {rule: page for rule, page in load(registry()).items() if rule.partition("-")[0] in LAYERS}
    assert {rule for rule, page in pages.items() if page.body.get("fault", True)} == catalogue.faults().keys()
