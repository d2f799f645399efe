"""What looks like a cause and is none: motors on the bench, holes of a recording, a blade that is no propeller."""

from __future__ import annotations

from kit import CAPTURES
from kit.stories import excluded, said, told, triaged, without

import analyzer

SUPPLY = 20051  # of ESCs that tell it apart from their speeds


def sample(name: str) -> str:
    return (CAPTURES / name).read_text()


def test_motors_that_are_tried_one_by_one_fly_nowhere() -> None:
    """Commands are 54 % apart, and no sensor of an attitude."""
    found = analyzer.triage(CAPTURES / "bench.log")
    assert (found.first.kind, len(found.verdicts)) == ("none", 1)
    assert "bench: motors are driven one by one" in said(found)
    assert sum(one.kind == "spread" for one in found.events) > 2


def test_what_an_esc_says_behind_a_hole_is_no_proof_that_the_bus_carried_it() -> None:
    found = analyzer.triage(CAPTURES / "bus-break.log")
    assert [one.kind for one in found.verdicts] == ["bus"]
    assert "commands stopping" not in excluded(found)
    assert any(one.text == "throttle loss" for one in found.after)


def test_a_gps_on_the_bus_is_not_called_unseen() -> None:
    assert analyzer.triage(CAPTURES / "gps-restart.log").not_seen == ["attitude", "pilot", "who decided a command"]
    assert analyzer.triage(CAPTURES / "gps-restart.log").commands[0].endswith("--at 2606 -Y 'node == 42'")
    assert "GPS" in analyzer.triage(CAPTURES / "power-cut.log").not_seen


def test_a_motor_that_was_learned_in_a_hurry_is_not_out_of_step() -> None:
    """It turns faster than when it was run up through that command, and takes what a propeller takes for it."""
    found = analyzer.triage(CAPTURES / "duplicate-node.log")
    assert [one.kind for one in found.verdicts] == ["address"]
    assert not any(one.kind == "motor" for one in found.events)


def test_a_mode_says_what_it_is_the_mode_of() -> None:
    reasons = analyzer.triage(CAPTURES / "esc-failure.mcap").first.reasons
    assert any(one.startswith("mode: system status no rotor lock -> fault") for one in reasons)
    assert any(one.startswith("mode: operating -> error") for one in reasons)


def test_a_damaged_blade_is_no_lost_propeller() -> None:
    found = told("blade-damage:twin=no:tail=no", seed=12, rate=50)
    assert found.first.kind == "propulsion"
    assert "lost a part of the load of its motor: a damaged blade" in found.first.title
    assert "a part of its load is gone" in said(found)


def test_a_recording_that_ends_says_what_it_rules_out() -> None:
    notes = dict(analyzer.triage(CAPTURES / "power-cut.log").first.notes)
    assert notes["does not"] == "an ESC or motor that failed more than 0.03 s before; a sag of the pack before"
    assert notes["last seen"].endswith("then the recording ends, for every sender at once")


def test_what_is_not_measured_is_not_ruled_out() -> None:
    """These ESCs tell speeds, and here no voltages: no motor is held against its past."""
    found = triaged(without(sample("hobbywing.log"), lambda _, type_id, __: type_id == SUPPLY))
    assert found.first.kind == "unknown"
    assert "does not" not in dict(found.first.notes)


def test_not_every_sender_at_once_if_one_was_silent_before() -> None:
    torn = without(sample("power-cut.log"), lambda node, _, t: node == 10 and t > 3.9)
    assert "for every sender at once" not in said(triaged(torn))


def test_a_power_module_tells_that_the_pack_did_not_sag() -> None:
    module = without(sample("gps-restart.log"), lambda node, _, t: node != 50 or t > 5)
    rows = [*sample("propeller-lost.log").splitlines(keepends=True), *module.splitlines(keepends=True)]
    found = triaged("".join(sorted(rows, key=lambda row: float(row[1 : row.index(")")]))))
    assert excluded(found)["pack sag"].endswith("49.3 V at the lowest by node 50 (power module)")
