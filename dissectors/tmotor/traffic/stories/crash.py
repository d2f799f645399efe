"""The common part of crash stories: the flight, older harmless faults, the impact, and the reversed order."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from dissectors.times import MILLISECOND, SECOND
from dissectors.tmotor.traffic.flights import cruise
from dissectors.tmotor.traffic.physics.airframe import arms
from dissectors.tmotor.traffic.physics.attitude import Attitude
from dissectors.tmotor.traffic.pilot import Pilot
from dissectors.traffic import SimulatedFrame

if TYPE_CHECKING:
    from collections.abc import Callable

    from dissectors.traffic import Story

# What all of them take: the impact with its consequences, control lost before the fault, harmless things before.
OPTIONS = ("tail", "twin", "distract")
_TAIL, _TWIN, _DISTRACT = 0.6, 0.0, 0.5
# The fault comes between these shares of the time, when the vehicle is up.
_FROM, _TO = 0.5, 0.62
_GUSTS = 0.015
# Control lost first: a filter that diverges, or rad/s2 that an arm or a moving load turns it with.
_DIVERGED, _TURNED = -1.0, 80.0
_OVER_TEMPERATURE = 1 << 5
_ERROR_FRAME, _COUNTERS = 0x088, 0x200


class CrashFlight:
    """A flight of motors that matter; the `failure` comes when it is up, and the ground ends it."""

    def __init__(self, story: Story) -> None:
        self.story, self.world, self.vehicle, self.random = story, story.world, story.vehicle, story.random
        vehicle = self.vehicle
        count, seconds = len(vehicle.escs), self.world.end / SECOND
        self.attitude = Attitude([esc.motor for esc in vehicle.escs], arms(count))
        vehicle.plan = Pilot(self.random, count, cruise(seconds), _GUSTS, self.attitude, self._impact)
        self.tail = story.choose("tail", _TAIL)
        self.twin = story.choose("twin", _TWIN)
        if story.choose("distract", _DISTRACT):
            self._distract()

    def any_esc(self) -> Any:
        """Return one of the ESCs."""
        return self.random.choice(self.vehicle.escs)

    def fail(self, failure: Callable[[], None], kind: str, knowable: tuple[str, ...] = (), esc: Any = None) -> None:
        """Let the failure happen in the air; it is of a kind, and a reader of the bus may also call it otherwise.

        In the twin control is lost first, so that the same failure is a consequence.
        """
        at = round(self.world.end * self.random.uniform(_FROM, _TO))

        def begin() -> None:
            if not self.twin:
                self._settle(kind, knowable, esc)
                failure()
                return
            self._settle("control", ("unknown",), None)
            self._lose_control()
            self.world.at(self.world.now + self.random.randrange(250, 600) * MILLISECOND, failure)

        self.world.at(at, begin)

    def lose_control(self) -> None:
        """Let the vehicle lose its attitude though every device is healthy."""
        self.fail(self._lose_control, "control", ("unknown",))

    def _settle(self, kind: str, knowable: tuple[str, ...], esc: Any) -> None:
        node, channel = (None, None) if esc is None else (esc.node.number, esc.index + 1)
        self.story.settle(kind, knowable, node=node, channel=channel)

    def _lose_control(self) -> None:
        if self.random.random() < 0.5:
            self.story.tell("the autopilot's filter diverges: it steers away from level")
            self.attitude.gain = _DIVERGED
        else:
            self.story.tell("something that is not on the bus turns the vehicle over")
            turn = self.random.choice((-1, 1)) * _TURNED
            self.attitude.disturbance = (turn, 0.5 * turn, 0.0)

    def _distract(self) -> None:
        """Let harmless things happen long before: a warning that goes again, frames that the recorder loses."""
        esc, at = self.any_esc(), round(self.world.end * self.random.uniform(0.3, 0.4))
        if self.random.random() < 0.5:
            span = self.random.randrange(200, 900) * MILLISECOND
            self.world.at(at, lambda: self._warn(esc, _OVER_TEMPERATURE))
            self.world.at(at + span, lambda: self._warn(esc, 0))
        else:
            self.world.at(at, lambda: self.world.deafen(self.world.now + self.random.randrange(20, 80) * MILLISECOND))

    @staticmethod
    def _warn(esc: Any, bits: int) -> None:
        esc.fault_bits = bits

    def _impact(self) -> None:
        """Let the ground do what it does: rotors stall, the wire tears, the voltage breaks down, somebody disarms."""
        story, world, random = self.story, self.world, self.random
        story.tell("impact")
        if not self.tail:
            world.stop()
            return
        hit = random.sample(self.vehicle.escs, random.randint(1, max(1, len(self.vehicle.escs) // 2)))
        for esc in hit:
            esc.motor.blocked = True
        if random.random() < 0.6:
            self._tear(random.randrange(5, 40))
        if random.random() < 0.5:
            self.vehicle.pack.resistance *= 2
            esc, at = random.choice(hit), world.now + random.randrange(50, 300) * MILLISECOND
            if not esc.node.silent:
                world.at(at, esc.restart)
        world.at(world.now + random.randrange(300, 2000) * MILLISECOND, self._disarm)
        if random.random() < 0.5:
            world.at(world.now + random.randrange(100, 3000) * MILLISECOND, world.stop)

    def _disarm(self) -> None:
        self.story.tell("crash check: the autopilot disarms")
        self.vehicle.plan.disarm()

    def _tear(self, left: int) -> None:
        """Let the recorder see so many error frames, a few milliseconds apart."""
        world = self.world
        world.put([SimulatedFrame(_ERROR_FRAME | _COUNTERS, bytes((0, 0, 4, 0, 0, 0, 0, 40)), error=True)])
        if left > 1:
            world.at(world.now + self.random.randrange(2, 9) * MILLISECOND, lambda: self._tear(left - 1))
