"""Faults of the bus that a reader of its own finds in the bytes, as the rules do."""

from __future__ import annotations

import pytest
from kit.judged import agree
from kit.simulated import clean, fly, prove, simulation, text_of
from witness import finder


@pytest.mark.slow
def test_a_motor_that_turns_on_without_throttle_is_in_the_bytes() -> None:
    prove("BUS-038", fly("BUS-038", seconds=9))
    run = simulation(9, orders=["BUS-038"])
    agree("BUS-038", text_of(run, run.frames()))


@pytest.mark.slow
def test_no_motor_does_that_in_a_clean_flight() -> None:
    assert finder("BUS-038")(clean(seconds=6.0).log) == []
