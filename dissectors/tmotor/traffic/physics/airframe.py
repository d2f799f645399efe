"""The airframe that the motors carry: it rises and falls by their thrust, and wind pushes it about."""

from __future__ import annotations

from math import cos, exp, pi, sqrt
from typing import TYPE_CHECKING

from dissectors.records import dataclass
from dissectors.tmotor.traffic.physics.motor import DRAG, THRUST, TORQUE, WINDING

if TYPE_CHECKING:
    from random import Random

GRAVITY = 9.81
# Kilograms for each motor: it hovers at about half throttle.
LOAD = 4.0
# Air resistance of climbing, in kg/m for each motor.
_AIR = 0.4


@dataclass(slots=True)
class Airframe:
    """`height` in m above the ground, `climb` in m/s, with `motors` that carry it; `load` is its mass, 1 as planned."""

    motors: int
    height: float = 0.0
    climb: float = 0.0
    load: float = 1.0

    @property
    def weight(self) -> float:
        """Newton."""
        return LOAD * self.load * self.motors * GRAVITY

    def advance(self, seconds: float, thrust: float) -> None:
        """Move under the motors' thrust in N; the ground holds what falls."""
        mass = LOAD * self.load * self.motors
        air = _AIR * self.motors * self.climb * abs(self.climb)
        self.climb += ((thrust - air) / mass - GRAVITY) * seconds
        self.height += self.climb * seconds
        if self.height <= 0:
            self.height, self.climb = 0.0, max(0.0, self.climb)


class Wind:
    """Gusts about several axes: Ornstein-Uhlenbeck processes of standard deviation `strength`, exact over any step."""

    def __init__(self, random: Random, axes: int, strength: float, seconds: float = 0.6) -> None:
        self.now = [0.0] * axes
        self._random, self._strength, self._seconds = random, strength, seconds

    def advance(self, seconds: float) -> list[float]:
        """Return the gusts after so many seconds."""
        keep = exp(-seconds / self._seconds)
        fresh = self._strength * sqrt(1 - keep * keep)
        self.now = [keep * value + fresh * self._random.gauss(0, 1) for value in self.now]
        return self.now


def arms(motors: int) -> list[tuple[float, float, float]]:
    """Return how each motor takes part in roll, pitch and yaw; neighbours turn against each other."""
    if motors < 3:
        return [(0.0, 0.0, 0.0)] * motors
    angles = [2 * pi * (number + 0.5) / motors for number in range(motors)]
    return [(cos(angle), cos(angle - pi / 2), -1.0 if number % 2 else 1.0) for number, angle in enumerate(angles)]


def duty_for(thrust: float, voltage: float) -> float:
    """Return the duty cycle (0 to 1) for a thrust in N of one motor, at the voltage that one counts on."""
    speed = sqrt(max(0.0, thrust) / THRUST)
    return (speed * TORQUE + DRAG * speed * speed * WINDING / TORQUE) / voltage
