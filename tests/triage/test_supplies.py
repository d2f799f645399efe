"""Supplies that sink in the course of seconds, and what is only a pack in use."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest
from kit.simulated import changed, simulation, text_of
from kit.stories import crash_log, excluded, said, triaged

from dissectors.tmotor.traffic.stories import supply

if TYPE_CHECKING:
    from typing import Any

    from dissectors.traffic import Sending


def sinking(monkeypatch: pytest.MonkeyPatch, fall: float) -> str:
    """A vehicle of two packs, one of which loses so many volts a second."""
    monkeypatch.setattr(supply, "_FALL", fall)
    return crash_log.__wrapped__("two-packs:tail=no:twin=no", seed=2, rate=50)


def test_a_pack_that_sinks_for_seconds_may_be_the_cause(monkeypatch: pytest.MonkeyPatch) -> None:
    found = triaged(sinking(monkeypatch, 0.9))
    assert (found.first.kind, found.first.chs, found.first.support) == ("battery", (2, 4), "possible")
    assert found.first.title == "the supply of channels 2 4 sank"
    assert "the other 2 ESCs keep their voltage" in said(found)
    assert "a pack that is empty looks alike" in said(found)


def test_one_that_breaks_down_within_a_moment_is_told_as_that() -> None:
    made = simulation(6, scenario="two-packs:tail=no:distract=no", seed=1)
    found = triaged(text_of(made, made.frames()))
    assert (found.first.kind, found.first.support) == ("battery", "well supported")
    assert "50.1 -> 40.4 V; its current explains 49.3 V" in said(found)


def test_a_pack_in_use_is_no_cause_but_its_voltage_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    found = triaged(sinking(monkeypatch, 0.5))
    assert found.first.kind == "unknown"
    assert "50.2 V at first, 45.6 V at the lowest" in said(found)
    assert "nothing wrong" not in said(found)
    assert "does not" not in dict(found.first.notes)


def test_the_voltage_of_one_esc_alone_is_its_cable() -> None:
    def sag(sending: Sending, _: int) -> dict[str, Any]:
        bad = (sending.name, sending.node) == ("ESCStatus", 12) and sending.frames[0].t > 7_000_000_000
        return {"voltage": 0.8 * sending.values["voltage"]} if bad else {}

    found = triaged(changed.__wrapped__(sag))
    assert (found.first.kind, found.first.ch) == ("wiring", 2)
    assert "its supply broke down: its plug, its joint or its cable" in found.first.title
    assert "the other 3 ESCs keep their voltage" in said(found)


@pytest.mark.parametrize(
    ("story", "more"),
    [
        ("deaf-esc:tail=no:twin=yes:distract=yes:mute=yes", {"seed": 21000396, "escs": 8, "rate": 50}),
        ("desync:tail=no:twin=yes:mute=no:recovers=yes", {"seed": 21000251, "escs": 6, "rate": 50}),
        ("autopilot-reboot:tail=yes:twin=yes:mute=no", {"seed": 25000468, "escs": 8, "rate": 30}),
    ],
)
def test_a_pack_that_others_load_is_not_that_of_those_that_take_nothing(story: str, more: dict[str, int]) -> None:
    """The vehicle tumbles: motors that stand report the low voltage that the others cause."""
    found = triaged(crash_log(story, **more))
    assert found.first.kind == "control"
    assert excluded(found)["pack sag"].startswith("none")


def test_a_supply_that_a_stalled_motor_loads_is_not_the_cause() -> None:
    """It tips over, rotors stall and draw what there is: the others say that their voltage is low."""
    found = triaged(crash_log("swapped-esc:tail=yes:mute=no", seed=77))
    assert found.first.kind == "setup"
    assert "battery" not in {one.kind for one in found.verdicts}


def test_one_vehicle_on_two_interfaces_has_its_escs_once() -> None:
    found = triaged(crash_log("two-interfaces", seed=77))
    assert any(one.startswith("4 ESCs on each of 2 interfaces, ") for one in found.looked)
