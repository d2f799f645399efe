"""Crashes and near misses of a vehicle that turns as its motors push it, with the true cause of each in the key."""

from __future__ import annotations

from dissectors.tmotor.traffic.stories import commands, motors, nodes, supply

SCENARIOS = (*motors.SCENARIOS, *supply.SCENARIOS, *nodes.SCENARIOS, *commands.SCENARIOS)
