"""ESCs without power: one of them, all together, one after the other, and behind holes of the recording."""

from __future__ import annotations

from random import Random

import pytest
from kit.composed import composed, deafen, power_off, restart, stall
from kit.stories import said, triaged, without


@pytest.mark.parametrize(
    ("order", "seed", "rate"), [((2, 0, 3, 1), 1, 30), ((0, 1, 2, 3), 2, 10), ((3, 2, 1, 0), 3, 50)]
)
def test_escs_that_restart_together_lost_their_supply_whoever_is_seen_first(
    order: tuple[int, ...], seed: int, rate: int
) -> None:
    text = composed(*((9 + 0.02 * k, restart(index)) for k, index in enumerate(order)), seed=seed, rate=rate)
    found = triaged(text)
    assert (found.first.kind, found.first.node) == ("battery", None)
    assert found.first.title == "all ESCs restarted together: their supply was away"
    assert "4 ESCs start anew within" in said(found)


def test_escs_of_which_some_come_back_lost_their_supply_together() -> None:
    found = triaged(composed((9, restart(0, 2)), (9.05, power_off(1, 3))))
    assert (found.first.kind, found.first.node) == ("battery", None)
    assert "2 of them start anew, the others stay silent" in said(found)


def test_one_esc_without_power_and_soon_all_of_them_blames_nobody() -> None:
    happenings = [(9 + 0.2 * k, power_off(index)) for k, index in enumerate((2, 0, 3, 1))]
    found = triaged(composed(*happenings))
    assert found.first.kind == "unknown"
    assert dict(found.first.notes)["seen"].startswith("ESC ch3 (node 13): stopped reporting")


def test_one_esc_without_power_long_before_all_others_is_told() -> None:
    found = triaged(composed((9, power_off(2)), (11.5, power_off(0, 1, 3)), escs=8))
    assert (found.first.kind, found.first.ch) == ("wiring", 3)


@pytest.mark.parametrize(("rate", "seed"), [(10, 3), (30, 1), (50, 4)])
@pytest.mark.parametrize("hole", [-0.3, -0.01])
def test_an_esc_that_starts_anew_near_a_hole_does_not_limit_itself(hole: float, rate: int, seed: int) -> None:
    """Its uptime says so, whoever missed the moment."""
    found = triaged(composed((9 + hole, deafen(0.25)), (9, restart(3)), rate=rate, seed=seed))
    assert (found.first.kind, found.first.ch) in {("wiring", 4), ("unknown", None)}
    assert "limits itself" not in " ".join(one.title for one in found.verdicts)


def test_an_esc_that_restarts_twice_is_told_once() -> None:
    found = triaged(composed((9, restart(3)), (9.8, restart(3)), rate=10, escs=6, seed=3))
    assert [(one.kind, one.ch) for one in found.verdicts] == [("wiring", 4)]
    assert "restarted in flight" in found.first.title


@pytest.mark.parametrize(("rate", "seed"), [(10, 3), (50, 2)])
def test_a_stall_that_goes_on_behind_a_hole_is_one(rate: int, seed: int) -> None:
    found = triaged(composed((9, deafen(0.05)), (9, stall(2)), rate=rate, escs=8, seed=seed))
    assert (found.first.kind, found.first.ch) == ("esc", 3)


def test_escs_of_slow_reports_that_restart_together_do_not_limit_themselves() -> None:
    happenings = [(9.4 + 0.05 * k, restart(index)) for k, index in enumerate((2, 0, 5, 3, 1, 4))]
    found = triaged(composed(*happenings, escs=6, rate=10, seed=3))
    assert (found.first.kind, found.first.node) == ("battery", None)
    assert not any(one.kind == "esc" for one in found.verdicts)


def test_an_esc_whose_transfers_break_did_send() -> None:
    dice = Random(1)
    calm = composed()
    found = triaged(without(calm, lambda node, _, t: node == 12 and t > 5 and dice.random() < 0.3))
    assert "it did not send" not in said(found)
