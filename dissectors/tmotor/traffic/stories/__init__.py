"""Crashes, near misses and healthy flights of a vehicle that turns as its motors push it, with the cause in the key."""

from __future__ import annotations

from dissectors.tmotor.traffic.stories import bus, commands, healthy, motors, nodes, recordings, setups, supply

SCENARIOS = tuple(
    scenario
    for part in (motors, supply, nodes, bus, commands, setups, recordings, healthy)
    for scenario in part.SCENARIOS
)
