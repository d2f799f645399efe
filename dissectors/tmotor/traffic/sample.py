"""Measurements of an ESC at one instant, in units of the packet that has the coarser ones (4.4.5 table 1).

ESCStatus and MotorStatus are made of the same sample, so that they agree to the last digit.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from dissectors.records import dataclass
from dissectors.tmotor.traffic.throttle import FULL

if TYPE_CHECKING:
    from dissectors.tmotor.traffic.packets import Raw

KELVIN = 273.15


@dataclass(frozen=True, slots=True)
class MotorSample:
    """`voltage` in 0.01 V, `current` in 0.01 A, `temperature` in 0.01 degC, `encoder` 0 to 16383, `duty` 0 to 1.

    `faults` are bits 0 to 11 of the status word; `signal` is the throttle as received, None without one.
    """

    mode: int
    faults: int
    encoder: int
    voltage: int
    current: int
    temperature: int
    rpm: int
    duty: float
    signal: int | None
    locked: bool

    def status(self, index: int) -> dict[str, Any]:
        """Return the fields of ESCStatus (4.4.3)."""
        return {
            "error_count": self.faults | self.mode << 12 | self.encoder << 16,
            "voltage": self.voltage / 100,
            "current": self.current / 100,
            "temperature": self.temperature / 100,
            "rpm": self.rpm,
            "power_rating_pct": round(self.duty * 100),
            "esc_index": index,
        }

    def motor_status(self) -> dict[str, Raw]:
        """Return the measured fields of MotorStatus (4.4.5 table 1)."""
        return {
            "system_status": 0xCC if self.mode == 6 else 0x11 if self.locked else 0x00,
            "position": self.encoder * 36_000 // 16_384,
            "pwm": 0 if self.signal is None else 10_400 + round(9000 * self.signal / FULL),
            "throttle": round(self.duty * 250),
            "speed": min(max(self.rpm, -32_767), 32_767),
            "voltage": min(max(self.voltage, 0), 0xFFFF),
            "current": min(max(self.current, -32_767), 32_767),
            "temperature": self.temperature & 0xFFFF,
            "fault": self.faults,
        }
