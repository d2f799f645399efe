"""The campaign from outside: faults are made and found, and one that is expected to be another is not passed."""

from __future__ import annotations

from pathlib import Path
from random import Random

import pytest
from bench.outside import campaign
from bench.outside.flight import Flight
from bench.outside.kinds import Case, Kind, said, score
from bench.outside.trace import Trace

HOVER = Path(__file__).parents[2] / "captures" / "hover.log"
FRAMES, SENDERS = campaign.HALVES.values()


@pytest.fixture(scope="module")
def trace() -> Trace:
    return Trace(HOVER)


@pytest.mark.parametrize(
    "name", ["middle frame lost", "bit of the payload", "late copy of a frame inside the next transfer"]
)
def test_a_damaged_capture_says_what_was_done_to_it_and_no_more(trace: Trace, name: str) -> None:
    case = campaign.occasion(FRAMES[name], trace, Random(1))
    assert case is not None
    one = score(FRAMES[name], case, said(trace.text))
    assert (one.found, one.cause, one.wrong.total()) == (1, 1, 0)


def test_a_flight_from_outside_shows_its_fault_and_nothing_without() -> None:
    flight, kind = Flight(2), SENDERS["throttle above 100 %"]
    usual = said(flight.text)
    assert {key[1] for key in usual} == {"note"}
    case = campaign.occasion(kind, flight, Random(1))
    assert case is not None
    one = score(kind, case, usual)
    assert (one.found, one.cause, one.wrong.total()) == (1, 1, 0)


def test_what_is_found_but_not_expected_is_neither_the_cause_nor_explained(trace: Trace) -> None:
    case = campaign.occasion(FRAMES["bit of the payload"], trace, Random(1))
    assert case is not None
    one = score(Kind("of another cause", ("TRF-001",), ("CAN-*",), "", lambda *_: None), case, said(trace.text))
    assert (one.found, one.cause, one.wrong.total()) == (1, 0, 1)
    elsewhere = Case(case.text, frozenset({99}))
    one = score(FRAMES["bit of the payload"], elsewhere, said(trace.text))
    assert (one.found, one.cause, one.wrong.total()) == (0, 0, 1)


def test_kinds_are_many_and_a_trace_without_a_fault_is_the_capture(trace: Trace) -> None:
    assert min(len(FRAMES), len(SENDERS)) > 40
    assert trace.text == HOVER.read_text()
