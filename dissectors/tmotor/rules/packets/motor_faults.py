"""Reports of a power unit about its own failure: fault flags, and its system status (4.4.5 table 1 no 7, 21-22)."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from dissectors.kit import Previous, Rule, sender, sound
from dissectors.tmotor.rules.values.fault_flags import FaultFlags, is_over_voltage, measured, named, worst

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from dissectors.kit import DecodedTable, Occurrences, Values, View

_QUIET, _LOCKED, _FAULT = 0x00, 0x11, 0xCC
_KNOWN = {_FAULT: "fault"}


class MotorFaults(Rule):
    """Status packets with fault flags; each flag is an episode."""

    rules = ("PUSH-410",)

    def __init__(self) -> None:
        self._flags = FaultFlags()

    def feed(self, view: View) -> Iterator[Occurrences]:
        """Find the flags that are set."""
        self._flags.note_commands(view)
        table = view.table("PUSHCAN.MotorStatus")
        if table is None:
            return
        rows = sound(table).nonzero()[0]
        word = table["fault"][rows].astype(np.int64)
        for bit, at, rises, severity in self._flags.feed(table, rows, sender(table, rows), word):
            some = rows[at]
            numbers = worst(table, some, over_voltage=is_over_voltage(bit))
            yield view.among_rows(
                "PUSH-410", table, some, _flag(table, bit), severity=severity, worst=numbers, rises=rises
            )


class SystemStatus(Rule):
    """Status packets with a system fault, or a status that the document does not know."""

    rules = ("PUSH-401",)

    def __init__(self) -> None:
        self._before = Previous(_QUIET)

    def feed(self, view: View) -> Iterator[Occurrences]:
        """Find the packets."""
        table = view.table("PUSHCAN.MotorStatus")
        if table is None:
            return
        good = sound(table).nonzero()[0]
        status = table["system_status"][good]
        (before,), _ = self._before.feed(sender(table, good), status)
        wrong = (status != _QUIET) & (status != _LOCKED)
        rows, rises = good[wrong], (before != status)[wrong]
        if len(rows):
            values = _status(table)
            yield view.among_rows(
                "PUSH-401", table, rows, values, key=status[wrong], worst=worst(table, rows), rises=rises
            )


def _flag(table: DecodedTable, bit: int) -> Callable[[int], Values]:
    fault = f"{named(bit)} (0x{1 << bit:04X})"
    return lambda row: {"fault": fault, **measured(table, row)}


def _status(table: DecodedTable) -> Callable[[int], Values]:
    def values(row: int) -> Values:
        code = int(table["system_status"][row])
        return {"value": code, "meaning": _KNOWN.get(code, "unknown"), **measured(table, row)}

    return values
