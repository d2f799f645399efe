"""Settings of a simulation: the flight plan, its faults, and the bus."""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from dissectors.times import SECOND

if TYPE_CHECKING:
    from analyzer.simulate.faults.context import FaultOrder

# 2026-03-14 08:02:10 UTC, so that the same settings give the same bytes on any day.
START = 1_773_475_330 * SECOND


@dataclass(frozen=True, slots=True)
class SimulationSettings:
    """Settings of a simulation. `duration` in ns, `start` in ns since 1970.

    `rate` of status messages in Hz; None is what suits the bit rate, 30 at 1 Mbit/s.
    Faults without a time of their own happen within the first `span` ns, 0 for the whole duration.
    """

    flight: str = "hover"
    scenario: str = ""
    escs: int = 4
    duration: int = 10 * SECOND
    seed: int = 1
    bit_rate: int = 1_000_000
    rate: int | None = None
    stock: bool = False
    start: int = START
    bus: str = "can0"
    orders: tuple[FaultOrder, ...] = field(default_factory=tuple)
    span: int = 0

    @property
    def buses(self) -> tuple[str, str]:
        """The interface, and a second one, which only some faults use: can1 beside can0."""
        name, digits, _ = re.split(r"(\d*)$", self.bus, maxsplit=1)
        return self.bus, f"{name}{int(digits) + 1}" if digits else f"{name}2"
