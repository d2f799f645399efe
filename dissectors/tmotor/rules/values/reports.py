"""ESCStatus: the status word and telemetry of each report (4.4.3)."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from dissectors.kit import NODES, Previous, Rule, rule, sender, usable
from dissectors.records import replace
from dissectors.tmotor.rules.values.fault_flags import FAULTS, FaultFlags, is_over_voltage, measured, named, worst

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Mapping

    from dissectors.kit import Array, DecodedTable, Occurrences, Severity, Values, View

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
            states = code == "TYP-304"
            worst = {} if states else {"value": ("highest", column[rows].astype(np.float64))}
            key = column[rows] if states else None
            yield view.among_rows(code, table, rows, _telling(column), dialects=dialects, key=key, worst=worst)


def _good(table: DecodedTable, wrong: Array) -> Array:
    """Return trusted rows among those that are wrong."""
    rows = wrong.nonzero()[0]
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
            worst = {"value": ((lowest + highest) / 2, table[field][rows].astype(np.float64))}
            yield view.among_rows("TYP-308", table, rows, _measured(field, table[field]), worst=worst)


def _measured(field: str, column: Array) -> Callable[[int], Values]:
    return lambda row: {"field": field, "value": float(column[row])}


def _flag(table: DecodedTable, bit: int) -> Callable[[int], Values]:
    return lambda row: {"fault": named(bit), **measured(table, row)}


class Faults(Rule):
    """Fault bits, and error mode with what went before; each is an episode."""

    rules = ("TYP-305", "TYP-306")

    def __init__(self) -> None:
        self._flags = FaultFlags()
        self._mode = np.full(NODES, _UNKNOWN_MODE, np.int8)  # the last one of each node that was not error mode
        self._failed = Previous(0)

    def feed(self, view: View) -> Iterator[Occurrences]:
        """Judge the reports of this batch, in order."""
        self._flags.note_commands(view)
        table = view.table("ESCStatus")
        if table is None:
            return
        rows = usable(table).nonzero()[0]
        word, node = table["error_count"][rows], sender(table, rows)
        faults = (word & _FAULT_BITS).astype(np.int64)
        for bit, at, rises, severity in self._flags.feed(table, rows, node, faults):
            some = rows[at]
            numbers = worst(table, some, over_voltage=is_over_voltage(bit))
            yield view.among_rows(
                "TYP-305", table, some, _flag(table, bit), severity=severity, dialects=_NOT_STOCK, worst=numbers,
                rises=rises,
            )  # fmt: skip
        modes = mode(word)
        yield from self._errors(view, table, rows, modes, node)
        others = modes != _ERROR_MODE
        self._mode[node[others]] = modes[others]  # of a node's rows the last one stays

    def _errors(self, view: View, table: DecodedTable, rows: Array, modes: Array, node: Array) -> Iterator[Occurrences]:
        wrong = (modes == _ERROR_MODE).nonzero()[0]
        if not wrong.size and self._failed.all(0):
            return
        (failed,), _ = self._failed.feed(node, (modes == _ERROR_MODE).astype(np.int64))
        if not wrong.size:
            return
        before = np.full(len(rows), _UNKNOWN_MODE)
        for code in np.unique(node[wrong]).tolist():
            mine = (node == code).nonzero()[0]
            latest = np.maximum.accumulate(np.where(modes[mine] == _ERROR_MODE, -1, np.arange(len(mine))))
            before[mine] = np.where(latest < 0, self._mode[code], modes[mine[latest]])

        def values_of(k: int) -> Values:
            at = int(wrong[k])
            earlier = "unknown" if before[at] == _UNKNOWN_MODE else int(before[at])
            word = int(table["error_count"][rows[at]])
            faults = ", ".join(name for bit, name in enumerate(FAULTS) if word >> bit & 1)
            return {"before": earlier, "faults": faults or "none", **measured(table, int(rows[at]))}

        found = view.among_rows(
            "TYP-306", table, rows[wrong], lambda _row: {}, dialects=_NOT_STOCK, worst=worst(table, rows[wrong]),
            rises=failed[wrong] == 0,
        )  # fmt: skip
        yield replace(found, values=values_of)
