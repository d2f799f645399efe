"""Traffic with known faults: a bus, a vehicle on it, faults that are asked for, and a key that says where they are.

Nothing in here decodes: payloads, frames, arbitration and stuffing are a sender's, written apart from the analyzer that
they are to test. What a vendor's devices do comes from the vendor's folder, in the terms of `dissectors.traffic`.
"""

from __future__ import annotations

from analyzer.simulate.settings import START, SimulationSettings
from analyzer.simulate.simulation import Simulation

__all__ = ["START", "Simulation", "SimulationSettings"]
