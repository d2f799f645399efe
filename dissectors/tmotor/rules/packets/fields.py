"""PUSH-101, -302, -403 to -406, -408, -501 and -502: values of packets that cannot be, or need a remark."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from dissectors.kit import rule, sound
from dissectors.tmotor.rules.packets.carried import NO_CHANGE_8, NO_CHANGE_16, hexadecimal, occurrence

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence

    from dissectors.kit import Array, DecodedTable, Occurrence, Occurrences, Values, View, Worst

    Worsts = dict[str, tuple[Worst, Array]]

_SWITCHES = {
    "throttle priority": "throttle_priority.priority",
    "position loop": "throttle_priority.position_loop",
    "save option": "save_option",
}
_MOST_RATE, _MOST_REPORTS, _MOST_SAVE, _MOST_SWITCH = 5, 400, 1, 1
_SAVE_CUT = 2  # the printed list of 4.4.5 table 2 no 54 breaks off behind "2-"
# 4.4.4 table 4 no 8-9: duty cycle, current, speed, brake current; then position.
_LIMITS = dict.fromkeys((0x55, 0x5A, 0x44, 0x4A, 0x33, 0x3A, 0xBB), 10_000) | dict.fromkeys((0x11, 0x1A, 0x88), 3600)
_NO_LIMIT = 0xFFFF
_USUAL_PULSE, _KNOWN_PULSE = (1040, 1950), (800, 2200)  # us; 4.4.1 explanation 5
_BELOW_ZERO, _KELVIN = 0x8000, (23_315, 47_315)  # raw; -40 to 200 degC
_LIMIT = 32_767
_FIRST_PRINTED, _LAST_PRINTED = 0x20, 0x7E


@rule("PUSH-101")
def foc_parameters(view: View) -> Iterator[Occurrence]:
    """Find fields of the set packet out of range; all bits set leaves a field unchanged (4.4.4 table 2)."""
    table = view.table("PUSHSCI.FocParameters")
    if table is None:
        return
    for row in sound(table).nonzero()[0].tolist():
        found = [(name, int(table[column][row])) for name, column in _SWITCHES.items()]
        wrong = [(name, value) for name, value in found if value > 1 and value != NO_CHANGE_8]
        rate, reports = int(table["bus_rate"][row]), int(table["report_rate"][row])
        if rate > _MOST_RATE and rate != NO_CHANGE_8:
            wrong.append(("bus rate", rate))
        if reports > _MOST_REPORTS and reports != NO_CHANGE_16:
            wrong.append(("report rate", reports))
        for name, value in wrong:
            yield occurrence(view, table, row, "PUSH-101", {"field": name, "value": value})


@rule("PUSH-302")
def set_points(view: View) -> Iterator[Occurrences]:
    """Find set points above what their mode's unit has."""
    table = view.table("PUSHSCI.OutputControl")
    if table is None:
        return
    limits = np.full(256, _NO_LIMIT)
    limits[list(_LIMITS)] = list(_LIMITS.values())
    mode, point = table["control_mode"], table["set_point"]
    rows = (sound(table) & (point > limits[mode])).nonzero()[0]

    def values(row: int) -> dict[str, int]:
        code = int(mode[row])
        return {"mode": code, "value": int(point[row]), "limit": _LIMITS[code]}

    worst: Worsts = {"value": ("highest", point[rows].astype(np.float64))}
    yield view.among_rows("PUSH-302", table, rows, values, key=mode[rows], worst=worst)


@rule("PUSH-403", "PUSH-404", "PUSH-405", "PUSH-406", "PUSH-408")
def motor_status(view: View) -> Iterator[Occurrences]:
    """Find wrong values of a status packet, each alone (4.4.5 table 1)."""
    table = view.table("PUSHCAN.MotorStatus")
    if table is not None:
        yield from _motor_states(view, table)
        yield from _pulses(view, table)
        yield from _temperatures(view, table)
        yield from _limits(view, table)


def _motor_states(view: View, table: DecodedTable) -> Iterator[Occurrences]:
    other = table["motor_status"]
    rows = (sound(table) & (other != 0)).nonzero()[0]
    if len(rows):
        yield view.among_rows("PUSH-406", table, rows, lambda row: {"value": int(other[row])}, key=other[rows])


def _pulses(view: View, table: DecodedTable) -> Iterator[Occurrences]:
    good, pulse, throttle = sound(table), table["pwm"], table["throttle"]
    usual = (pulse == 0) | ((pulse >= _USUAL_PULSE[0]) & (pulse <= _USUAL_PULSE[1]))
    if not usual.all():
        known = (pulse >= _KNOWN_PULSE[0]) & (pulse <= _KNOWN_PULSE[1])
        odd = good & ~usual

        def width(row: int) -> dict[str, float]:
            return {"microseconds": float(pulse[row])}

        for mask, severity in ((odd & known, None), (odd & ~known, "warning")):
            rows = mask.nonzero()[0]
            if len(rows):
                far: Worsts = {"microseconds": (sum(_USUAL_PULSE) / 2, pulse[rows].astype(np.float64))}
                yield view.among_rows("PUSH-403", table, rows, width, severity=severity, worst=far)
    rows = (good & (np.rint(throttle * 10) > 1000)).nonzero()[0]
    if len(rows):
        most: Worsts = {"percent": ("highest", throttle[rows].astype(np.float64))}
        yield view.among_rows("PUSH-404", table, rows, lambda row: {"percent": float(throttle[row])}, worst=most)


def _temperatures(view: View, table: DecodedTable) -> Iterator[Occurrences]:
    raw = np.rint(table["temperature"] * 100)
    good = sound(table) & (raw >= _KELVIN[0])
    if not good.any():
        return
    readings = {
        "hundredths of a degree below zero": raw >= _BELOW_ZERO,
        "hundredths of a kelvin": (raw <= _KELVIN[1]) & (raw < _BELOW_ZERO),
    }
    for reading, mask in readings.items():
        rows = (good & mask).nonzero()[0]
        if len(rows):
            yield view.among_rows("PUSH-405", table, rows, _temperature(raw, reading))


def _temperature(raw: Array, reading: str) -> Callable[[int], Values]:
    return lambda row: {"value": int(raw[row]), "reading": reading}


def _limits(view: View, table: DecodedTable) -> Iterator[Occurrences]:
    good, speed = sound(table), table["speed"]
    rows = (good & ((speed >= _LIMIT) | (speed <= -_LIMIT))).nonzero()[0]

    def turning(row: int) -> dict[str, str]:
        return {"field": "speed", "value": f"{int(speed[row])} rpm"}

    if len(rows):
        yield view.among_rows("PUSH-408", table, rows, turning)
    current = table["current"]
    rows = (good & (np.rint(np.abs(current) * 100) >= _LIMIT)).nonzero()[0]

    def flowing(row: int) -> dict[str, str]:
        return {"field": "current", "value": f"{float(current[row]):.2f} A"}

    if len(rows):
        yield view.among_rows("PUSH-408", table, rows, flowing)


@rule("PUSH-501", "PUSH-502")
def foc_feedback(view: View) -> Iterator[Occurrence]:
    """Find version texts that are none, and settings that cannot be (4.4.5 table 2)."""
    table = view.table("PUSHCAN.FocFeedback")
    if table is None:
        return
    for row in sound(table).nonzero()[0].tolist():
        for part in ("hardware", "software"):
            version = table.cell(f"{part}_version", row)
            if not _readable(version):
                values = {"field": f"{part} version", "bytes": hexadecimal(version)}
                yield occurrence(view, table, row, "PUSH-501", values)
        limits = {
            "position loop": _MOST_SWITCH, "throttle priority": _MOST_SWITCH,
            "bus rate": _MOST_RATE, "report rate": _MOST_REPORTS, "save option": _MOST_SAVE,
        }  # fmt: skip
        for name, most in limits.items():
            value = int(table[name.replace(" ", "_")][row])
            if value > most:
                cut = name == "save option" and value == _SAVE_CUT
                values = {"field": name, "value": str(value)}
                yield occurrence(view, table, row, "PUSH-502", values, severity="note" if cut else None)


def _readable(version: Sequence[int]) -> bool:
    """Return whether all before the first NUL or the spaces at the end is printable ASCII."""
    text = bytes(version).split(b"\0")[0].rstrip(b" ")
    return all(_FIRST_PRINTED <= byte <= _LAST_PRINTED for byte in text)
