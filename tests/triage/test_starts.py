"""Flights that go wrong as soon as the motors turn, and rotors that stand together."""

from __future__ import annotations

import pytest
from kit import CAPTURES
from kit.composed import StoryFlight, composed, power_off, stall, throw
from kit.flight import Vehicle
from kit.stories import crash_log, said, triaged, without

import analyzer
from analyzer.report.triage.text import render
from analyzer.views.terminal import Palette
from dissectors.tmotor.traffic.flights import hover, later

STATUS = 1034  # ESCStatus


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
    assert not found.well
    assert " --at " in found.commands[0]
    assert found.first.t_end is not None


def test_an_esc_that_gets_no_throttle_before_take_off_is_a_wire() -> None:
    def deaf(flight: StoryFlight) -> None:
        flight.vehicle.escs[5].deaf = True

    found = triaged(composed((2.5, deaf), escs=8, rate=50))
    assert (found.first.kind, found.first.ch) == ("wiring", 6)


@pytest.mark.parametrize("begin", [8.8, 8.99, 9.2, 10, 11])
@pytest.mark.parametrize("seed", [1, 3])
def test_a_recording_that_begins_in_the_air_shows_no_take_off(begin: float, seed: int) -> None:
    found = triaged(without(composed((9, throw(2)), seed=seed), lambda _, __, t: t < begin))
    assert (found.first.kind, found.first.ch) == ("unknown", None)


def test_motors_that_report_once_a_second_are_not_said_to_obey() -> None:
    last: dict[tuple[int, int], float] = {}

    def unwanted(node: int, type_id: int, t: float) -> bool:
        begun = last.get((node, type_id), -1.0)
        if type_id != STATUS or 0 <= t - begun < 0.003:  # the other frames of a transfer
            return False
        if t - begun >= 0.99:
            last[node, type_id] = t
            return False
        return True

    found = triaged(without(composed((9, throw(2))), unwanted))
    assert found.first.kind == "unknown"
    assert "before each motor had shown what it does at a command" in found.first.title


def test_zero_commands_are_no_calm_ones() -> None:
    """The crash check stops motors that the wind of a long fall turns: commands that are all zero steer nothing."""
    vehicle, up, down = Vehicle(), 4000, 0.1
    for start, stop, low, rpm in ((0, 8000, 1.0, 2400), (8000, 9500, down, 2400), (9500, 15_000, 0.0, 1200)):
        high = up * 2 if low == down else up * low
        vehicle.commands(start, stop, *(round(one) for one in (high, high, up * low, up * low)))
        for node in range(11, 15):
            vehicle.statuses(start, stop, node, rpm=rpm, current=10.0 * (low > 0))
    found = triaged(vehicle.finish())
    assert "commanded" not in {one.kind for one in found.verdicts}
    assert found.first.kind in {"control", "unknown"}


def test_a_motor_that_a_wrong_past_calls_off_is_not_said_to_obey() -> None:
    """The recording begins while motors spin up, so that their past is that of too little speed."""
    lines = crash_log("derating:tail=no:twin=no:mute=no", 25_000_780, rate=50).splitlines(keepends=True)
    found = triaged("".join(lines[len(lines) // 4 :]))
    assert found.first.kind in {"unknown", "esc"}


def test_the_last_of_two_flights_that_went_wrong_fits_on_the_screen() -> None:
    legs = [*hover(21.0), *later(hover(21.0), 21.0)]
    text = composed((12, throw(2)), seconds=42, escs=8, flight=lambda story: StoryFlight(story, legs))
    found = triaged(text)
    assert (found.first.kind, found.first.ch) == ("propulsion", 3)
    assert render(found).splitlines()[0].endswith("2 flights, last: stopped")
    (apart,) = (one for one in found.first.reasons if "went apart" in one)
    assert float(apart.rpartition("apart ")[2].partition(" s")[0]) < 1  # and not at the landing, where they do so again
