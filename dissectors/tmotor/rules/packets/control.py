"""PUSH-306 and PUSH-307: what control packets ask of a motor, and what its status packets show (4.4.4, 4.4.5)."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from dissectors.kit import NO_TIME, SECOND, Rule, sound
from dissectors.records import dataclass, field, replace
from dissectors.tmotor.rules.joined.joins import MOST_UNITS, LastCommands, in_order
from dissectors.tmotor.rules.packets.carried import FIRST_UNIT, occurrence

if TYPE_CHECKING:
    from collections.abc import Iterator

    from dissectors.kit import DecodedTable, Occurrence, Severity, View

_SPEED, _CURRENT, _POSITION = (0x33, 0x3A), (0x44, 0x4A), (0x11, 0x1A)
_LOCK, _LOCKED = 0x88, 0x11
_JUDGED = (*_SPEED, *_CURRENT, *_POSITION, _LOCK)
_ENOUGH = 3  # reports
_NEARER = 0.8  # what comes nearer by a fifth is on its way


class _Off(NamedTuple):
    """A status packet that is not what was asked for: how far, and what to say."""

    rule: str
    far: float
    told: str
    severity: Severity | None = None


@dataclass(slots=True)
class _Order:
    """A control mode in force, since when, and the reports one after the other that are off."""

    t: int
    mode: int
    set_point: int
    place: float | None = None  # where a lock found the rotor
    off: list[tuple[Occurrence, float]] = field(default_factory=list)
    told: bool = False


class Control(Rule):
    """Follows the last control packet of each unit; throttle above zero on its channel takes it over."""

    rules = ("PUSH-306", "PUSH-307")

    def __init__(self) -> None:
        """Begin without an order."""
        self._orders: dict[tuple[int, int], _Order] = {}
        self._last = LastCommands()

    def feed(self, view: View) -> Iterator[Occurrence]:
        """Yield units that have not followed for long enough."""
        asked, status = view.table("PUSHSCI.OutputControl"), view.table("PUSHCAN.MotorStatus")
        if asked is not None or (status is not None and self._orders):
            for table, row in in_order((asked, _rows(asked)), (status, _rows(status))):
                if table is asked:
                    self._ask(table, row)
                else:
                    yield from self._look(view, table, row)
        self._last.feed(view)

    def _ask(self, table: DecodedTable, row: int) -> None:
        key, mode = (int(table.bus[row]), int(table["unit_id"][row])), int(table["control_mode"][row])
        point, before = int(table["set_point"][row]), self._orders.get(key)
        if before is not None and (before.mode, before.set_point) == (mode, point):
            return
        self._orders.pop(key, None)
        if mode in _JUDGED and len(self._orders) < MOST_UNITS:
            self._orders[key] = _Order(int(table.t[row]), mode, point)

    def _look(self, view: View, table: DecodedTable, row: int) -> Iterator[Occurrence]:
        bus, unit, t = int(table.bus[row]), int(table["unit_id"][row]), int(table.t[row])
        order = self._orders.get((bus, unit))
        if order is None:
            return
        if self._throttled(view, table, row, unit - FIRST_UNIT):
            order.t, order.place = t, None
            order.off.clear()
        if t - order.t < view.number("PUSH-306", "settle_s") * SECOND:
            return
        off = _off(view, table, row, order)
        if off is None:
            order.off.clear()
            order.told = False
            return
        if order.told:
            return
        values = {"unit": unit - FIRST_UNIT + 1, "mode": order.mode, "told": off.told}
        found = occurrence(view, table, row, off.rule, values, held=True, severity=off.severity)
        order.off = [*order.off[:_ENOUGH], (found, off.far)]
        first, far = order.off[0]
        lasts = t - first.t >= view.number("PUSH-306", "lasts_s") * SECOND
        if len(order.off) >= _ENOUGH and lasts and off.far > _NEARER * far:
            order.told = True
            yield replace(first)

    def _throttled(self, view: View, table: DecodedTable, row: int, index: int) -> bool:
        """Return whether the last throttle for an index before a report is above 0."""
        if index < 0:
            return False
        command = self._last.in_force(view, int(table.bus[row]), index, table, np.array([row]))
        return bool(command.cmd[0] > 0)


def _off(view: View, table: DecodedTable, row: int, order: _Order) -> _Off | None:
    """Return in what a status packet is not as its order; None if it is, or nothing can be said."""
    speed, share = abs(int(table["speed"][row])), view.number("PUSH-306", "share_pct") / 100
    if order.mode in _SPEED:
        far = float(abs(speed - order.set_point))
        wrong = far > max(share * order.set_point, view.number("PUSH-306", "speed_rpm"))
        return _Off("PUSH-306", far, f"{order.set_point} rpm asked, {speed} rpm reported") if wrong else None
    if order.mode in _CURRENT:
        wanted, current = order.set_point / 100, abs(float(table["current"][row]))
        far = abs(current - wanted)
        wrong = far > max(2 * share * wanted, view.number("PUSH-306", "current_a"))
        told = f"{wanted:.1f} A asked, {current:.1f} A reported"
        return _Off("PUSH-306", far, told, "note") if wrong else None
    position, limit = float(table["position"][row]), view.number("PUSH-306", "position_deg")
    if order.mode in _POSITION:
        wanted = order.set_point / 10
        ends = (wanted,) if order.mode == _POSITION[0] else (wanted, -wanted)
        far = min(_angle(position, end) for end in ends)
        return _Off("PUSH-306", far, f"{wanted:.1f} deg asked, {position:.1f} deg reported") if far > limit else None
    return _unlocked(table, row, order, (speed, position, limit))


def _unlocked(table: DecodedTable, row: int, order: _Order, measured: tuple[int, float, float]) -> _Off | None:
    speed, position, limit = measured
    status = int(table["system_status"][row])
    if order.place is None:
        order.place = position
    moved = _angle(position, order.place)
    if status != _LOCKED:
        return _Off("PUSH-307", 1.0, f"system status 0x{status:02X} instead of 0x11")
    if moved > limit:
        return _Off("PUSH-307", moved, f"system status 0x11, but the rotor moved {moved:.0f} deg at {speed} rpm")
    return None


def _angle(one: float, other: float) -> float:
    """Return degrees between two positions, the shorter way."""
    return abs((one - other + 180) % 360 - 180)


def _rows(table: DecodedTable | None) -> list[int]:
    rows: list[int] = [] if table is None else (sound(table) & (table.t != NO_TIME)).nonzero()[0].tolist()
    return rows
