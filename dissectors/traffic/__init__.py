"""The vocabulary of simulated traffic: what a vehicle sends, and what can be done to it on the way.

A dissector's folder may hold a vehicle and the faults of its own fields; `analyzer.simulate` runs them. Both sides
speak in the terms below, so that neither imports the other. Times are integer nanoseconds from the simulation's start.
"""

from __future__ import annotations

from dissectors.traffic.bus import LOWEST, Answer, BusNode, Code, Sending, SimulatedFrame, Values, World, next_id
from dissectors.traffic.faults import Case, Fault, Fits, Setting, Start, Step, Touch, change, of
from dissectors.traffic.stories import Scenario, Story, Truth

__all__ = [
    "LOWEST", "Answer", "BusNode", "Case", "Code", "Fault", "Fits", "Scenario", "Sending", "Setting", "SimulatedFrame",
    "Start", "Step", "Story", "Touch", "Truth", "Values", "World", "change", "next_id", "of",
]  # fmt: skip
