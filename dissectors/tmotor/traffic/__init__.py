"""A vehicle with T-Motor ESCs as it talks on its bus, the faults of its fields and the stories of its failures."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from dissectors.traffic import MILLISECOND, Fault, Scenario, World

FAULTS: tuple[Fault, ...] = ()
SCENARIOS: tuple[Scenario, ...] = ()
PROFILES = ("hover", "mission", "bench", "startup")


@dataclass(frozen=True, slots=True)
class Wishes:
    """What vehicle is wanted: `profile` one of `PROFILES`, `rate` of ESCStatus in Hz, `stock` without T-Motor types."""

    profile: str = "hover"
    escs: int = 4
    rate: int = 30
    stock: bool = False


class Vehicle:
    def __init__(self, world: World, wishes: Wishes) -> None:
        self.autopilot = world.device(10, "org.example.autopilot")
        self.escs = [world.device(11 + index, "com.tmotor.esc") for index in range(wishes.escs)]
        world.every(5 * MILLISECOND // 2, lambda: self.autopilot.send("RawCommand", {"cmd": [1000] * wishes.escs}))
        for index, esc in enumerate(self.escs):
            world.every(1_000_000_000 // wishes.rate, lambda index=index, esc=esc: esc.send("ESCStatus", {"error_count": 4<<12, "voltage": 48.0, "current": 1.0, "temperature": 40.0, "rpm": 3000, "power_rating_pct": 40, "esc_index": index}), 1000*index)

    def describe(self) -> dict[str, Any]:
        return {}


def build(world: World, wishes: Wishes) -> Vehicle:
    return Vehicle(world, wishes)
