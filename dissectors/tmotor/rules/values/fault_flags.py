"""Fault flags and what an ESC measures while they are set; ESCStatus and the status packet 0x15 both have them."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from dissectors.kit import NODES, Previous

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

    from dissectors.kit import Array, DecodedTable, Severity, Values, View, Worst

# Bits 0 to 11 of the status word (4.4.3), and tentatively of the motor fault (4.4.5 table 1 no 21-22).
FAULTS = (
    "over voltage", "under voltage", "over current", "throttle loss", "throttle abnormal", "MOS over temperature",
    "capacitor over temperature", "stall", "amplifier fault", "upper bridge fault", "lower bridge fault",
    "encoder error",
)  # fmt: skip
_OVER_VOLTAGE, _THROTTLE_LOSS = FAULTS.index("over voltage"), FAULTS.index("throttle loss")
_SPEEDS = ("rpm", "speed")
_MEASURED: tuple[tuple[str, Worst], ...] = (
    ("voltage", "lowest"), ("current", "strongest"), ("temperature", "highest"), ("speed", "slowest"),
)  # fmt: skip


def measured(table: DecodedTable, row: int) -> Values:
    """Return voltage (V), current (A), temperature (degC) and speed (rpm) of a report."""
    return {name: float(table[_column(table, name)][row]) for name, _ in _MEASURED}


def worst(table: DecodedTable, rows: Array, *, over_voltage: bool = False) -> Mapping[str, tuple[Worst, Array]]:
    """Return the same of many reports, with what is worst: the highest voltage only of over-voltage."""
    found = {name: (kind, table[_column(table, name)][rows]) for name, kind in _MEASURED}
    if over_voltage:
        found["voltage"] = "highest", found["voltage"][1]
    return found


def _column(table: DecodedTable, name: str) -> str:
    if name == "temperature":
        return "temperature_celsius"
    return next(one for one in _SPEEDS if one in table) if name == "speed" else name


class FaultFlags:
    """The flags of each node in its last report, and since when commands have come."""

    def __init__(self) -> None:
        self._before = Previous(0)
        self._quiet = True  # no node's last report had a flag
        self._commanded: int | None = None  # the first transfer that carried throttle
        self._early = np.zeros(NODES, bool)  # nodes that have reported throttle loss since before that

    def note_commands(self, view: View) -> None:
        """Note the first command, in every batch before its reports."""
        commands = view.table("RawCommand")
        if self._commanded is None and commands is not None and commands.trusted.any():
            self._commanded = int(commands["transfer"][int(np.argmax(commands.trusted))])

    def feed(
        self, table: DecodedTable, rows: Array, node: Array, word: Array
    ) -> Iterator[tuple[int, Array, Array, Severity | None]]:
        """Yield each flag that is set: bit, places among `rows`, which of them rise, severity.

        Throttle loss before the first command is a note until it is over: nobody had begun to command.
        """
        faulty = bool(np.bitwise_or.reduce(word)) if len(word) else False
        if not faulty and self._quiet:
            return
        (before,), _ = self._before.feed(node, word)
        self._quiet = self._before.all(0)
        for bit in range(16):
            here = (word >> bit & 1).astype(bool)
            if not here.any() and bit != _THROTTLE_LOSS:
                continue
            rises = here & (before >> bit & 1 == 0)
            early = np.zeros(len(here), bool)
            if bit == _THROTTLE_LOSS:
                early = self._told_early(node, here, rises, table["transfer"][rows])
            parts: tuple[tuple[Array, Severity | None], ...] = ((here & ~early, None), (here & early, "note"))
            for mask, severity in parts:
                at = mask.nonzero()[0]
                if len(at):
                    yield bit, at, rises[at], severity

    def _told_early(self, node: Array, here: Array, rises: Array, transfer: Array) -> Array:
        """Return which reports tell a throttle loss that rose before the first command."""
        first = np.full(len(here), self._commanded is None)
        if self._commanded is not None:
            first = transfer < self._commanded
        if not first.any() and not self._early.any():
            return first
        early = np.zeros(len(here), bool)
        for one in np.unique(node).tolist():
            mine = (node == one).nonzero()[0]
            begun = np.maximum.accumulate(np.where(rises[mine], np.arange(len(mine)), -1))
            early[mine] = here[mine] & np.where(begun < 0, self._early[one], first[mine[begun]])
            self._early[one] = early[mine[-1]]
        return early


def named(bit: int) -> str:
    """Return what a flag is called."""
    return FAULTS[bit] if bit < len(FAULTS) else f"bit {bit}"


def is_over_voltage(bit: int) -> bool:
    """Return whether it is the flag for which a high voltage is worse than a low one."""
    return bit == _OVER_VOLTAGE
