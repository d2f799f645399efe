"""PUSH-305 and TYP-210: what nobody should ask of an ESC whose motor turns (4.4.4, 4.4.2)."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

from dissectors.kit import NO_TIME, SECOND, Rule, breach, sound, usable
from dissectors.tmotor.rules.joined.speeds import Speeds
from dissectors.tmotor.rules.packets.carried import ALL_UNITS, FIRST_UNIT, NO_CHANGE_8, NO_CHANGE_16, occurrence

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from dissectors.kit import DecodedTable, Occurrence, View
    from dissectors.tmotor.rules.joined.speeds import LastSpeed

_PERMANENT = 1
_ANY_UUID, _ANY_INDEX = 0xFFFFFFFF, 0xFF
_MODES = {0x88: "lock", 0x66: "free"}
_SHOWN = 4  # motors that are named
# What FocParameters sets (4.4.4 table 2), and what stands for "no change".
_WORDS = (
    "esc_id", "over_voltage_threshold", "over_current_threshold", "over_temperature_threshold", "beep_volume",
    "acceleration_limit", "deceleration_limit", "rotation_direction", "throttle_priority", "led", "report_rate",
)  # fmt: skip
_FIELDS = {**dict.fromkeys(_WORDS, NO_CHANGE_16), "bus_rate": NO_CHANGE_8}


class _Request(NamedTuple):
    """A request in a row of a table: what people call it, and its addressee."""

    table: DecodedTable
    row: int
    command: str
    unit: int | None
    uuid: int = _ANY_UUID
    channel: int = _ANY_INDEX

    @property
    def address(self) -> str:
        if self.unit is not None:
            return "all units" if self.unit == ALL_UNITS else f"unit {self.unit - FIRST_UNIT + 1}"
        if self.uuid != _ANY_UUID:
            return f"uuid {self.uuid:08X}"
        return "all ESCs" if self.channel == _ANY_INDEX else f"index {self.channel}"


class Interlocks(Rule):
    """Compares each request with the last speed of the motors that it is addressed to."""

    rules = ("PUSH-305", "TYP-210")

    def __init__(self) -> None:
        """Begin with no speed known."""
        self._speeds = Speeds()

    def feed(self, view: View) -> Iterator[Occurrence]:
        """Yield requests to motors that turn."""
        if view.start == NO_TIME:
            return
        self._speeds.feed(view)
        for one in _requests(view):
            rule, say = ("TYP-210", breach) if one.unit is None else ("PUSH-305", occurrence)
            least, window = view.number(rule, "turning_rpm"), view.number(rule, "window_s") * SECOND
            t = int(one.table.t[one.row])
            turning = [motor for motor in self._motors(one) if abs(motor.rpm) >= least and t - motor.t <= window]
            if t != NO_TIME and turning:
                asker = int(one.table.src[one.row])
                values = {"asker": asker, "command": one.command, "address": one.address, "turning": _named(turning)}
                yield say(view, one.table, one.row, rule, values)
        self._speeds.forget()

    def _motors(self, one: _Request) -> Sequence[LastSpeed]:
        bus, transfer = int(one.table.bus[one.row]), int(one.table["transfer"][one.row])
        if one.unit is not None:
            return self._speeds.of_unit(bus, one.unit, transfer)
        if one.uuid != _ANY_UUID:
            found = self._speeds.of_uuid(bus, one.uuid, transfer)
            if found is not None:
                return found
            if one.channel == _ANY_INDEX:
                return ()  # nobody knows whom it means
        return self._speeds.of_index(bus, one.channel, transfer)


def _named(motors: Sequence[LastSpeed]) -> str:
    shown = ", ".join(f"{motor.name} turned at {motor.rpm} rpm" for motor in motors[:_SHOWN])
    return shown if len(motors) <= _SHOWN else f"{shown}, and {len(motors) - _SHOWN} more turned"


def _requests(view: View) -> Iterator[_Request]:
    for name in ("SetZero", "FocParameters", "OutputControl"):
        table = view.table(f"PUSHSCI.{name}")
        if table is None:
            continue
        for row in sound(table).nonzero()[0].tolist():
            command = _command(table, name, row)
            if command:
                yield _Request(table, row, command, int(table["unit_id"][row]))
    table = view.table("ParamCfg")
    if table is not None:
        for row in (usable(table) & (table["esc_save_option"] == _PERMANENT)).nonzero()[0].tolist():
            uuid, index = int(table["esc_uuid"][row]), int(table["esc_index"][row])
            yield _Request(table, row, "ParamCfg with permanent save", None, uuid, index)


def _command(table: DecodedTable, name: str, row: int) -> str:
    """Return what people call a packet; nothing for one that may come at any time."""
    if name == "SetZero":
        return "set zero (0x08)"
    if name == "OutputControl":
        mode = int(table["control_mode"][row])
        return f"{_MODES[mode]} (mode 0x{mode:02X})" if mode in _MODES else ""
    if table["save_option"][row] == _PERMANENT:
        return "FOC parameters (0x1E) with permanent save"
    sets = any(table[field][row] != unchanged for field, unchanged in _FIELDS.items())
    return "FOC parameters (0x1E)" if sets else ""
