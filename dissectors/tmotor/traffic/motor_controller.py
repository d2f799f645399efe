"""The electronics of one ESC: how it follows what it hears, drives its motor, and measures."""

from __future__ import annotations

from typing import TYPE_CHECKING

from dissectors.times import SECOND
from dissectors.tmotor.traffic.control import MotorControl
from dissectors.tmotor.traffic.operation import ERROR, OFF, Operation
from dissectors.tmotor.traffic.parameters import factory
from dissectors.tmotor.traffic.physics.motor import Motor
from dissectors.tmotor.traffic.sample import MotorSample
from dissectors.tmotor.traffic.throttle import FULL, Throttle

if TYPE_CHECKING:
    from dissectors.tmotor.traffic.rates import Rates
    from dissectors.traffic import BusNode, World

# Power units have numbers 1 to 9 (4.4.4), ESCs indexes 0 to 19.
UNITS = range(0xA1, 0xAA)
_OVER_CURRENT, _THROTTLE_LOSS, _THROTTLE_ABNORMAL, _OVER_TEMPERATURE, _STALL = (1 << bit for bit in (2, 3, 4, 5, 7))


class MotorController:
    """An ESC and its motor; what is public can be read and changed at any time.

    `index` is its esc_index, `unit` its number in PUSH packets (0xA1 to 0xA9, None from the tenth ESC on), `parameters`
    what ParamGet reports. `fault_bits` are bits 0 to 11 of the status word that are set whatever happens, `mode` the
    operating mode that it reports instead of its own (6 also stops the motor). `kelvin` and `coarse` are about
    ESCStatus: its temperature's unit, and floats by the printed encoder (5.2). `big_endian` turns its packets round,
    `sum_end` is the checksum range of FocParameters packets that the ground station sends to it. `status_period` is in
    ns; 0, or `telemetry` off, sends no ESCStatus. `runtime_offset` (s) and `power_on_count` stand in MotorStatus.
    One that no longer `obeys` takes no control mode, one that is `deaf` no throttle, and it never drives its motor with
    more than its `limit` (0 to 1); `sag` is the voltage in V that only it lacks. Bits of `hidden` it does not tell. A
    `stock` ESC speaks standard DroneCAN only.
    """

    def __init__(self, world: World, node: BusNode, index: int, uuid: int, rates: Rates, *, stock: bool) -> None:
        self.world, self.node, self.index, self.uuid, self.stock = world, node, index, uuid, stock
        self.unit = UNITS[index] if index < len(UNITS) and not stock else None
        self.parameters = factory(world.random, index=index, uuid=uuid, rate=rates.status, bus=rates.bus)
        self.motor = Motor(world.random.uniform(18.0, 20.0), mount=-1 if index % 2 else 1)
        self.motor.angle = world.random.uniform(0, 360)
        self.throttle = Throttle()
        self.operation = Operation()
        self.control = MotorControl()
        self.position_loop = 0
        self.fault_bits = 0
        self.mode: int | None = None
        self.kelvin, self.coarse, self.big_endian = stock, False, False
        self.sum_end: int | None = None
        self.telemetry = True
        self.obeys = True
        self.deaf = False
        self.limit = 1.0
        self.sag = 0.0
        self.hidden = 0
        self.runtime_offset = 0
        self.power_on_count: int = self.parameters["esc_startup_times"]
        self.status_period = SECOND // rates.status if rates.status else 0

    @property
    def heat(self) -> float:
        """Watts of loss in the ESC beyond its own."""
        return self.motor.heat

    @heat.setter
    def heat(self, watts: float) -> None:
        self.motor.heat = watts

    @property
    def faults(self) -> int:
        """Bits 0 to 11 of the status word (4.4.3)."""
        motor, throttle, now = self.motor, self.throttle, self.world.now
        bits = self.fault_bits & 0xFFF
        if throttle.lost(now):
            bits |= _THROTTLE_LOSS
        if throttle.abnormal:
            bits |= _THROTTLE_ABNORMAL
        if motor.temperature > self.parameters["esc_ot_threshold"]:
            bits |= _OVER_TEMPERATURE
        if motor.current > self.parameters["esc_oc_threshold"]:
            bits |= _OVER_CURRENT
        if motor.blocked and self.operation.duty:
            bits |= _STALL
        return bits & ~self.hidden

    def hear(self, command: list[int]) -> None:
        """Hear a RawCommand; without a channel for this ESC it says nothing to it."""
        if self.index < len(command) and not (self.node.silent or self.node.cut or self.deaf):
            self.throttle.hear(command[self.index], self.world.now)

    def step(self, seconds: float, voltage: float) -> None:
        """Advance the motor to now, `seconds` after the last step; then decide anew what drives it."""
        motor, operation = self.motor, self.operation
        motor.advance(self.world.now / SECOND)
        motor.voltage = voltage - self.sag
        if not motor.speed:
            motor.reverse = self.parameters["esc_rotate_dir"] == 1
        throttle = self.throttle.value(self.world.now)
        if self.mode == ERROR:
            operation.fail(motor)
        elif throttle:
            self.control.mode = 0
            operation.follow(min(throttle / FULL, self.limit), motor, seconds)
        elif self.control.active:
            operation.obey(self.control, motor)
        elif self.throttle.started:
            operation.release(motor)

    def command(self, mode: int, set_point: int) -> None:
        """Take an OutputControl packet; only at zero throttle does the motor follow it."""
        self.motor.advance(self.world.now / SECOND)
        if self.obeys and not self.throttle.value(self.world.now):
            self.control.take(mode, set_point, self.motor)

    def set_zero(self) -> None:
        """Make the present position zero (4.4.4 table 1)."""
        self.motor.advance(self.world.now / SECOND)
        self.motor.zero = self.motor.angle

    def sample(self) -> MotorSample:
        """Measure now, with the small errors of its sensors."""
        motor, gauss = self.motor, self.world.random.gauss
        motor.advance(self.world.now / SECOND)
        rpm = motor.rpm
        return MotorSample(
            mode=self.operation.mode if self.mode is None else self.mode,
            faults=self.faults,
            encoder=int(motor.position * 16_384 / 360) & 0x3FFF,
            voltage=round(100 * (motor.voltage + gauss(0, 0.02))),
            current=max(1, round(100 * (motor.current * (1 + gauss(0, 0.004)) + gauss(0, 0.008)))),
            temperature=round(100 * (motor.temperature + gauss(0, 0.06))),
            rpm=round(rpm + gauss(0, 1.5)) if abs(rpm) > 60 else round(rpm),
            duty=self.operation.duty,
            signal=None if self.operation.mode == OFF else self.throttle.value(self.world.now),
            locked=self.control.locked,
        )
