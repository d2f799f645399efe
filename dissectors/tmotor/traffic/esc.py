"""One ESC on the bus: a motor controller, what it reports, and its restarts."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from dissectors.times import MILLISECOND, SECOND
from dissectors.tmotor.traffic.control import MotorControl
from dissectors.tmotor.traffic.motor_controller import MotorController
from dissectors.tmotor.traffic.operation import OFF, Operation
from dissectors.tmotor.traffic.reports import Reports
from dissectors.tmotor.traffic.throttle import Throttle

if TYPE_CHECKING:
    from random import Random

    from dissectors.tmotor.traffic.rates import Rates
    from dissectors.traffic import BusNode, World

_BOOT = 300 * MILLISECOND


def unique_ids(random: Random, count: int) -> list[int]:
    """Return 32-bit IDs, all different; no byte is 0x00 or 0xFF, which mean something else (4.4.2 explanation 1)."""
    found: list[int] = []
    while len(found) < count:
        uuid = int.from_bytes(bytes(random.randrange(1, 255) for _ in range(4)), "little")
        if uuid not in found:
            found.append(uuid)
    return found


class Esc(MotorController):
    """A motor controller with its `reports`."""

    def __init__(self, world: World, node: BusNode, index: int, uuid: int, rates: Rates, *, stock: bool) -> None:
        super().__init__(world, node, index, uuid, rates, stock=stock)
        self.reports = Reports(self, rates)

    def apply(self, parameters: dict[str, Any]) -> None:
        """Apply parameters that were set: a new report rate takes effect with the next report."""
        rate = parameters["esc_fdb_rate"]
        if rate != self.parameters["esc_fdb_rate"]:
            self.status_period = SECOND // rate if rate else 0
        self.parameters = parameters

    def shift_frame_count(self, by: int) -> None:
        """Shift the frame count of its next packet by so many."""
        self.reports.frame_count += by

    def restart(self) -> None:
        """Cycle the power: counters start from zero, and for a moment it is not there."""
        self.node.restart()
        self.reports.restart()
        self.power_on_count += 1
        self.parameters["esc_startup_times"] += 1
        self.throttle, self.operation, self.control = Throttle(), Operation(), MotorControl()
        self.operation.release(self.motor)
        self.operation.mode = OFF
        self.node.silent = True
        self.world.at(self.world.now + _BOOT, self.wake)

    def wake(self) -> None:
        """Speak (again)."""
        self.node.silent = False
