"""The autopilot's control loop: throttles that carry the airframe through its legs against the wind."""

from __future__ import annotations

from operator import add
from typing import TYPE_CHECKING

from dissectors.tmotor.traffic.flights import IDLE_THROTTLE, Leg
from dissectors.tmotor.traffic.physics.airframe import GRAVITY, LOAD, Airframe, Wind, duty_for

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence
    from random import Random

    from dissectors.tmotor.traffic.physics.attitude import Attitude

# What it counts on; the real voltage is what its integral makes good.
_VOLTAGE = 46.0
_HEIGHT_GAIN, _CLIMB_GAIN, _INTEGRAL_GAIN = 1.6, 2.4, 0.5
_LEAST, _MOST = 0.1, 0.95
# Metres a second: the ground breaks what comes down faster.
_HARD = 2.5


class Pilot:
    """Flies `legs` with motors at the arms of a `geometry`; where these have no lever only the height is controlled.

    With an `attitude` the airframe also turns as its motors push it, and `crashed` is called when it hits the ground.
    """

    def __init__(
        self,
        random: Random,
        geometry: Sequence[tuple[float, float, float]],
        legs: Sequence[Leg],
        gusts: float,
        attitude: Attitude | None = None,
        crashed: Callable[[], object] = lambda: None,
    ) -> None:
        self.airframe = Airframe(len(geometry))
        self.attitude = attitude
        self._crashed: Callable[[], object] | None = crashed
        self._legs, self._at = legs, 0
        self._arms = geometry
        self._wind = Wind(random, 4, gusts)
        self._goal = self._sum = 0.0

    def throttles(self, seconds: float, step: float, thrust: float) -> list[float]:
        """Return throttles (0 to 1) for the time `seconds`; `thrust` (N) is what all motors gave in the last `step`."""
        legs = self._legs
        while self._at + 1 < len(legs) and legs[self._at + 1].start <= seconds:
            self._at += 1
        leg = legs[self._at]
        roll, pitch, yaw, lift = self._wind.advance(step)
        self._move(step, thrust * (1 + lift))
        landed = leg.height < 0 and not self.airframe.height
        if leg.state != "fly" or landed:
            self._goal = self._sum = 0.0
            return [0.0 if leg.state == "off" else IDLE_THROTTLE] * len(self._arms)
        base = duty_for(self._lift(leg, step), _VOLTAGE)
        share = (roll + leg.roll, pitch + leg.pitch, 0.5 * yaw + leg.yaw)
        if self.attitude is not None:
            share = tuple(map(add, share, self.attitude.correction()))
        mixed = (1 + share[0] * arm[0] + share[1] * arm[1] + share[2] * arm[2] for arm in self._arms)
        return [min(max(base * part, _LEAST), _MOST) for part in mixed]

    def disarm(self) -> None:
        """Switch the motors off for good."""
        self._legs, self._at = [Leg(0.0)], 0

    def _move(self, step: float, thrust: float) -> None:
        """Move under the motors' thrust, turned as the airframe is."""
        airframe, attitude = self.airframe, self.attitude
        if attitude is None:
            airframe.advance(step, thrust)
            return
        sinking = -airframe.climb
        airframe.advance(step, thrust * attitude.upright)
        turning = airframe.height > 0 or attitude.tips(airframe.weight - thrust)
        if turning:
            attitude.advance(step)
        if airframe.height:
            return
        if self._crashed is not None and (sinking > _HARD or attitude.tipped):
            crashed, self._crashed = self._crashed, None
            crashed()
        elif self._crashed is not None and not turning:
            attitude.rest()

    def _lift(self, leg: Leg, step: float) -> float:
        """Return the thrust in N of one motor that follows the height of the leg."""
        way = min(max(leg.height - self._goal, -leg.climb * step), leg.climb * step)
        self._goal += way
        error = self._goal - self.airframe.height
        self._sum = min(max(self._sum + error * step, -4.0), 4.0)
        push = _HEIGHT_GAIN * error + _CLIMB_GAIN * (way / step - self.airframe.climb) + _INTEGRAL_GAIN * self._sum
        return LOAD * self.airframe.load * (GRAVITY + min(max(push, -3.0), 5.0))
