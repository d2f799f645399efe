"""The operating modes of an ESC (4.4.3): off, idle, soft start, operating, coast-down, and folding propellers."""

from __future__ import annotations

from typing import TYPE_CHECKING

from dissectors.records import dataclass
from dissectors.tmotor.traffic import control
from dissectors.tmotor.traffic.physics.motor import TORQUE, Drive

if TYPE_CHECKING:
    from dissectors.tmotor.traffic.control import MotorControl
    from dissectors.tmotor.traffic.physics.motor import Motor

OFF, IDLE, SOFT_START, OPERATING, COAST_DOWN, ERROR, FORWARD_FOLD, REVERSE_FOLD = range(1, 9)
# A soft start raises the duty cycle so fast (1/s), and takes this long at least (s).
_RAMP, _SHORTEST = 0.8, 0.25


@dataclass(slots=True)
class Operation:
    """`mode`, and the `duty` cycle (0 to 1) that is applied."""

    mode: int = OFF
    duty: float = 0.0
    _lasted: float = 0.0

    def follow(self, throttle: float, motor: Motor, step: float) -> None:
        """Follow a throttle from 0 to 1, `step` seconds after the last one."""
        if throttle <= 0:
            self.release(motor)
            return
        if self.mode == SOFT_START:
            self._lasted += step
            self.duty = min(throttle, self.duty + _RAMP * step)
            if self.duty >= throttle and self._lasted >= _SHORTEST:
                self.mode = OPERATING
        elif self.mode == OPERATING:
            self.duty = throttle
        else:
            self.mode, self._lasted = SOFT_START, 0.0
            self.duty = min(throttle, abs(motor.speed) * TORQUE / max(motor.voltage, 1.0))
        motor.drive, motor.set_point = Drive.DUTY, self.duty

    def release(self, motor: Motor) -> None:
        """Take the throttle away: the motor runs out, then the ESC is idle."""
        self.duty = 0.0
        self.mode = COAST_DOWN if motor.speed else IDLE
        motor.drive = Drive.FREE

    def obey(self, order: MotorControl, motor: Motor) -> None:
        """Let a control mode of OutputControl drive the motor."""
        order.drive(motor)
        self.duty = min(1.0, abs(motor.speed) * TORQUE / max(motor.voltage, 1.0))
        if order.mode == control.FORWARD_FOLD:
            self.mode = FORWARD_FOLD
        elif order.mode == control.REVERSE_FOLD:
            self.mode = REVERSE_FOLD
        elif motor.drive is Drive.FREE:
            self.mode = COAST_DOWN if motor.speed else IDLE
        else:
            self.mode = OPERATING

    def fail(self, motor: Motor) -> None:
        """Let the motor run out, as an ESC in error does."""
        self.mode, self.duty = ERROR, 0.0
        motor.drive = Drive.FREE
