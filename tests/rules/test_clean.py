"""What is right breaches no rule, and every example of a breach breaches the rules that it was made for."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Any

import pytest
from kit import CAPTURES, VECTORS, encode
from kit.judged import judge, registry
from kit.simulated import flight
from kit.traffic import MS, at, lines, status

from analyzer.rules.catalogue import load

if TYPE_CHECKING:
    from collections.abc import Iterable

    from kit.judged import Said

LINES = (VECTORS / "violations.log").read_text().splitlines(keepends=True)
BLOCKS: list[dict[str, Any]] = json.loads((VECTORS / "violations.json").read_text())
IN_FLIGHT = "CAP-005"  # these recordings end with motors turning
# What only the frames around a block show: that a type is believed, or how its sender reads a doubtful field.
BEHIND = {"single_toggle_1": "clean_reference", "escstatus_encoder_mode_faults": "clean_reference"}
# Each repeated as often as a bus carries it: identifier and last byte, which is no tail byte in most of them.
J1939 = [(0x0CF00400, 0xFF), (0x18F00417, 0xFF), (0x18FEF100, 0x7D), (0x18FEEE00, 0x00), (0x18ECFF21, 0xFF)]
VESC = [(command << 8 | node, last) for command in (9, 14, 15, 16, 27) for node, last in ((4, 0x00), (85, 0xF2))]


def worse_than_notes(found: Iterable[Said], *, but: str = "") -> list[tuple[str, str, int, str]]:
    return [(one.rule, one.severity, one.node, one.text) for one in found if one.severity != "note" and one.rule != but]


def cut(name: str) -> str:
    block = next(one for one in BLOCKS if one["name"] == name)
    return "".join(LINES[block["first_line"] - 1 : block["last_line"]])


@pytest.mark.sampled(33)
@pytest.mark.parametrize("seed", [3, 11])
@pytest.mark.parametrize("stock", [False, True])
@pytest.mark.parametrize("escs", [4, 8])
@pytest.mark.parametrize("plan", ["hover", "mission", "bench", "startup"])
def test_a_simulated_flight_without_faults(plan: str, escs: int, stock: bool, seed: int) -> None:
    text = flight(flight=plan, escs=escs, seconds=8, seed=seed, stock=stock)
    assert len(text.splitlines()) > 4000
    assert worse_than_notes(judge(text), but=IN_FLIGHT) == []


@pytest.mark.parametrize("name", ["hover.log", "hover-4.log", "startup.log", "recording-ends.log", "services.log"])
def test_a_capture_that_is_said_to_be_right(name: str) -> None:
    assert worse_than_notes(judge((CAPTURES / name).read_bytes()), but=IN_FLIGHT) == []


def test_a_flight_as_can_fd_is_wrong_in_nothing_else() -> None:
    found = worse_than_notes(judge((CAPTURES / "fd.log").read_bytes()), but=IN_FLIGHT)
    assert {rule for rule, *_ in found} == {"CAN-003"}


@pytest.mark.parametrize("block", BLOCKS, ids=[block["name"] for block in BLOCKS])
def test_an_example_breaches_what_it_was_made_for(block: dict[str, Any]) -> None:
    before = cut(BEHIND[block["name"]]) if block["name"] in BEHIND else ""
    own = len(before.splitlines())
    found = judge(before + cut(block["name"]), ("all",))
    assert {*block["expect"]} <= {one.rule for one in found if one.last > own}
    if not block["expect"]:
        assert worse_than_notes(found, but=IN_FLIGHT) == []


def test_all_examples_in_one_recording() -> None:
    """Rules that tell the frames they are about; a silence belongs to no block."""
    found = judge("".join(LINES), ("all",))
    for block in BLOCKS:
        here = {
            one.rule
            for one in found
            for frame in (*one.frames, one.first, one.last)
            if block["first_line"] <= frame <= block["last_line"]
        }
        assert {*block["expect"]} - {"BUS-011", "BUS-023"} <= here, block["name"]


def test_standard_traffic_has_no_protocol_error() -> None:
    found = judge((VECTORS / "neighbours.log").read_bytes(), ("all",))
    pages = load(registry())
    assert [one.rule for one in found if one.severity == "error" and pages[one.rule].category == "protocol"] == []
    assert "BUS-022" in {one.rule for one in found}


@pytest.mark.parametrize("foreign", [J1939, VESC], ids=["J1939", "VESC"])
def test_other_protocols_on_the_wire_are_only_noted(foreign: list[tuple[int, int]]) -> None:
    sent = [frame for k in range(6) for frame in status(k).frames()]
    others = [
        at(MS * (2 + 50 * k), encode.Frame(number, bytes([0xF0, 0x7D, k, 0x13, 0, 0, 0x20, last])))
        for k in range(60)
        for number, last in foreign
    ]
    found = judge(lines(sent, *others), ("CAN", "TRF", "TYP", "PUSH"))
    assert worse_than_notes(found) == []
    assert {one.rule for one in found if one.count > 1} >= {"CAN-018"}
