"""The quantities by which ESCs are compared, and what each says of a report."""

from __future__ import annotations

import numpy as np

from analyzer.flight.thresholds import threshold
from dissectors.records import dataclass


@dataclass(frozen=True, slots=True)
class EscQuantity:
    """A quantity of an ESC: `unit` of a difference, `more` and `less` as words for it, `at` what is equal then.

    `number` is that of its sums, `plain` of those that need one measurement less. Of `relative` ones natural logarithms
    are compared. A `scale` turns (small) differences into the unit; numbers of thresholds are in the unit.
    """

    name: str
    key: str
    unit: str
    more: str
    less: str
    at: str = ""
    number: int = -1
    plain: int = -1
    scale: float = 1.0
    digits: int = 0
    relative: bool = False

    def difference(self, value: float) -> float:
        """Return a difference of what is compared in the unit."""
        return float(np.expm1(value) if self.relative else value) * self.scale

    @property
    def least(self) -> float:
        """The least difference from its own past that is worth telling."""
        return threshold(f"odd_{self.key}")

    @property
    def layer(self) -> float:
        """The least gap between two groups of ESCs."""
        return threshold(f"layer_{self.key}")

    @property
    def tolerated(self) -> float:
        """How far equal ESCs are apart: a standard deviation."""
        return threshold(f"tolerated_{self.key}")


SPEED = EscQuantity(
    "speed per command", "speed", "%", "faster", "slower", "at equal command", 0, 1, 100.0, relative=True
)
CURRENT = EscQuantity(
    "current at equal speed", "current", "%", "more current", "less current", "at equal speed", 2, 3, 100.0,
    relative=True,
)  # fmt: skip
TEMPERATURE = EscQuantity("temperature at equal power", "temperature", "C", "hotter", "colder", "at equal power")
VOLTAGE = EscQuantity(
    "supply voltage", "voltage", "%", "more supply voltage", "less supply voltage", scale=100.0, digits=1, relative=True
)  # fmt: skip
LOST = EscQuantity("lost reports", "lost", "%", "more reports lost", "fewer reports lost", scale=100.0, digits=1)
LATE = EscQuantity("late reports", "late", "%", "more reports late", "fewer reports late", scale=100.0, digits=1)
QUANTITIES = (SPEED, CURRENT, TEMPERATURE, VOLTAGE, LOST, LATE)
