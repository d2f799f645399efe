"""Two captures of one flight: nodes that moved, other buses, parts of it, stray times."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import pytest
from kit.simulated import changed as flight
from kit.simulated import unchanged

if TYPE_CHECKING:
    from collections.abc import Callable

    from analyzer import CaptureDiff
    from dissectors.traffic import Sending

    Compare = Callable[..., CaptureDiff]

START = 1_773_475_330
HOT = 13


def seconds(t: int | None) -> float:
    assert t is not None
    return t / 1e9 - START


# ---- who is who ------------------------------------------------------------------------------------------------------


SWAPPED = {12: 13, 13: 12}


def exchanged(sending: Sending, _: int) -> dict[str, Any]:
    return {"src": SWAPPED[sending.node]} if sending.node in SWAPPED else {}


def moved(sending: Sending, _: int) -> dict[str, Any]:
    return {"src": 33} if sending.node == HOT else {}


@pytest.mark.slow
def test_exchanged_nodes_are_compared_with_themselves(compare: Compare) -> None:
    found = compare(flight(), flight(exchanged))
    pairs = [(one.good, one.bad) for one in found.differences if one.kind == "exchange"]
    assert sorted(pairs) == [("12 (ch2)", "13 (ch2)"), ("13 (ch3)", "12 (ch3)")]
    assert {(one.node, one.bad_node) for one in found.matched if one.reason == "unique ID"} == {(12, 13), (13, 12)}
    assert not [one for one in found.differences if one.kind in ("hardware", "node", "telemetry")]


def test_a_moved_node_is_neither_missing_nor_new(compare: Compare) -> None:
    found = compare(flight(), flight(moved))
    assert [one.bad for one in found.differences if one.kind == "exchange"] == ["33 (ch3)"]
    assert not [one for one in found.differences if one.kind == "node"]


def test_another_name_of_the_bus_is_the_same_bus(compare: Compare) -> None:
    found = compare(flight(), flight(bus="slcan7"))
    assert found.differences == ()
    assert found.remarks == ("bus can0 of the first capture is taken for slcan7 of the second",)


def test_another_time_and_length_show_nothing(compare: Compare) -> None:
    lines = flight().splitlines(keepends=True)
    later = "".join(f"({float(line[1:18]) + 86_400 * 30:.6f}{line[18:]}" for line in lines[: len(lines) * 3 // 4])
    found = compare(flight(), later)
    assert [one for one in found.differences if one.weight != "note"] == []


# ---- times and lengths -----------------------------------------------------------------------------------------------


@pytest.mark.sampled(4)
@pytest.mark.parametrize(("row", "wrong"), [(0, 1.0), (6000, START - 3600), (6000, START + 1e6)])
def test_a_stray_time_stamp_rules_no_order(compare: Compare, row: int, wrong: float) -> None:
    """All but what it breaks itself is as without it."""
    lines = flight(unchanged, 1, "TYP-306@8:node=13").splitlines(keepends=True)
    place = float(lines[row][1:18])
    stray = "".join(f"({wrong:.6f}{line[18:]}" if k == row else line for k, line in enumerate(lines))
    usual, found = compare(flight(), "".join(lines)), compare(flight(), stray)
    rules = {*(one.rule for one in found.differences)} - {*(one.rule for one in usual.differences)}
    assert rules <= {"CAP-001", "CAP-002", "TRF-005", "TRF-006", "TRF-007", "TRF-027"}
    own = [one for one in found.differences if one.rule in rules - {""}]
    assert all(seconds(one.t_ns) == pytest.approx(place - START, abs=0.1) for one in own)
    rest = [(one.what, one.node, one.since) for one in found.differences if one not in own]
    assert rest == [(one.what, one.node, one.since) for one in usual.differences]
    assert (found.bad.start_ns, found.bad.end_ns) == pytest.approx((usual.bad.start_ns, usual.bad.end_ns), abs=1e6)
    assert any(text.startswith("1 time stamp of the second capture") for text in found.cannot)


@pytest.mark.parametrize(
    "share", [0.5, pytest.param(0.25, marks=pytest.mark.slow), pytest.param(0.9, marks=pytest.mark.slow)]
)
def test_a_part_of_a_capture_is_like_it(compare: Compare, share: float) -> None:
    """That it ends in flight is no difference to the rest of the same flight, as it is to another one."""
    lines = flight().splitlines(keepends=True)
    part = "".join(lines[: round(len(lines) * share)])
    for found in (compare(flight(), part), compare(part, flight())):
        assert found.differences == ()
        assert "is the beginning of the" in " ".join(found.remarks)
    later = "".join(f"({float(line[1:18]) + 86_400:.6f}{line[18:]}" for line in part.splitlines(keepends=True))
    cut = set() if share == 0.25 else {"TRF-008"}
    assert {one.rule for one in compare(flight(), later).differences} == cut
