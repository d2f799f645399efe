"""Control modes of OutputControl (4.4.4 table 4): a motor driven without throttle, on a bench.

The ESC takes them only while its throttle is zero, and follows them until 0x00 releases it.
"""

from __future__ import annotations

from math import sqrt
from typing import TYPE_CHECKING

from dissectors.records import dataclass
from dissectors.tmotor.traffic.physics.motor import DRAG, RPM, TORQUE, Drive

if TYPE_CHECKING:
    from dissectors.tmotor.traffic.physics.motor import Motor

QUERY, FORWARD_FOLD, REVERSE_FOLD, LOCK, FREE = 0x00, 0xEE, 0x22, 0x88, 0x66
DUTY, REVERSE_DUTY, CURRENT, REVERSE_CURRENT = 0x55, 0x5A, 0x44, 0x4A
SPEED, REVERSE_SPEED, POSITION, REVERSE_POSITION, BRAKE = 0x33, 0x3A, 0x11, 0x1A, 0xBB
MODES = (
    *(QUERY, FORWARD_FOLD, REVERSE_FOLD, LOCK, FREE, DUTY, REVERSE_DUTY, CURRENT, REVERSE_CURRENT),
    *(SPEED, REVERSE_SPEED, POSITION, REVERSE_POSITION, BRAKE),
)
# The largest set point of each mode that takes one (4.4.4 table 4 no 8-9).
LIMITS = dict.fromkeys((DUTY, REVERSE_DUTY, CURRENT, REVERSE_CURRENT, SPEED, REVERSE_SPEED, BRAKE), 10_000)
LIMITS |= dict.fromkeys((POSITION, REVERSE_POSITION, LOCK), 3600)
_REVERSE = (REVERSE_FOLD, REVERSE_DUTY, REVERSE_CURRENT, REVERSE_SPEED)
# Propellers fold at this many rpm.
_FOLDING = 90.0


@dataclass(slots=True)
class MotorControl:
    """The control mode in force; `set_point` is raw, in the unit of its mode."""

    mode: int = QUERY
    set_point: int = 0

    def take(self, mode: int, set_point: int, motor: Motor) -> None:
        """Take a new command. What is unknown or out of its range changes nothing."""
        if mode not in MODES or set_point > LIMITS.get(mode, 0xFFFF):
            return
        self.mode, self.set_point = mode, set_point
        if mode == LOCK:
            motor.set_point = motor.angle - motor.zero
        elif mode in {POSITION, REVERSE_POSITION}:
            turn = set_point / 10
            motor.set_point = turn if mode == POSITION else -turn

    @property
    def active(self) -> bool:
        """It drives the motor."""
        return self.mode != QUERY

    @property
    def locked(self) -> bool:
        """The rotor is held at its place."""
        return self.mode == LOCK

    def drive(self, motor: Motor) -> None:
        """Have the motor do so."""
        if self.mode in {LOCK, POSITION, REVERSE_POSITION}:
            motor.drive = Drive.ANGLE
        elif self.mode == FREE:
            motor.drive = Drive.FREE
        elif self.mode == BRAKE:
            motor.drive = Drive.BRAKE
        else:
            motor.drive = Drive.SPEED
            speed = self._speed(motor)
            motor.set_point = -speed if self.mode in _REVERSE else speed

    def _speed(self, motor: Motor) -> float:
        """Return the speed in rad/s where the loop settles."""
        if self.mode in {FORWARD_FOLD, REVERSE_FOLD}:
            return _FOLDING / RPM
        if self.mode in {DUTY, REVERSE_DUTY}:
            return motor.steady(self.set_point / 10_000)
        if self.mode in {CURRENT, REVERSE_CURRENT}:
            return sqrt(self.set_point / 100 * TORQUE / DRAG)
        return self.set_point / RPM
