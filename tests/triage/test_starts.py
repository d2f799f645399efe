"""Flights that go wrong as soon as the motors turn, and rotors that stand together."""

from __future__ import annotations

from kit import CAPTURES
from kit.composed import composed, power_off, stall, throw
from kit.stories import said, triaged

import analyzer
from analyzer.report.triage.text import render
from analyzer.views.terminal import Palette


def test_an_esc_that_says_before_take_off_that_it_stalls_is_why_it_tips_over() -> None:
    found = triaged(composed((2.5, stall(3))))
    assert (found.first.kind, found.first.ch) == ("esc", 4)
    assert "fault: stall" in said(found)


def test_an_esc_that_falls_silent_before_take_off_is_not_said_to_obey() -> None:
    found = triaged(composed((2.5, power_off(3))))
    assert found.first.kind == "unknown"
    assert "ch4 is commanded, and nobody reports as that" in found.first.title


def test_an_esc_that_falls_silent_as_motors_begin_to_turn_is_an_esc() -> None:
    found = triaged(composed((3.05, power_off(3))))
    assert (found.first.kind, found.first.ch) == ("wiring", 4)


def test_nobody_is_said_to_obey_who_has_not_shown_what_it_does() -> None:
    found = triaged(composed((3.3, throw(3))))
    assert (found.first.kind, found.first.ch) == ("setup", 4)
    assert "obey" not in said(found)


def test_a_propeller_lost_before_its_motor_was_learned_is_not_lost_control() -> None:
    found = triaged(composed((5.5, throw(5)), escs=6, rate=10, seed=3))
    assert found.first.kind == "unknown"


def test_rotors_that_stand_at_once_are_not_a_flight_that_was_well() -> None:
    found = triaged(composed((9, stall(2, 6)), escs=8))
    assert found.first.kind == "none"
    assert found.first.title == "nothing wrong seen on this bus until several rotors stood at once"
    assert dict(found.first.notes)["fits"].startswith("it hit something; or what these motors share failed")
    green, _ = Palette(True).around("good")
    assert green not in render(found, palette=Palette(True))
    assert green in render(analyzer.triage(CAPTURES / "bench.log"), palette=Palette(True))
    assert "landed" not in render(found)
