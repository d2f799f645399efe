"""Reports of a motor that is driven evenly: only they can be compared with others."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from analyzer.flight.thresholds import lasting, threshold

if TYPE_CHECKING:
    from analyzer.flight.motors.reports import EscReports
    from dissectors.kit import Array
    from dissectors.picture import Plot


def turning(plot: Plot, some: EscReports) -> Array:
    """Return the reports in which the motor turns: by its speed, else by its current, else by what is commanded."""
    speed, current = some.speed > _idle(plot), some.current > threshold("motor_least_a")
    by_current = np.where(np.isfinite(some.current), current, commanded(some) > threshold("command_idle_percent"))
    found: Array = np.where(np.isfinite(some.speed), speed, by_current)
    return found


def commanded(some: EscReports) -> Array:
    """Return the throttle in %: what was commanded on the bus, else what the ESC says it was."""
    found: Array = np.where(np.isfinite(some.command.mean), some.command.mean, some.reported)
    return found


class SteadySpeed:
    """Follows one device: a report is steady if neither its speed nor its command moved much since the one before."""

    def __init__(self) -> None:
        self._last = np.nan, np.nan  # speed, and throttle that the ESC reports
        self._ran = 0

    def feed(self, plot: Plot, some: EscReports) -> Array:
        """Return which of the next reports are steady; not those behind a pause, nor slower than idle."""
        before = np.concatenate(([self._last[0]], some.speed[:-1]))
        said = np.concatenate(([self._last[1]], some.reported[:-1]))
        pause = np.diff(some.at.ran, prepend=self._ran) > lasting("silent_motor")
        self._last, self._ran = (float(some.speed[-1]), float(some.reported[-1])), int(some.at.ran[-1])
        most = threshold("motor_steady_percent")
        with np.errstate(invalid="ignore"):
            even = np.abs(some.speed - before) <= threshold("steady_speed") * before
            held = some.command.most - some.command.least <= most
            held = np.where(np.isfinite(some.command.last), held, ~(np.abs(some.reported - said) > most))
        good: Array = even & held & ~pause & (some.speed > _idle(plot))
        return good


def _idle(plot: Plot) -> float:
    return plot.idle_rpm or threshold("idle_rpm")
