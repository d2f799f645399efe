"""One motor with its propeller and the heat of its ESC: first-order systems, advanced exactly over any step.

Speeds are rad/s, positive in the motor's own direction; what the bus reports (`rpm`, `position`) is signed by it.
"""

from __future__ import annotations

from enum import Enum
from math import exp, pi, sqrt

from dissectors.records import dataclass, field

RPM = 60 / (2 * pi)
# A 100 rpm/V motor: torque constant in Nm/A (or Vs/rad), winding in ohm, propeller torque in Nms2, inertia in kgm2.
TORQUE = RPM / 100
WINDING = 0.06
DRAG = 2.8e-5
INERTIA = 3.0e-3
# Thrust in Ns2 of a 30 inch propeller: 39 N at 2500 rpm.
THRUST = 5.7e-4
# Seconds to follow: a higher throttle, a lower one, a controlled speed, a brake; without any torque; to an angle.
_UP, _DOWN, _CONTROLLED, _BRAKED, _FREE, _ANGLE = 0.08, 0.12, 0.1, 0.06, 0.35, 0.15
# However light a rotor is, its ESC changes the duty cycle no faster than in this share of these times.
_QUICK = 0.3
# Friction stops what turns slower (rad/s).
_STICKS = 3.0
# What the electronics take (A), and where an ESC limits the winding of a blocked rotor.
_QUIESCENT = 0.06
_BLOCKED = 160.0
# The ESC's heat: ohm and V of its switches, heat capacity in J/K, K/W in still air and in the propeller's wind.
_SWITCH_OHM, _SWITCH_VOLT, HEAT_CAPACITY, _STILL, _WINDY = 0.008, 0.15, 60.0, 4.0, 2.5


class Drive(Enum):
    """The ways in which an ESC drives its motor."""

    FREE = 0
    DUTY = 1
    SPEED = 2
    BRAKE = 3
    ANGLE = 4


@dataclass(slots=True)
class Motor:
    """State at time `t` (s). Of the ESC: `current` at its input in A, `temperature` in degC, `heat` as extra loss in W.

    A `blocked` rotor stands still however it is driven. `reverse` turns its direction round; `mount` does so by the
    way it is wired. `load` is the torque that the propeller takes and `lift` the thrust that it gives, as shares of
    those of a sound one, `inertia` what is left of the rotor's. The winding of a blocked one takes `most` A.
    """

    ambient: float
    mount: int = 1
    reverse: bool = False
    t: float = 0.0
    speed: float = 0.0
    angle: float = 0.0
    zero: float = 0.0
    voltage: float = 0.0
    temperature: float = field(init=False)
    heat: float = 0.0
    blocked: bool = False
    load: float = 1.0
    lift: float = 1.0
    inertia: float = 1.0
    most: float = _BLOCKED
    drive: Drive = Drive.FREE
    set_point: float = 0.0
    current: float = _QUIESCENT
    winding_current: float = 0.0

    def __post_init__(self) -> None:
        """Begin a little above the temperature of the air."""
        self.temperature = self.ambient + 2.0

    @property
    def direction(self) -> int:
        """1 or -1: the sign of its speed on the bus when it turns its own way."""
        return -self.mount if self.reverse else self.mount

    @property
    def rpm(self) -> float:
        """Speed on the bus."""
        return self.speed * RPM * self.direction

    @property
    def position(self) -> float:
        """Degrees from its zero, 0 to 360."""
        return (self.angle - self.zero) % 360.0

    @property
    def thrust(self) -> float:
        """Newton."""
        return THRUST * self.lift * self.speed * abs(self.speed)

    def steady(self, duty: float) -> float:
        """Return the speed at which propeller and winding balance a duty cycle (0 to 1) of the voltage."""
        loss = WINDING * DRAG * self.load / TORQUE
        return (sqrt(TORQUE * TORQUE + 4 * loss * duty * max(0.0, self.voltage)) - TORQUE) / (2 * loss)

    def advance(self, t: float) -> None:
        """Go on to time `t` under the present drive and voltage."""
        step = t - self.t
        if step <= 0:
            return
        self.t = t
        if self.drive is Drive.ANGLE and not self.blocked:
            self._turn_to(step)
        else:
            target, lag = self._target()
            rest = (self.speed - target) * exp(-step / lag)
            turned = target * step + (self.speed - target - rest) * lag
            self.speed = target + rest
            self.angle = (self.angle + turned * 180 / pi * self.direction) % 360.0
            if not target and abs(self.speed) < _STICKS:
                self.speed = 0.0
            self._draw((target - self.speed) / lag)
        self._warm(step)

    def _target(self) -> tuple[float, float]:
        """Return where the speed goes, and how fast (s)."""
        if self.blocked:
            return 0.0, _BRAKED / 3
        if self.drive is Drive.DUTY:
            target = self.steady(self.set_point)
            return target, (_UP if target > self.speed else _DOWN) * max(self.inertia, _QUICK)
        if self.drive is Drive.SPEED:
            return self.set_point, _CONTROLLED
        return 0.0, _BRAKED if self.drive is Drive.BRAKE else _FREE

    def _turn_to(self, step: float) -> None:
        """Turn towards the angle `set_point` + `zero`; less than a tenth of a degree away it stands."""
        rest = (self.set_point + self.zero - self.angle + 180) % 360 - 180
        left = rest * exp(-step / _ANGLE)
        self.angle = (self.angle + rest - left) % 360.0
        self.speed = 0.0 if abs(left) < 0.1 else left / _ANGLE * pi / 180 * self.direction
        self._draw(0.0)

    def _draw(self, acceleration: float) -> None:
        """Draw the current of the present speed and its change: none flows back into the pack."""
        if self.blocked and self.drive in {Drive.DUTY, Drive.SPEED}:
            amperes = min(self.most, self._asked() * self.voltage / WINDING)
        elif self.drive in {Drive.DUTY, Drive.SPEED, Drive.ANGLE}:
            pushed = -acceleration if self.speed < 0 else acceleration
            amperes = max(0.0, DRAG * self.load * self.speed * self.speed + INERTIA * self.inertia * pushed) / TORQUE
        else:
            amperes = 0.0
        self.winding_current = amperes
        duty = min(1.0, (abs(self.speed) * TORQUE + amperes * WINDING) / max(self.voltage, 1.0))
        self.current = duty * amperes + _QUIESCENT

    def _asked(self) -> float:
        return self.set_point if self.drive is Drive.DUTY else 0.1

    def _warm(self, step: float) -> None:
        amperes = self.winding_current
        watts = _SWITCH_OHM * amperes * amperes + _SWITCH_VOLT * amperes + _QUIESCENT * self.voltage + self.heat
        wind = min(1.0, abs(self.speed) / 250)
        resistance = _STILL + (_WINDY - _STILL) * wind
        goal = self.ambient + watts * resistance
        self.temperature = goal + (self.temperature - goal) * exp(-step / (HEAT_CAPACITY * resistance))
