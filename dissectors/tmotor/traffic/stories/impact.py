"""The work of the ground: rotors stall, the wire tears, the voltage breaks down, somebody disarms."""

from __future__ import annotations

from math import sqrt
from typing import TYPE_CHECKING

from dissectors.times import MILLISECOND
from dissectors.tmotor.traffic.physics.motor import WINDING
from dissectors.traffic import SimulatedFrame

if TYPE_CHECKING:
    from dissectors.traffic import Story

_TORN, _BROWN_OUT, _CUT = 0.6, 0.5, 0.5
_ERROR_FRAME, _COUNTERS = 0x088, 0x200
# Amperes that stalled rotors take together if their ESCs do not limit them: the voltage of all breaks down.
_DRAWN = (250.0, 450.0)
# ESCs warn below so many volts a cell.
_LOW_CELL = 3.45
_UNDER_VOLTAGE = 1 << 1
_LOOK = 20 * MILLISECOND


class Impact:
    """The impact with its `tail`; without one the recording ends there."""

    def __init__(self, story: Story, *, tail: bool) -> None:
        self.story, self.world, self.vehicle, self.random = story, story.world, story.vehicle, story.random
        self.tail = tail

    def happen(self) -> None:
        """Let it happen now."""
        story, world, random = self.story, self.world, self.random
        story.tell("impact")
        if not self.tail:
            world.stop()
            return
        hit = random.sample(self.vehicle.escs, random.randint(1, max(1, len(self.vehicle.escs) // 2)))
        for esc in hit:
            esc.motor.blocked = True
        if random.random() < _TORN:
            tear(story, random.randrange(5, 40))
        if random.random() < _BROWN_OUT:
            amperes = random.uniform(*_DRAWN) / len(hit)
            for esc in hit:
                esc.motor.most = sqrt(amperes * esc.motor.voltage / WINDING)
            self._warn()
            esc, at = random.choice(hit), world.now + random.randrange(50, 300) * MILLISECOND
            if not esc.node.silent:
                world.at(at, esc.restart)
        world.at(world.now + random.randrange(300, 2000) * MILLISECOND, self._disarm)
        if random.random() < _CUT:
            world.at(world.now + random.randrange(100, 3000) * MILLISECOND, world.stop)

    def _warn(self) -> None:
        """Let every ESC say what its voltage is below."""
        low = _LOW_CELL * self.vehicle.pack.cells
        for esc in self.vehicle.escs:
            esc.fault_bits = esc.fault_bits & ~_UNDER_VOLTAGE | (_UNDER_VOLTAGE if esc.motor.voltage < low else 0)
        self.world.at(self.world.now + _LOOK, self._warn)

    def _disarm(self) -> None:
        self.story.tell("crash check: the autopilot disarms")
        self.vehicle.plan.disarm()


def tear(story: Story, left: int) -> None:
    """Let the recorder see so many error frames, a few milliseconds apart."""
    world = story.world
    world.put([SimulatedFrame(_ERROR_FRAME | _COUNTERS, bytes((0, 0, 4, 0, 0, 0, 0, 40)), error=True)])
    if left > 1:
        world.at(world.now + story.random.randrange(2, 9) * MILLISECOND, lambda: tear(story, left - 1))
