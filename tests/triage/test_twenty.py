"""The twenty stories and the right answer, with its words; the first ten.

Seeds are fixed. Those of stories 2 and 5 were looked for, so that in them the desync is over and the pack sags.
"""

from __future__ import annotations

import pytest
from kit.stories import crash_log, excluded, said, told, triaged, without

COMMANDS = 1030


def kinds_after(name: str, **more: int) -> set[str]:
    return {one.kind for one in told(name, **more).after}


@pytest.mark.slow
def test_1_a_thrown_propeller_is_propulsion_and_what_saturates_comes_after_it() -> None:
    found = told("propeller-lost:twin=no:tail=yes", seed=12, rate=50)
    assert (found.first.kind, found.first.ch) == ("propulsion", found.primary[0].ch)
    assert "lost the load of its motor: propeller" in found.first.title
    assert "its load is gone" in said(found)
    assert "no fault bit of it" in said(found)
    assert {one.kind for one in found.after} & {"spread", "saturation"}


@pytest.mark.sampled(4)
@pytest.mark.parametrize("seed", [11, 12, 13])
def test_1_reports_at_10_hz_are_late_and_never_blame_another(seed: int) -> None:
    found = told("propeller-lost:twin=no:tail=yes", seed=seed, rate=10)
    assert found.first.kind in {"propulsion", "unknown"}


@pytest.mark.slow
def test_1_not_if_control_was_lost_before() -> None:
    assert told("propeller-lost:twin=yes:tail=yes", seed=12, rate=50).first.kind in {"control", "unknown"}


@pytest.mark.slow
def test_2_a_desync_that_recovers_is_an_esc_and_not_told_from_a_block() -> None:
    found = told("desync:twin=no:tail=no", seed=21, escs=6, rate=50)
    assert (found.first.kind, found.first.ch) == ("esc", found.primary[0].ch)
    assert "lost its motor for 0." in found.first.title
    assert found.first.title.endswith(" s (desync or blocked: the bus cannot tell)")
    assert not any(one.kind == "fault" for one in found.events)


@pytest.mark.sampled(4)
@pytest.mark.parametrize("seed", [11, 12, 13])
def test_2_at_10_hz_it_may_go_unseen(seed: int) -> None:
    assert told("desync:twin=no:tail=yes", seed=seed, rate=10).first.kind in {"esc", "unknown", "control"}


@pytest.mark.slow
def test_3_a_shaken_plug_is_wiring_and_stopped_reporting() -> None:
    found = told("esc-wire:twin=no:tail=no", seed=15, rate=50)
    assert (found.first.kind, found.first.ch) == ("wiring", found.primary[0].ch)
    assert "stopped reporting" in found.first.title
    assert "stopped driving" not in found.first.title
    assert "its transfer IDs jump: it went on sending" in said(found)
    assert "the others: 0 transfer IDs missing in that time" in said(found)


def test_3_an_uptime_of_0_is_its_power() -> None:
    found = told("esc-brown-out:twin=no:tail=no", seed=15)
    assert found.first.kind == "wiring"
    assert "restarted in flight: its power was away" in found.first.title
    assert "starts anew: uptime" in said(found)


@pytest.mark.sampled(4)
@pytest.mark.parametrize("tail", ["yes", "no"])
def test_4_a_cable_that_is_crushed_at_the_impact_is_a_consequence(tail: str) -> None:
    found = told(f"bus-fails:twin=yes:tail={tail}", seed=16)
    assert found.first.kind == "control"
    assert any(one.kind in {"errors", "bus state"} for one in found.after)


def test_4_one_that_breaks_in_a_calm_flight_is_the_cause() -> None:
    assert told("bus-fails:twin=no:tail=no", seed=16).first.kind == "bus"


@pytest.mark.slow
def test_5_a_brown_out_at_the_impact_is_load_and_a_consequence() -> None:
    found = told("control-lost:tail=yes", seed=3)
    assert found.first.kind == "control"
    assert {"sag", "fault"} <= {one.kind for one in found.after}
    assert {one.text for one in found.after if one.kind == "fault"} >= {"stall", "under voltage"}
    assert {one.kind for one in found.verdicts} == {"control"}


def test_5_a_pack_that_sags_below_the_line_of_its_current_is_the_battery() -> None:
    found = told("pack-sag", seed=17)
    assert found.first.kind == "battery"
    assert "its current explains" in said(found)


def test_6_the_crash_check_is_a_consequence() -> None:
    found = told("crash-check:tail=no", seed=18)
    assert found.first.kind == "control"
    assert any(one.kind == "commands zero" for one in found.after)
    assert "commanded" not in {one.kind for one in found.verdicts}


def test_6_zero_in_a_calm_flight_was_commanded_by_whom_can_does_not_tell() -> None:
    found = told("zero-in-air:twin=no:tail=no", seed=18)
    assert found.first.kind == "commanded"
    assert "who decided a command" in found.not_seen


def test_7_a_filter_that_diverges_is_lost_control_and_all_that_is_excluded_is_a_fact() -> None:
    found = told("control-lost:tail=no", seed=19)
    assert found.first.kind == "control"
    assert excluded(found)["commands stopping"].startswith("400 Hz to the end")
    assert not any("autopilot" in f"{one.fact} {one.seen}" for one in found.excluded)
    assert "who decided a command" in found.not_seen


@pytest.mark.sampled(4)
@pytest.mark.parametrize("seed", [20, 21, 22])
def test_8_a_landing_in_a_tree_is_nothing_wrong_on_this_bus(seed: int) -> None:
    found = told("tree:tail=yes", seed=seed)
    assert found.first.kind == "none"
    assert found.first.title.startswith("nothing wrong seen on this bus")
    assert {"attitude", "GPS", "pilot"} <= set(found.not_seen)


@pytest.mark.slow
def test_9_a_heavy_lift_is_thrust_with_every_esc_obeying() -> None:
    found = told("heavy-lift", seed=23)
    assert found.first.kind == "thrust"
    assert "every ESC obeyed" in said(found)
    assert "battery" not in {one.kind for one in found.verdicts}


@pytest.mark.sampled(4)
@pytest.mark.parametrize("seed", [24, 25])
def test_10_derating_without_a_bit_is_at_most_possible(seed: int) -> None:
    found = told("derating:twin=no:tail=no", seed=seed)
    assert (found.first.kind, found.first.support) == ("esc", "possible")
    assert "limits itself" in found.first.title
    assert "of what is commanded" in said(found)
    assert not any(one.kind == "fault" for one in found.events)


@pytest.mark.sampled(4)
@pytest.mark.parametrize(
    "name", ["control-lost:tail=yes", "motor-stall:twin=no:tail=yes", "pack-sag", "esc-power:twin=no"]
)
def test_without_commands_nobody_knows_whether_it_flew_calmly(name: str) -> None:
    text = without(crash_log(name, seed=26), lambda _, type_id, __: type_id == COMMANDS)
    found = triaged(text)
    assert found.first.kind == "unknown"
    assert "no commands are recorded" in found.first.title
    assert {one.support for one in found.verdicts} == {"possible"}
    assert "calm" not in " ".join(found.first.reasons)
