"""What decides the order: when a motor was last well, what is over, and what begins anew. Seeds were looked for."""

from __future__ import annotations

import pytest
from kit.stories import crash_log, said, told, triaged

from dissectors.times import SECOND


@pytest.mark.slow
@pytest.mark.parametrize(
    ("story", "more"),
    [
        ("clock-crash:tail=yes:twin=yes:mute=no:back=yes", {"seed": 1000945, "escs": 4, "rate": 50, "stock": True}),
        ("clock-crash:tail=yes:twin=yes:mute=no:back=yes", {"seed": 1000163, "escs": 8, "rate": 50}),
        ("propeller-lost:tail=no:twin=yes:mute=no", {"seed": 9000181, "escs": 6, "rate": 50, "stock": True}),
        ("derating:tail=yes:twin=yes:distract=yes:mute=no", {"seed": 1000234, "escs": 6, "rate": 30}),
    ],
)
def test_a_motor_that_was_well_while_commands_changed_did_not_fail_before(story: str, more: dict[str, int]) -> None:
    """It stood, limited itself or had no load only after control was lost: reports in between say so."""
    found = told(story, **more)
    assert found.first.kind == "control"
    assert any(one.kind == "motor" for one in found.after)


def test_a_motor_that_was_commanded_down_did_not_turn_it_over() -> None:
    """A motor that lifts less is commanded up: of this one a load is missed 1.6 s later, at a throttle seldom met."""
    found = told(
        "deaf-esc:tail=no:twin=yes:distract=yes:mute=no", seed=13000030, escs=8, rate=30
    )  # fmt: skip
    assert found.first.kind == "control"
    assert any(one.kind == "motor" and one.ch == 5 for one in found.after)
    assert "9 % apart at most until then, 40 % 0.04 s later, 85 % in the end" in said(found)
    assert "without a fault bit" not in said(found)  # one was over before


def test_slow_reports_behind_lost_control_are_no_order() -> None:
    found = told("coaxial-failure:tail=no:twin=yes:distract=yes:mute=no", seed=1000409, escs=8, rate=10)
    assert found.first.kind == "unknown"
    assert "seen: ESC ch2 (node 12): lost the load of its motor" in said(found)
    assert 2 not in next(one.lowered for one in found.events if one.kind == "spread")


@pytest.mark.slow
def test_a_motor_that_finds_its_step_again_is_told_if_nothing_else_was() -> None:
    found = told("desync:tail=yes:twin=no:mute=no:recovers=yes", seed=1000739, escs=8, rate=50)
    assert (found.first.kind, found.first.ch) == ("esc", 1)
    assert "it was over, and the vehicle flew on calmly for 6.6 s" in found.first.against


@pytest.mark.slow
def test_a_silence_of_the_recorder_hides_no_later_trouble_of_an_esc() -> None:
    """The blade breaks in gusts, three seconds after the recorder lost frames of the same ESC and others."""
    found = told("blade-damage:tail=yes:twin=no:distract=yes:mute=no", seed=1000966, escs=6, rate=50)
    assert (found.first.kind, found.first.ch) == ("propulsion", 6)


def test_two_devices_in_step_repeat_each_others_transfer_ids() -> None:
    found = told("duplicate-node", seed=1001009, escs=6, rate=30, stock=True)
    assert (found.first.kind, found.first.chs) == ("address", (5, 6))
    assert "0 left out, 240 twice" in said(found)


def test_a_bus_breaks_down_where_its_errors_go_on() -> None:
    """Near miss: three error frames two seconds before, after which the bus was well again."""
    text = crash_log("bus-fails:tail=no:twin=no:distract=yes:mute=no", seed=1000334)
    found = triaged(text)
    assert found.first.kind == "bus"
    first, second = (one for one in found.events if one.kind == "errors")
    assert first.values["count"] < 10 < second.values["count"]
    assert found.primary[0] is second
    assert second.first.ran - first.first.ran > SECOND


@pytest.mark.slow
def test_a_moment_in_which_commands_were_lost_says_nothing_of_a_motor() -> None:
    found = told("bad-recorder:distract=no:mute=no", seed=5000319, escs=8, rate=50)
    assert any(one.kind == "motor" for one in found.events)
    assert found.first.kind == "none"


def test_who_is_silent_behind_a_hole_of_the_recorder_is_so_outside_of_it() -> None:
    """It stopped somewhere in the hole, others are heard behind it, and control is lost seconds later."""
    found = told("blind-crash:tail=yes:distract=yes:mute=no", seed=11000700, escs=8, rate=10)
    assert (found.first.kind, found.first.ch) == ("wiring", 2)
    assert "stopped reporting" in found.first.title


@pytest.mark.parametrize(
    ("seed", "escs", "rate", "began"),
    [
        pytest.param(21000073, 6, 10, (8.467, 8.567), marks=pytest.mark.slow),  # commands that it misses, long behind
        pytest.param(21000763, 4, 30, (9.092, 9.125)),  # it says itself that it gets none
    ],
)
def test_a_plug_that_shakes_shows_first_in_its_transfer_ids(
    seed: int, escs: int, rate: int, began: tuple[float, float]
) -> None:
    text = crash_log("esc-wire:tail=yes:twin=no:mute=no", seed=seed, escs=escs, rate=rate)
    found = triaged(text)
    assert found.first.kind == "wiring"
    assert found.start is not None
    assert tuple(round((t - found.start) / SECOND, 3) for t in (found.first.t, found.first.t_end) if t) == began
