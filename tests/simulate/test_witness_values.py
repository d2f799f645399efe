"""Every fault of a value or a packet is in the bytes, and nowhere else, as a reader of its own sees them."""

from __future__ import annotations

import json
from collections import Counter
from functools import lru_cache

import pytest
from kit import VECTORS
from kit.simulated import Flight, clean, fly, prove
from witness import VALUES
from witness.reader import Log

RULES = {
    row["id"] for row in json.loads((VECTORS / "rules.json").read_text()) if row["id"].startswith(("TYP-", "PUSH-"))
}
SEED = 7
# Long enough for a fault between 35 and 80 % of it; what must stay unanswered for a second needs more behind it.
# An ESC that does not do what it is asked has to be seen standing, and then for 4 s.
SECONDS = {"PUSH-102": 8, "PUSH-201": 8, "PUSH-306": 14, "PUSH-307": 14}
USUAL = 4
SHORT = 3
# Rules that a healthy flight breaks as well.
NATURAL = {"TYP-208": "the ground station asks for all parameters"}
OPTIONS = (
    "TYP-001:bytes=7",
    "TYP-001:type=ParamGet:bytes=10",
    "TYP-002:bytes=9:node=12",
    "TYP-003:bits=3",
    "TYP-004:type=RawCommand",
    "TYP-005:type=PUSHCAN:more=3",
    "TYP-006:type=ParamGet",
    "TYP-006:type=RawCommand",
    "TYP-007:field=voltage",
    "TYP-008:field=current:sign=-1",
    "TYP-009:node=12",
    "TYP-011:tag=5:node=13",
    "TYP-012:bits=31",
    "TYP-014:mode=4:node=12",
    "TYP-101:channel=3:value=-1",
    "TYP-102:channel=2",
    "TYP-103:more=-1:commands=10",
    "TYP-104:count=3",
    "TYP-105:value=8191",
    "TYP-201:value=200:type=ParamGet",
    "TYP-201:value=31:node=13",
    "TYP-202:value=20",
    "TYP-202:value=20:type=ParamGet:node=12",
    "TYP-203:value=0",
    "TYP-206:value=401:type=ParamGet",
    "TYP-209:field=esc_led_mode",
    "TYP-303:value=65535",
    "TYP-304:value=0",
    "TYP-305:bit=7:seconds=1",
    "TYP-308:field=temperature",
    "TYP-308:field=rpm",
    "TYP-401:bytes=31",
    "TYP-402:field=esc_startup_duration",
    "TYP-403:node=12",
    "TYP-501:missing=1000:type=PUSHSCI",
    "TYP-502:type=PUSHSCI",
    "TYP-504:type=PUSHSCI",
    "PUSH-001:header=0:type=PUSHSCI",
    "PUSH-003:by=-1",
    "PUSH-004:by=3",
    "PUSH-007:value=255:type=PUSHSCI",
    "PUSH-008:value=170",
    "PUSH-009:by=-1:node=13",
    "PUSH-101:field=bus_rate:value=6",
    "PUSH-101:field=position_loop:value=2",
    "PUSH-302:mode=0x11:value=3601",
    "PUSH-306:mode=0x3A:value=301:node=11",
    "PUSH-306:mode=0x1A:value=1200",
    "PUSH-306:mode=0x44:value=500",
    "PUSH-307:how=slips",
    "PUSH-307:how=slips:speed=15",
    "PUSH-403:value=7000",
    "PUSH-405:by=-6000",
    "PUSH-407:field=power_on_count:by=1",
    "PUSH-408:field=speed:value=-32767",
    "PUSH-409:field=current:percent=-30",
    "PUSH-501:field=software_version",
    "PUSH-502:field=report_rate:value=401",
)
# These change one transfer that nobody acts on: everything else on the bus stays as it was.
ALONE = {
    *("TYP-001", "TYP-002", "TYP-003", "TYP-007", "TYP-008", "TYP-010", "TYP-201", "TYP-302", "TYP-303", "TYP-304"),
    *("TYP-308", "PUSH-001", "PUSH-002", "PUSH-003", "PUSH-004", "PUSH-005", "PUSH-007", "PUSH-008", "PUSH-401"),
    *("PUSH-402", "PUSH-403", "PUSH-404", "PUSH-405", "PUSH-406", "PUSH-407", "PUSH-408", "PUSH-409"),
}
# Values that the document allows, so that the fault would be none.
ALLOWED = (
    "TYP-001:bytes=0",
    "TYP-101:value=5",
    "TYP-103:more=0",
    "TYP-201:value=5",
    "TYP-202:value=19",
    "TYP-302:value=50",
    "TYP-303:value=16383",
    "TYP-304:value=8",
    "TYP-308:value=48",
    "TYP-401:bytes=32",
    "TYP-402:by=0",
    "TYP-202:value=255:type=ParamGet",
    "TYP-014:mode=7",
    "PUSH-004:by=0",
    "PUSH-009:by=256",
    "PUSH-306:value=299",
    "PUSH-306:value=10001",
    "PUSH-306:mode=0x55",
)


@lru_cache(maxsize=4)
def usual(seconds: float) -> dict[str, int]:
    """How often each rule is broken without a fault."""
    flight = clean(seconds, seed=SEED)
    return {rule: len(find(flight.log)) for rule, find in VALUES.items()}


def broken(flight: Flight, seconds: float) -> set[str]:
    """The rules about values and packets that are broken more often than without a fault."""
    return {rule for rule, find in VALUES.items() if len(find(flight.log)) > usual(seconds)[rule]}


def test_every_rule_has_its_proof() -> None:
    assert VALUES.keys() == RULES


@pytest.mark.slow
def test_without_a_fault_nothing_is_proved() -> None:
    for seconds in {USUAL, *SECONDS.values()}:
        assert {rule for rule, count in usual(seconds).items() if count} == NATURAL.keys()


@pytest.mark.sampled(72)
@pytest.mark.parametrize("rule", VALUES)
def test_the_fault_is_in_the_bytes(rule: str) -> None:
    """Its own rule is broken where the key says, and no other that the key does not expect."""
    seconds = SECONDS.get(rule, USUAL)
    flight = fly(rule, seconds=seconds, seed=SEED)
    prove(rule, flight, usual(seconds)[rule])
    assert broken(flight, seconds) - {rule} <= {other for answer in flight.answers(rule) for other in answer["also"]}
    if rule in ALONE:
        (answer,) = flight.answers(rule)
        assert len({one.first.number for one in flight.log.transfers if one.numbers & set(answer["frames"])}) == 1
        assert flight.unlisted(clean(seconds, seed=SEED)) == Counter()


@pytest.mark.sampled(36)
@pytest.mark.parametrize("order", OPTIONS)
def test_the_fault_is_as_it_was_asked_for(order: str) -> None:
    rule, *options = order.split(":")
    flight = fly(order, seconds=SECONDS.get(rule, SHORT), seed=SEED)
    prove(rule, flight)
    for answer in flight.answers(rule):
        shown = {name: str(answer[name]) for name in ("node", "type")}
        asked = dict(option.split("=") for option in options)
        assert {name: asked.get(name, value) for name, value in shown.items()} == shown


@pytest.mark.sampled(4)
@pytest.mark.parametrize("order", ALLOWED)
def test_what_breaks_no_rule_is_no_fault(order: str) -> None:
    flight = fly(order, seconds=SECONDS.get(order[:8], SHORT), seed=SEED)
    assert (flight.unused, flight.key["faults"]) == ((order,), [])


def test_the_proofs_find_what_others_broke() -> None:
    """Each block of the violations, built apart from simulator and witness, is found by the rules that it breaks."""
    log = Log((VECTORS / "violations.log").read_text())
    found = {rule: set().union(*find(log)) for rule, find in VALUES.items()}
    proved = set()
    for block in json.loads((VECTORS / "violations.json").read_text()):
        lines = range(block["first_line"], block["last_line"] + 1)
        numbers = {frame.number for frame in log.frames if frame.line in lines}
        expected = VALUES.keys() & set(block["expect"])
        assert {rule for rule in expected if not found[rule] & numbers} == set(), block["name"]
        proved |= expected
    assert len(proved) > 15
