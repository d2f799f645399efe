"""What ESCs tell of how they are set up, against the flight before and against the others."""

from __future__ import annotations

import io
from typing import TYPE_CHECKING, Any

import pytest
from kit.simulated import changed
from kit.stories import said, told

from analyzer.app.request import Request
from analyzer.app.run import Run
from analyzer.app.triage import RunTriage
from analyzer.flight.verdict.case import FlightCase
from analyzer.flight.verdict.exchanged import exchanged
from analyzer.sources.origin import given
from dissectors.records import replace

if TYPE_CHECKING:
    from collections.abc import Callable

    from analyzer.simulate.bus import Sending

NODE = 12
VERSION = "uavcan.protocol.GetNodeInfo.Response"


def differing(change: Callable[[Sending, int], dict[str, Any] | None], *, parted: bool = False) -> list[str]:
    """What is told of a hover in which some transfers are otherwise; `parted` calls its second half another flight."""
    file = io.BytesIO(changed.__wrapped__(change).encode())
    file.name = "hover.log"
    looked = RunTriage(Run(Request((given(file),))))
    for _ in looked.over(looked._run.inside()):
        pass
    witness = looked.witness
    events, (flight,) = witness.events(), witness.flights()
    flights = [flight]
    if parted:
        middle = (flight.first.ran + flight.last.ran) // 2
        first = replace(flight, last=flight.last._replace(ran=middle))
        second = replace(flight, number=2, first=flight.first._replace(ran=middle + 1))
        flights = [first, second]
    return list(exchanged(FlightCase(witness, events, flights[-1], flight.last.ran), flights))


def parameter(**values: int) -> Callable[[Sending, int], dict[str, Any]]:
    return lambda sending, _: values if (sending.name, sending.node) == ("ParamGet", NODE) else {}


def test_one_that_is_set_to_turn_otherwise_than_all_others() -> None:
    (line,) = differing(parameter(esc_rotate_dir=3))
    assert line.startswith("ch2 tells esc_rotate_dir 0x3, the others 0x")


@pytest.mark.parametrize("change", [
    lambda _, __: {},
    parameter(esc_led_mode=3, esc_startup_times=7),  # neither turns a motor
    lambda sending, _: {"esc_rotate_dir": sending.node} if sending.name == "ParamGet" else {},  # all differ
])  # fmt: skip
def test_nobody_differs(change: Callable[[Sending, int], dict[str, Any]]) -> None:
    assert differing(change) == []


def test_another_software_than_the_others() -> None:
    def change(sending: Sending, _: int) -> dict[str, Any]:
        if (sending.name, sending.node) != (VERSION, NODE):
            return {}
        return {"software_version": sending.values["software_version"] | {"major": 9, "minor": 9}}

    (line,) = differing(change)
    assert line.startswith("ch2 tells software (GetNodeInfo) 9.9, the others ")


def test_what_changed_between_two_flights_and_that_a_good_exchange_is_no_cause() -> None:
    found = told("swap-flights:tail=no", seed=32)
    assert f"changed since flight 1: ch{found.first.ch} is another piece of hardware" in said(found)


def test_the_same_in_both_flights_is_no_change() -> None:
    assert differing(parameter(esc_rotate_dir=3), parted=True) == differing(parameter(esc_rotate_dir=3))
