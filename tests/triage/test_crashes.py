"""Simulated crashes: the first event is what the key says, at its time and channel."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import pytest
from kit.simulated import simulation, text_of

from analyzer.simulate.faults import catalogue
from dissectors.times import SECOND

if TYPE_CHECKING:
    from collections.abc import Callable

    Told = Callable[..., tuple[list[dict[str, Any]], list[dict[str, Any]]]]

# What the bus says of it, how long after it at most (s), and whether the event names the channel of the key.
SHOWN = {
    "motor-stall": ("fault", 0.05, True),
    "pack-lost": ("silence", 0.05, False),
    "two-packs": ("sag", 1.3, False),
    "esc-power": ("silence", 0.05, True),
    "deaf-esc": ("fault", 0.2, True),
    "esc-brown-out": ("silence", 0.05, True),
    "control-lost": ("spread", 0.9, False),
    "autopilot-reboot": ("commands stop", 0.02, False),
    "zero-in-air": ("commands zero", 0.02, False),
    "gps-restart": ("silence", 0.11, False),
}
USUAL = {"mode", "join", "arming", "parameter"}


@pytest.mark.sampled(3)
@pytest.mark.parametrize(("seed", "escs"), [(1, 4), (2, 8), (5, 6)])
@pytest.mark.parametrize("name", SHOWN)
def test_what_began_it_is_the_first_event(name: str, seed: int, escs: int, told: Told) -> None:
    scenario = catalogue.scenario(name)
    calm = ":distract=no" if "distract" in scenario.options else ""
    run = simulation(scenario.seconds, scenario=name + calm, seed=seed, escs=escs)
    flights, events = told(text_of(run, run.frames()).encode())
    story = run.key()["scenario"]
    began = story["first_event"]["t_ns"]
    kind, within, channel = SHOWN[name]
    first = next(one for one in events if one["kind"] not in USUAL)
    assert first["kind"] == kind
    assert 0 <= first["t_end"] - began <= within * SECOND
    assert not channel or ([first["node"]], [first["ch"]]) == (story["cause"]["nodes"], story["cause"]["channels"])
    assert len(flights) == 1


@pytest.mark.slow
def test_a_healthy_flight_lands_without_an_event(told: Told) -> None:
    run = simulation(24, scenario="landing", seed=3)
    (flight,), events = told(text_of(run, run.frames()).encode())
    assert flight["end"] == "landed"
    assert {one["kind"] for one in events} <= {*USUAL, "commands zero"}


@pytest.mark.slow
def test_a_clock_that_is_set_changes_no_flight(told: Told) -> None:
    run = simulation(24, scenario="clock-step", seed=1)
    (flight,), events = told(text_of(run, run.frames()).encode())
    assert flight["end"] == "landed"
    assert 15 * SECOND < flight["ran"] < 20 * SECOND
    assert [one["kind"] for one in events if one["kind"] not in USUAL] == ["clock", "commands zero"]


def test_an_armed_vehicle_is_cut_off_by_the_end(told: Told) -> None:
    """What is said once a second only is not lost a second before the end."""
    run = simulation(60, scenario="gps-restart", seed=5)
    (flight,), _ = told(text_of(run, run.frames()).encode())
    assert (flight["end"], flight["by"]) == ("cut", "arming")
