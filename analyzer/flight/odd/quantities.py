"""The quantities by which ESCs are compared, and what each says of a report."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from analyzer.flight.motors.steady import commanded
from analyzer.flight.thresholds import threshold
from dissectors.records import dataclass

if TYPE_CHECKING:
    from analyzer.flight.motors.reports import EscReports
    from dissectors.kit import Array

BINS = 40
_LAW = 3  # a current grows so with the speed: torque with its square, duty cycle with itself
_COMMAND_BIN = 2.5  # % of the full command
_SLOWEST, _SPEED_BIN = np.log(300.0), 0.12  # natural logarithm of rpm: 300 to 36,000


@dataclass(frozen=True, slots=True)
class Quantity:
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


SPEED = Quantity("speed per command", "speed", "%", "faster", "slower", "at equal command", 0, 1, 100.0, relative=True)
CURRENT = Quantity(
    "current at equal speed", "current", "%", "more current", "less current", "at equal speed", 2, 3, 100.0,
    relative=True,
)  # fmt: skip
TEMPERATURE = Quantity("temperature at equal power", "temperature", "C", "hotter", "colder", "at equal power")
VOLTAGE = Quantity(
    "supply voltage", "voltage", "%", "more supply voltage", "less supply voltage", scale=100.0, digits=1, relative=True
)  # fmt: skip
LOST = Quantity("lost reports", "lost", "%", "more reports lost", "fewer reports lost", scale=100.0, digits=1)
LATE = Quantity("late reports", "late", "%", "more reports late", "fewer reports late", scale=100.0, digits=1)
QUANTITIES = (SPEED, CURRENT, TEMPERATURE, VOLTAGE, LOST, LATE)
BINNED = 4  # kinds of sums by bins


def binned(some: EscReports, steady: Array) -> list[tuple[Array, Array, Array]]:
    """Return for each kind of sums by bins the reports that count, their bins, and what they say.

    Those are speed for a percent of command and a volt, speed for a percent alone, power by the cube of the speed,
    current by it: at equal speed the product of current and voltage stays the same whatever the pack gives. Means of
    them are those of an even speed, as much as a motor gains speed and loses it again.
    """
    command = commanded(some)
    with np.errstate(divide="ignore", invalid="ignore"):
        driven = steady & (command > threshold("motor_steady_percent"))
        drawn = steady & (some.current > threshold("motor_least_a"))
        supplied = some.volts > 1
        by_command = np.clip(np.nan_to_num(command) / _COMMAND_BIN, 0, BINS - 1).astype(np.int64)
        turns = np.where(some.speed > 0, some.speed, 1.0)
        by_speed = np.clip((np.log(turns) - _SLOWEST) / _SPEED_BIN, 0, BINS - 1).astype(np.int64)
        gained, taken = some.speed / command, some.current / (turns / 1000) ** _LAW
        return [
            (np.flatnonzero(good), bins, values)
            for good, bins, values in (
                (driven & supplied, by_command, gained / some.volts),
                (driven, by_command, gained),
                (drawn & supplied, by_speed, taken * some.volts),
                (drawn, by_speed, taken),
            )
        ]
