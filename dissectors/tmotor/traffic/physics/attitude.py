"""How the airframe turns about its axes, and the control loop that holds it level by the motors."""

from __future__ import annotations

from math import cos
from typing import TYPE_CHECKING

from dissectors.records import dataclass, field
from dissectors.tmotor.traffic.physics.motor import DRAG, THRUST

if TYPE_CHECKING:
    from collections.abc import Sequence

    from dissectors.tmotor.traffic.physics.motor import Motor

# Metres from the middle to a motor; inertia about roll and pitch, and about yaw, in kgm2 for each motor.
_ARM = 0.8
_INERTIA = (0.3, 0.3, 0.6)
# Shares of the throttle for a radian and for a radian a second, and the most that each axis takes.
_ANGLE_GAIN, _RATE_GAIN, _MOST = (0.35, 0.35, 0.5), (0.12, 0.12, 0.5), (1.0, 1.0, 0.3)
# Air slows rotation (1/s).
_DAMPING = 0.3
# Metres from the middle to the feet.
_GEAR = 0.25
# Beyond this angle (rad) nothing brings it back, and what touches the ground so is broken.
TIPPED = 1.2


@dataclass(slots=True)
class Attitude:
    """`angle` in rad and `rate` in rad/s about roll, pitch and yaw.

    `gain` scales what the control loop does, below zero it drives away from level; `disturbance` is a rotation that
    something other than the motors causes, in rad/s2, `trim` the shares of the throttle that are always there.
    """

    motors: Sequence[Motor]
    arms: Sequence[tuple[float, float, float]]
    angle: list[float] = field(default_factory=lambda: [0.0] * 3)
    rate: list[float] = field(default_factory=lambda: [0.0] * 3)
    gain: float = 1.0
    disturbance: tuple[float, float, float] = (0.0, 0.0, 0.0)
    trim: tuple[float, float, float] = (0.0, 0.0, 0.0)

    @property
    def upright(self) -> float:
        """The share of the thrust that carries; below zero if it flies on its back."""
        return cos(self.angle[0]) * cos(self.angle[1])

    @property
    def tipped(self) -> bool:
        """Whatever the motors do, it falls."""
        return max(abs(self.angle[0]), abs(self.angle[1])) > TIPPED

    def tips(self, resting: float) -> bool:
        """Return if the motors tip it over its landing gear, on which `resting` N of its weight still stand."""
        pushes = (abs(self._turning(axis)) * _ARM for axis in range(2))
        return max(pushes) > max(0.0, resting) * _GEAR

    def rest(self) -> None:
        """Stand on the ground, level."""
        self.angle, self.rate = [0.0] * 3, [0.0] * 3

    def advance(self, seconds: float) -> None:
        """Turn by the motors' thrust and drag."""
        count = len(self.motors)
        for axis in range(3):
            lever = _ARM if axis < 2 else DRAG / THRUST
            turning = self._turning(axis) * lever
            pushed = turning / (_INERTIA[axis] * count) + self.disturbance[axis] - _DAMPING * self.rate[axis]
            self.rate[axis] += pushed * seconds
            self.angle[axis] += self.rate[axis] * seconds

    def _turning(self, axis: int) -> float:
        return sum(motor.thrust * arm[axis] for motor, arm in zip(self.motors, self.arms, strict=True))

    def correction(self) -> tuple[float, ...]:
        """Return the shares of the throttle, about each axis, that turn it back to level."""
        wanted = (
            -self.gain * (_ANGLE_GAIN[axis] * self.angle[axis] + _RATE_GAIN[axis] * self.rate[axis])
            for axis in range(3)
        )
        return tuple(
            min(max(one, -most), most) + trim for one, most, trim in zip(wanted, _MOST, self.trim, strict=True)
        )
