"""Faults that several transfers show: an ESC's habits, what happens to it over seconds, counters and sequences."""

from __future__ import annotations

from itertools import pairwise
from typing import TYPE_CHECKING

import pytest
from kit.simulated import Flown, codes, faulted, word

from dissectors.times import SECOND
from dissectors.tmotor.traffic.float16 import printed

if TYPE_CHECKING:
    from dissectors.traffic import Sending


def test_the_printed_encoder_is_high_and_coarse() -> None:
    """5.2 as it stands: 25.0 becomes 25.125, 298.15 becomes 300.0, 0.0 becomes 4.77e-7."""
    assert [printed(value) for value in (25.0, 298.15)] == [25.125, 300.0]
    assert printed(0.0) == pytest.approx(4.77e-7, rel=1e-3)
    seen = faulted("TYP-009", seconds=4.0)
    shown = seen.shown("TYP-009")
    assert len(shown) >= 50
    assert not any(code & 7 for one in shown for code in codes(one))
    assert shown == seen.of("ESCStatus", shown[0].node), "from the first transfer of the capture on"


def test_a_kelvin_node_is_one_from_the_first_transfer_on() -> None:
    seen = faulted("TYP-301:node=12")
    assert seen.shown("TYP-301") == seen.of("ESCStatus", 12)
    assert all(one.values["temperature"] < 100 for one in seen.of("ESCStatus", 13))


def test_a_counting_node_speaks_like_a_stock_one() -> None:
    seen = faulted("TYP-307:node=12")
    counts = [word(one) for one in seen.of("ESCStatus", 12)]
    assert counts == sorted(counts)
    steps = {after - before for before, after in pairwise(counts)}
    assert {0} <= steps <= {0, 1, 2}
    assert len(set(counts)) >= 3
    assert not seen.of("PUSHCAN", 12) + seen.of("ParamGet", 12)
    assert seen.of("PUSHCAN", 13)
    assert seen.of("ParamGet", 13)


def test_an_esc_that_overheats_does_so_over_seconds() -> None:
    seen = faulted("TYP-305@2.5:node=12", seconds=8.0)
    told = seen.of("ESCStatus", 12)
    hot = seen.shown("TYP-305")
    rise = [one.values["temperature"] for one in told if 2.5 * SECOND <= one.t <= hot[0].t]
    assert hot[0].t - 2.5 * SECOND > 1.5 * SECOND, "it takes its time"
    assert max(b - a for a, b in pairwise(rise)) < 4.0, "degrees between two reports"
    limit = seen.simulation.vehicle.escs[1].parameters["esc_ot_threshold"]
    assert rise[0] < 60 < limit <= hot[0].values["temperature"] + 1
    assert max(one.values["temperature"] for one in told) < limit + 15
    assert [one for one in told if word(one) & 0xFFF] == hot


def test_an_esc_in_error_mode_stands_still_and_says_why() -> None:
    seen = faulted("TYP-306@2.5:node=12")
    shown = seen.shown("TYP-306")
    assert {word(one) & 0xFFF for one in shown} == {1 << 7}
    assert {abs(one.values["rpm"]) for one in shown} == {0}
    last = seen.of("ESCStatus", 12)[-1]
    assert word(last) >> 12 & 15 in (3, 4), "it starts again"
    assert abs(last.values["rpm"]) > 300


def pairs(seen: Flown, name: str, node: int) -> list[tuple[Sending, Sending]]:
    sent = seen.of(name, node)
    return list(pairwise(sent))


@pytest.mark.parametrize(("order", "step"), [("TYP-501", 5), ("TYP-501:missing=1", 2), ("TYP-502", 0)])
def test_a_sequence_goes_wrong_once(order: str, step: int) -> None:
    seen = faulted(order)
    (wrong,) = seen.shown(order[:7])
    steps = {
        after: after.values["data_sequence"] - one.values["data_sequence"]
        for one, after in pairs(seen, "PUSHCAN", wrong.node)
    }
    assert steps.pop(wrong) == step
    assert set(steps.values()) == {1}
    before = next(one for one, after in pairs(seen, "PUSHCAN", wrong.node) if after is wrong)
    assert wrong.values["data"] != before.values["data"]


def test_a_sequence_starts_again_from_zero() -> None:
    seen = faulted("TYP-503:type=PUSHSCI")
    (wrong,) = seen.shown("TYP-503")
    assert wrong.values["data_sequence"] == 0
    assert [after.values["data_sequence"] for one, after in pairs(seen, "PUSHSCI", 125) if one is wrong] == [1]


def test_an_empty_packet_has_its_own_place_in_the_sequence() -> None:
    seen = faulted("TYP-504")
    (empty,) = seen.shown("TYP-504")
    numbers = [one.values["data_sequence"] for one in seen.of("PUSHCAN", empty.node)]
    assert numbers == list(range(len(numbers)))


def test_a_lifetime_counter_falls_and_stays_behind() -> None:
    seen = faulted("TYP-402:node=12:by=7", seconds=8.0)
    (wrong,) = seen.shown("TYP-402")
    series = [one.values["esc_startup_times"] for one in seen.of("ParamGet", 12)]
    at = seen.of("ParamGet", 12).index(wrong)
    assert at > 0
    assert series == [series[0]] * at + [series[0] - 7] * (len(series) - at)


def test_two_nodes_have_one_uuid() -> None:
    seen = faulted("TYP-403:node=13")
    (wrong,) = seen.shown("TYP-403")
    assert wrong.node == 13
    others = {one.values["esc_uuid"] for one in seen.of("ParamGet") if one.node != 13 and one.t < wrong.t}
    assert wrong.values["esc_uuid"] in others
    alone = faulted("TYP-403", escs=1)
    (other,) = alone.shown("TYP-403")
    assert {one.values["esc_uuid"] for one in alone.of("ParamGet") if one is not other}.isdisjoint(
        {other.values["esc_uuid"]}
    )
