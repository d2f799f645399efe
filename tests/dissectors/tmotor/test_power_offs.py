"""ESCs that are switched off after landing, and requests to them."""

from __future__ import annotations

import pytest
from kit.flight import Vehicle, found, node_status
from kit.judged import whole

NODES = (11, 12, 13, 14)


def landed(*, rpm: int = 0, last: float = 3000, apart: float = 20, stays: int = 0) -> Vehicle:
    """Four ESCs report up to a time, each a little longer than the one before; the autopilot goes on."""
    vehicle = Vehicle()
    for k in range(90):
        vehicle.send(k * 100 + 3, "uavcan.protocol.NodeStatus", 1, node_status(k * 100))
    for k, node in enumerate(NODES):
        vehicle.statuses(k, 9000 if node == stays else last + k * apart, node, rpm=rpm)
    return vehicle


def test_escs_that_fall_silent_together_at_rest_were_switched_off() -> None:
    said = whole(landed().finish(), ("BUS-042", "BUS-025"), (7,))
    assert [(one.rule, one.severity) for one in said if one.rule == "BUS-025"] == [("BUS-025", "note")] * 4
    off = [one for one in said if one.rule == "BUS-042"]
    assert [(one.node, one.severity) for one in off] == [(node, "note") for node in NODES]
    assert off[0].text == "4 ESCs silent together at 0 rpm, 5.9 s to the end"


@pytest.mark.parametrize("what", [{"rpm": 900}, {"apart": 2000}, {"stays": 14}, {"last": 8500}])
def test_escs_that_turn_or_go_one_by_one_have_dropped_out(what: dict[str, int]) -> None:
    vehicle = landed(**what)
    assert found(vehicle, "BUS-042") == []
    assert {one.severity for one in found(vehicle, "BUS-025")} <= {"warning"}


def test_who_is_switched_off_owes_no_answer() -> None:
    off, on = landed(), landed(last=8990)
    for vehicle in (off, on):
        vehicle.configure(6500, esc_index=0, esc_timing=15)
        vehicle.send(6500, "uavcan.protocol.GetNodeInfo.Request", 1, {}, dst=11)
    rules = ("BUS-011", "TRF-022")
    assert whole(off.finish(), rules, (7,)) == []
    assert {one.rule for one in whole(on.finish(), rules, (7,))} == set(rules)
