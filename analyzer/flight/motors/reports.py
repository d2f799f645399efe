"""Reports of one ESC, as a motor is compared with its past."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Iterator

    from analyzer.flight.clock import Places
    from analyzer.flight.tables import ReportTable
    from dissectors.kit import Array


class MotorReports(NamedTuple):
    """Speed without its sign in rpm, V, A, and what the ESC says it is commanded, in %; NaN where it tells none."""

    speed: Array
    volts: Array
    current: Array
    reported: Array
    at: Places


def reports(table: ReportTable) -> Iterator[tuple[int, MotorReports]]:
    """Yield the device of a key, and those of its reports that have a time, a speed and a voltage."""
    esc = table.plot.esc
    speed, volts, current, reported = map(table.numbers, (esc.rpm, esc.voltage, esc.current, esc.reported))
    good = table.timed & np.isfinite(speed) & (volts > 1)
    whole = bool(good.all())
    for key, rows, _ in table.devices:
        mine = rows if whole else rows[good[rows]]
        if len(mine):
            yield key, MotorReports(
                np.abs(speed[mine]), volts[mine], current[mine], reported[mine], table.at.take(mine)
            )  # fmt: skip
