"""ESCStatus: the status word and telemetry of each report (4.4.3)."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from dissectors.kit import NODES, Previous, Rule, rule, sender, usable

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Mapping

    from dissectors.kit import Array, DecodedTable, Occurrences, Severity, Values, View

# Bits 0 to 11 of the status word.
FAULTS = (
    "over voltage", "under voltage", "over current", "throttle loss", "throttle abnormal", "MOS over temperature",
    "capacitor over temperature", "stall", "amplifier fault", "upper bridge fault", "lower bridge fault",
    "encoder error",
)  # fmt: skip
_THROTTLE_LOSS = 3
_FAULT_BITS = (1 << len(FAULTS)) - 1
_ERROR_MODE = 6
_UNKNOWN_MODE = -1
_MOST_ENCODER = 16383
_NOT_STOCK: Mapping[str, Severity | None] = {"dronecan": None}


def mode(word: Array) -> Array:
    """Return bits 15 to 12 of status words."""
    return word >> 12 & 15


@rule("TYP-302", "TYP-303", "TYP-304")
def limits(view: View) -> Iterator[Occurrences]:
    """Find throttle, encoder and mode beyond what the document gives them."""
    table = view.table("ESCStatus")
    if table is None:
        return
    word, throttle = table["error_count"], table["power_rating_pct"]
    for code, column, wrong, dialects in (
        ("TYP-302", throttle, throttle > 100, {"dronecan": "note"}),
        ("TYP-303", word >> 16, word >= (_MOST_ENCODER + 1) << 16, _NOT_STOCK),
        ("TYP-304", mode(word), (mode(word) - np.uint32(1)) > 7, _NOT_STOCK),
    ):
        rows = _good(table, wrong)
        if rows.size:
            key = column[rows] if code == "TYP-304" else None
            yield view.among_rows(code, table, rows, _telling(column), dialects=dialects, key=key)


def _good(table: DecodedTable, wrong: Array) -> Array:
    """Return trusted rows among those that are wrong."""
    rows = np.flatnonzero(wrong)
    return rows[usable(table)[rows]] if rows.size else rows


def _telling(column: Array) -> Callable[[int], Values]:
    return lambda row: {"value": int(column[row])}


@rule("TYP-308")
def telemetry(view: View) -> Iterator[Occurrences]:
    """Find voltage, current, temperature and speed that no ESC has; comparisons leave NaN out."""
    table = view.table("ESCStatus")
    if table is None:
        return

    def limit(name: str) -> float:
        return view.number("TYP-308", name)

    current, speed = limit("max_current_a"), limit("max_speed_rpm")
    for field, lowest, highest in (
        ("voltage", 0.0, limit("max_voltage_v")),
        ("current", -current, current),
        ("temperature", limit("min_temperature_degc"), limit("max_temperature_k")),
        ("rpm", -speed, speed),
    ):
        rows = _good(table, (table[field] < lowest) | (table[field] > highest))
        if rows.size:
            yield view.among_rows("TYP-308", table, rows, _measured(field, table[field]))


def _measured(field: str, column: Array) -> Callable[[int], Values]:
    return lambda row: {"field": field, "value": float(column[row])}


def _named(fault: str) -> Callable[[int], Values]:
    return lambda _row: {"fault": fault}


class Faults(Rule):
    """Fault bits as they appear, and error mode with what went before."""

    rules = ("TYP-305", "TYP-306")

    def __init__(self) -> None:
        self._bits = Previous(0)
        self._quiet = True  # no node's last report had a fault
        self._mode = np.full(NODES, _UNKNOWN_MODE)  # the last one of each node that was not error mode
        self._commanded: int | None = None  # the first transfer that carried throttle

    def feed(self, view: View) -> Iterator[Occurrences]:
        """Judge the reports of this batch, in order."""
        commands = view.table("RawCommand")
        if self._commanded is None and commands is not None and commands.trusted.any():
            self._commanded = int(commands["transfer"][int(np.argmax(commands.trusted))])
        table = view.table("ESCStatus")
        if table is None:
            return
        rows = np.flatnonzero(usable(table))
        word, node = table["error_count"][rows], sender(table, rows)
        faulty = bool(np.bitwise_or.reduce(word) & _FAULT_BITS)
        if faulty or not self._quiet:
            yield from self._rises(view, table, rows, word & _FAULT_BITS, node)
            self._quiet = self._bits.all(0)
        modes = mode(word)
        yield from self._errors(view, table, rows, modes, node)
        others = modes != _ERROR_MODE
        self._mode[node[others]] = modes[others]  # of a node's rows the last one stays

    def _rises(self, view: View, table: DecodedTable, rows: Array, faults: Array, node: Array) -> Iterator[Occurrences]:
        (before,), _ = self._bits.feed(node, faults)
        rise = faults & ~before
        for bit, name in enumerate(FAULTS):
            mine = rows[np.flatnonzero(rise & 1 << bit)]
            early = np.zeros(len(mine), bool)
            if bit == _THROTTLE_LOSS:
                early |= self._commanded is None or table["transfer"][mine] < self._commanded
            for some, severity in ((mine[~early], None), (mine[early], "note")):
                if some.size:
                    yield view.among_rows(
                        "TYP-305", table, some, _named(name), severity=severity, dialects=_NOT_STOCK
                    )  # fmt: skip

    def _errors(self, view: View, table: DecodedTable, rows: Array, modes: Array, node: Array) -> Iterator[Occurrences]:
        wrong = np.flatnonzero(modes == _ERROR_MODE)
        if not wrong.size:
            return
        before = np.full(len(rows), _UNKNOWN_MODE)
        for code in np.unique(node[wrong]).tolist():
            mine = np.flatnonzero(node == code)
            latest = np.maximum.accumulate(np.where(modes[mine] == _ERROR_MODE, -1, np.arange(len(mine))))
            before[mine] = np.where(latest < 0, self._mode[code], modes[mine[latest]])

        def values_of(k: int) -> Values:
            at = int(wrong[k])
            earlier = "unknown" if before[at] == _UNKNOWN_MODE else int(before[at])
            word = int(table["error_count"][rows[at]])
            faults = ", ".join(name for bit, name in enumerate(FAULTS) if word >> bit & 1)
            return {"before": earlier, "faults": faults or "none"}

        found = view.among_rows("TYP-306", table, rows[wrong], lambda _row: {}, dialects=_NOT_STOCK)
        yield replace(found, values=values_of)


RULES: tuple[type[Rule], ...] = (limits, telemetry, Faults)
