"""The battery that all motors share."""

from __future__ import annotations

from bisect import bisect_right
from math import exp

from dissectors.records import dataclass

# Open-circuit voltage of a lithium-polymer cell over its state of charge.
_CHARGE = (0.0, 0.05, 0.1, 0.2, 0.4, 0.6, 0.8, 0.9, 1.0)
_VOLTS = (3.2, 3.45, 3.58, 3.68, 3.77, 3.86, 3.98, 4.06, 4.18)
# Chemistry follows a step of the current this slowly.
_LAG = 0.06


@dataclass(slots=True)
class Pack:
    """`cells` in series with an internal `resistance` in ohm, for all together.

    `capacity` and `used` are charge in As, `sag` the voltage that the current costs at the moment.
    """

    capacity: float
    cells: int = 12
    resistance: float = 0.025
    used: float = 0.0
    sag: float = 0.0
    current: float = 0.0

    @property
    def charge(self) -> float:
        """State of charge from 1 (full) to 0."""
        return max(0.0, 1 - self.used / self.capacity)

    @property
    def open_voltage(self) -> float:
        """Volts without a load."""
        charge = self.charge
        at = min(max(bisect_right(_CHARGE, charge), 1), len(_CHARGE) - 1)
        share = (charge - _CHARGE[at - 1]) / (_CHARGE[at] - _CHARGE[at - 1])
        return self.cells * (_VOLTS[at - 1] + share * (_VOLTS[at] - _VOLTS[at - 1]))

    @property
    def voltage(self) -> float:
        """Volts at its terminals."""
        return self.open_voltage - self.sag

    def advance(self, seconds: float, current: float) -> None:
        """Give `current` (A) for some time, exactly as a first-order system does."""
        drop = current * self.resistance
        self.sag = drop + (self.sag - drop) * exp(-seconds / _LAG)
        self.used += current * seconds
        self.current = current
