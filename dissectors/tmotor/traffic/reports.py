"""Reports of an ESC: ESCStatus at its rate, MotorStatus now and then, and other PUSHCAN packets."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from dissectors.times import MILLISECOND, SECOND
from dissectors.tmotor.traffic.float16 import printed
from dissectors.tmotor.traffic.packets import packet
from dissectors.tmotor.traffic.sample import KELVIN

if TYPE_CHECKING:
    from dissectors.tmotor.traffic.motor_controller import MotorController
    from dissectors.tmotor.traffic.packets import Raw
    from dissectors.tmotor.traffic.rates import Rates
    from dissectors.tmotor.traffic.sample import MotorSample

# A MotorStatus that somebody asked for waits so long for the next ESCStatus, then it goes alone.
_PATIENCE = 100 * MILLISECOND
# Crystals differ by this share of their frequency.
_DRIFT = 20e-6


class Reports:
    """The senders of one ESC. A MotorStatus goes out with an ESCStatus, of one and the same sample."""

    def __init__(self, esc: MotorController, rates: Rates) -> None:
        self.frame_count = 0
        self.data_sequence = 0
        self.errors = 0
        self.begun = False
        self._esc, self._world = esc, esc.world
        self._period = rates.push
        self._pace = 1 + esc.world.random.uniform(-_DRIFT, _DRIFT)
        self._age = esc.world.random.randrange(2_000, 20_000)
        self._tick_at = self._push_at = 0
        self._hushed: dict[str, int] = {}

    def start(self, first: int) -> None:
        """Report from time `first` on."""
        self._tick_at = self._push_at = first
        self._world.at(first, self._tick)

    def restart(self) -> None:
        """Cycle the power: numbers start from zero."""
        self.frame_count = self.data_sequence = self.errors = 0

    def motor_status(self) -> None:
        """Send a MotorStatus soon: somebody wants one."""
        if self._tick_at <= self._world.now + _PATIENCE:
            self._push_at = self._world.now
        else:
            self._world.at(self._world.now + _PATIENCE // 4, lambda: self._push_status(self._esc.sample()))

    def hush(self, name: str, until: int) -> None:
        """Send no packets of this name before time `until`, nor later what was due by then."""
        self._hushed[name] = until

    def push(self, name: str, values: dict[str, Raw]) -> None:
        """Send a packet in a PUSHCAN, with the next numbers."""
        esc = self._esc
        if esc.unit is None or esc.node.silent or self._world.now < self._hushed.get(name, 0):
            return
        data = packet(name, self.frame_count, esc.unit, values, big_endian=esc.big_endian)
        esc.node.send("PUSHCAN", {"data_sequence": self.data_sequence, "data": data})
        self.frame_count = (self.frame_count + 1) % 256
        self.data_sequence = (self.data_sequence + 1) % 2**32

    def _tick(self) -> None:
        esc, now = self._esc, self._world.now
        self._tick_at += round((esc.status_period or self._period) * self._pace)
        self._world.at(self._tick_at, self._tick)
        if esc.node.silent:
            return
        sample = esc.sample()
        if esc.telemetry and esc.status_period:
            esc.node.send("ESCStatus", self._status(sample))
            self.begun = True
        if self._push_at <= now:
            self._push_status(sample)

    def _status(self, sample: MotorSample) -> dict[str, Any]:
        esc = self._esc
        values = sample.status(esc.index)
        if esc.kelvin:
            values["temperature"] += KELVIN
        if esc.stock:
            if self._world.random.random() < 0.003:
                self.errors += 1
            values["error_count"] = self.errors
        if esc.coarse:
            for name in ("voltage", "current", "temperature"):
                values[name] = printed(values[name])
        return values

    def _push_status(self, sample: MotorSample) -> None:
        esc, now = self._esc, self._world.now
        self._push_at = now + self._period - (esc.status_period or self._period) // 2
        runtime = self._age + now // SECOND + esc.runtime_offset
        count = {"power_on_count": esc.power_on_count & 0xFFFF, "runtime": runtime % 65_536}
        self.push("MotorStatus", {**sample.motor_status(), **count})
