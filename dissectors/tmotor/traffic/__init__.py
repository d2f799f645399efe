"""A vehicle with T-Motor ESCs as it talks on its bus, the faults of its fields and the stories of its failures."""

from __future__ import annotations

from typing import TYPE_CHECKING

from dissectors.tmotor.traffic.faults import FAULTS
from dissectors.tmotor.traffic.rates import BUS_RATES
from dissectors.tmotor.traffic.requests import plan_requests
from dissectors.tmotor.traffic.scenarios import SCENARIOS as FAILURES
from dissectors.tmotor.traffic.stories import SCENARIOS as STORIES
from dissectors.tmotor.traffic.vehicle import FLIGHT_PLANS, SimulatedVehicle, VehicleRequest

if TYPE_CHECKING:
    from dissectors.traffic import World

__all__ = ["BUS_RATES", "FAULTS", "FLIGHT_PLANS", "SCENARIOS", "SimulatedVehicle", "VehicleRequest", "build"]

SCENARIOS = (*FAILURES, *STORIES)


def build(world: World, request: VehicleRequest) -> SimulatedVehicle:
    """Return the vehicle that is wanted, on the bus of `world`."""
    return SimulatedVehicle(world, request, plan_requests)
