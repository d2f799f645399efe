"""A vehicle with T-Motor ESCs as it talks on its bus, the faults of its fields and the stories of its failures."""

from __future__ import annotations

from dissectors.tmotor.traffic.faults import FAULTS
from dissectors.tmotor.traffic.rates import BUS_RATES
from dissectors.tmotor.traffic.scenarios import SCENARIOS
from dissectors.tmotor.traffic.vehicle import PROFILES, Vehicle, Wishes, build

__all__ = ["BUS_RATES", "FAULTS", "PROFILES", "SCENARIOS", "Vehicle", "Wishes", "build"]
