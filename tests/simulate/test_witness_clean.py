"""Flights without faults break no rule about values and packets, in any flight."""

from __future__ import annotations

from typing import Any

import pytest
from kit.simulated import clean
from witness import VALUES

SEED = 5
FLIGHTS: dict[str, dict[str, Any]] = {
    **{
        f"{plan}, {escs} ESCs": {"seconds": seconds, "flight": plan, "escs": escs}
        for plan, seconds in (("hover", 6), ("mission", 12), ("bench", 8), ("startup", 8))
        for escs in (4, 8)
    },
    "stock hover": {"seconds": 6, "flight": "hover", "escs": 4, "stock": True},
}
TUNED = {name for name in FLIGHTS if name != "stock hover"}
# What a healthy bus shows by nature: the rule, in which flights, why.
NATURAL: dict[str, tuple[set[str], str]] = {
    "TYP-208": (TUNED, "the ground station asks for all parameters"),
    "TYP-301": ({"stock hover"}, "stock DroneCAN has kelvin"),
}


@pytest.mark.slow
@pytest.mark.parametrize("name", FLIGHTS)
def test_a_clean_flight_breaks_no_rule(name: str) -> None:
    flight = clean(seed=SEED, **FLIGHTS[name])
    assert flight.key["faults"] == []
    broken = {rule for rule, find in VALUES.items() if find(flight.log)}
    assert broken == {rule for rule, (flights, _) in NATURAL.items() if name in flights}
