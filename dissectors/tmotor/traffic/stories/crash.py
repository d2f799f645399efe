"""The common part of stories: the flight, older harmless faults, the impact, and the reversed order."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from dissectors.times import MILLISECOND, SECOND
from dissectors.tmotor.traffic.flights import cruise
from dissectors.tmotor.traffic.physics.airframe import arms
from dissectors.tmotor.traffic.physics.attitude import Attitude
from dissectors.tmotor.traffic.pilot import Pilot
from dissectors.tmotor.traffic.stories.impact import Impact, tear

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from dissectors.tmotor.traffic.flights import Leg
    from dissectors.traffic import Story

# What all of them take: the impact with its consequences, control lost before the fault, harmless things before, and
# a firmware that sets no fault bits.
OPTIONS = ("tail", "twin", "distract", "mute")
_TAIL, _TWIN, _DISTRACT, _MUTE = 0.6, 0.0, 0.5, 0.0
_BITS = 0xFFF
# The fault comes between these shares of the time, when the vehicle is up.
_FROM, _TO = 0.5, 0.62
_GUSTS = 0.015
# No two motors and propellers are alike: by so much of their torque and thrust.
_UNLIKE = 0.04
# Control lost first: a filter that diverges, or rad/s2 that an arm or a moving load turns it with.
_DIVERGED, _TURNED = -1.0, 80.0
# The commands show it within this time (s), and from this angle (rad) on beyond doubt.
SHOWN, _AWAY = 1.2, 0.4
_LOOK = 10 * MILLISECOND
# A loose contact of a temperature sensor reads so many K too much.
_LOOSE = 110.0
# Reports a second that are too few to say what came first, or that something was at all.
_SLOW = 20


class StoryFlight:
    """A flight of motors that matter; a `failure` comes when it is up, and the ground ends it.

    `legs` are those of a climb without landing, and `geometry` a ring of arms, unless something else is given. The
    flight that fails begins at `begin` (s).
    """

    def __init__(
        self,
        story: Story,
        legs: Sequence[Leg] | None = None,
        geometry: Sequence[tuple[float, float, float]] | None = None,
        begin: float = 0.0,
    ) -> None:
        self.story, self.world, self.vehicle, self.random = story, story.world, story.vehicle, story.random
        vehicle = self.vehicle
        self._begin = round(begin * SECOND)
        count, seconds = len(vehicle.escs), self.world.end / SECOND
        for esc in vehicle.escs:
            esc.motor.load *= self.random.uniform(1 - _UNLIKE, 1 + _UNLIKE)
            esc.motor.lift *= self.random.uniform(1 - _UNLIKE, 1 + _UNLIKE)
        geometry = arms(count) if geometry is None else geometry
        self.attitude = Attitude([esc.motor for esc in vehicle.escs], geometry)
        legs = cruise(seconds) if legs is None else legs
        self.tail = story.choose("tail", _TAIL)
        impact = Impact(story, tail=self.tail)
        vehicle.plan = Pilot(self.random, geometry, legs, _GUSTS, self.attitude, impact.happen)
        self.twin = story.choose("twin", _TWIN)
        self.slow = vehicle.rate < _SLOW
        if story.choose("distract", _DISTRACT):
            self._distract()
        self.mute = story.choose("mute", _MUTE)
        if self.mute:
            for esc in vehicle.escs:
                esc.hidden = _BITS

    def any_esc(self) -> Any:
        """Return one of the ESCs."""
        return self.random.choice(self.vehicle.escs)

    def fail(
        self,
        failure: Callable[[], None],
        kind: str,
        also: tuple[str, ...] = (),
        escs: Sequence[Any] = (),
        within: float = 0.2,
    ) -> None:
        """Let the failure happen in the air; it is of a kind, and a reader of the bus may also call it otherwise.

        The bus shows it `within` so many seconds. In the twin control is lost first, so that the same failure is a
        consequence.
        """
        at = self._begin + round((self.world.end - self._begin) * self.random.uniform(_FROM, _TO))

        def start() -> None:
            if not self.twin:
                self.settle(kind, (kind, *also), escs, within)
                failure()
                return
            self.settle("control", ("control",), (), SHOWN)
            self.turn_over()
            self.when_away(failure)

        self.world.at(at, start)

    def lose_control(self) -> None:
        """Let the vehicle lose its attitude though every device is healthy."""
        self.fail(self.turn_over, "control", within=SHOWN)

    def settle(self, kind: str, knowable: tuple[str, ...], escs: Sequence[Any] = (), within: float = 0.0) -> None:
        """Tell the cause; with few reports a second nothing may be right but that it cannot be told."""
        if self.slow and kind != "none" and "unknown" not in knowable:
            knowable = (*knowable, "unknown")
        period = 0 if not self.vehicle.rate else SECOND // self.vehicle.rate
        self.story.settle(
            kind,
            knowable,
            nodes=tuple(esc.node.number for esc in escs),
            channels=tuple(sorted({esc.index + 1 for esc in escs})),
            within=round(within * SECOND) + 2 * period,
        )

    def turn_over(self) -> None:
        """Let the filter diverge, or let something that is not on the bus turn the vehicle."""
        if self.random.random() < 0.5:
            self.story.tell("the autopilot's filter diverges: it steers away from level")
            self.attitude.gain = _DIVERGED
        else:
            self.story.tell("something that is not on the bus turns the vehicle over")
            turn = self.random.choice((-1, 1)) * _TURNED
            self.attitude.disturbance = (turn, 0.5 * turn, 0.0)

    def when_away(self, then: Callable[[], None]) -> None:
        """Go on once the commands show that control is lost."""
        if max(map(abs, self.attitude.angle[:2])) < _AWAY:
            self.world.at(self.world.now + _LOOK, lambda: self.when_away(then))
        else:
            self.world.at(self.world.now + self.random.randrange(20, 300) * MILLISECOND, then)

    def _distract(self) -> None:
        """Let a harmless thing happen long before: a sensor's loose contact, lost frames, some noise on the wire."""
        esc, at = self.any_esc(), round(self.world.end * self.random.uniform(0.3, 0.4))
        what, span = self.random.randrange(3), self.random.randrange(200, 900) * MILLISECOND
        if what == 0:
            self.world.at(at, lambda: self._misread(esc, _LOOSE))
            self.world.at(at + span, lambda: self._misread(esc, -_LOOSE))
        elif what == 1:
            self.world.at(at, lambda: self.world.deafen(self.world.now + span // 10))
        else:
            self.world.at(at, lambda: tear(self.story, 3))

    @staticmethod
    def _misread(esc: Any, kelvin: float) -> None:
        esc.motor.temperature += kelvin
