"""Fault flags of the motor status packet (4.4.5 table 1 no 21-22)."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from dissectors.kit import rule, sound
from dissectors.tmotor.rules.values.reports import FAULTS

if TYPE_CHECKING:
    from collections.abc import Iterator

    from dissectors.kit import Occurrences, Values, View


@rule("PUSH-410")
def motor_faults(view: View) -> Iterator[Occurrences]:
    """Find packets with fault flags, and what the motor did then; those with the same flags are one finding."""
    table = view.table("PUSHCAN.MotorStatus")
    if table is None:
        return
    flags = table["fault"]
    rows = np.flatnonzero(sound(table) & (flags != 0))

    def values(row: int) -> Values:
        word = int(flags[row])
        named = [name for bit, name in enumerate(FAULTS) if word >> bit & 1]
        named += [f"bit {bit}" for bit in range(len(FAULTS), 16) if word >> bit & 1]
        measured = {name: float(table[name][row]) for name in ("voltage", "current", "temperature", "speed")}
        return {"value": word, "named": ", ".join(named), **measured}

    if len(rows):
        yield view.among_rows("PUSH-410", table, rows, values, key=flags[rows])
