"""The controller of an interface as error frames describe it, and how many of them there were."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from analyzer.facts.error_frames import CONTROLLER, kind_of, overflowed
from analyzer.tables import EVENTS
from dissectors.records import dataclass

if TYPE_CHECKING:
    from analyzer.board.latches import Latches
    from analyzer.board.snapshot import Controller
    from dissectors.kit import EventTable

DROP, ERROR_FRAME = EVENTS.index("drop"), EVENTS.index("error frame")
# linux/can/error.h
_BUS_OFF, _RESTARTED = 0x040, 0x100
_ACTIVE, _PASSIVE, _WARNING = 0x40, 0x30, 0x0C
_PASSIVE_FROM, _WARNING_FROM = 128, 96
_TOLD = 4  # data bytes that tell one kind from another


@dataclass(slots=True)
class ControllerErrors:
    """One interface. Counters and state are None and empty until an error frame tells them."""

    count: int = 0
    tx_errors: int | None = None
    rx_errors: int | None = None
    controller: Controller = ""
    drops: int = 0

    def feed(self, events: EventTable, rows: list[int], name: str, latches: Latches) -> None:
        """Take error frames and drops of this interface, in their order."""
        counted, tx, rx = (column.tolist() for column in (events.has("tx_errors"), events.tx_errors, events.rx_errors))
        for row in rows:
            number, t = int(events.number[row]), int(events.t[row])
            if events.kind[row] == DROP:
                self.drops += number
                latches.put("drop", name, name, "frames lost", t, count=max(1, number))
                continue
            data = events.data(row)[:_TOLD]
            if overflowed(number, data):
                latches.put("drop", (name, ""), name, "overflow of the receiver", t)
                continue
            self.count += 1
            kind, state = kind_of(number, data), _state(number, data)
            latches.put("error", (name, kind), name, kind, t)
            if counted[row]:
                self.tx_errors, self.rx_errors = tx[row], rx[row]
                state = state or _by_counters(max(tx[row], rx[row]), self.controller)
            elif state == "error-active":  # it began anew, at counts that nobody has told yet
                self.tx_errors = self.rx_errors = None
            self.controller = state or self.controller


def events_by_bus(events: EventTable) -> dict[int, list[int]]:
    """Return rows of error frames and drops by interface; those that name none belong to the first one."""
    rows = np.flatnonzero((events.kind == DROP) | (events.kind == ERROR_FRAME))
    buses = np.where(events.has("bus"), events.bus, 0)[rows]
    return {int(bus): rows[buses == bus].tolist() for bus in np.unique(buses)}


def _state(error_class: int, data: bytes) -> Controller:
    if error_class & _BUS_OFF:
        return "bus-off"
    if error_class & _RESTARTED:
        return "error-active"
    if error_class & CONTROLLER and len(data) > 1:
        if data[1] & _PASSIVE:
            return "error-passive"
        if data[1] & _WARNING:
            return "error-warning"
        if data[1] & _ACTIVE:
            return "error-active"
    return ""


def _by_counters(errors: int, before: Controller) -> Controller:
    if before == "bus-off":  # only a restart ends it
        return before
    if errors >= _PASSIVE_FROM:
        return "error-passive"
    return "error-warning" if errors >= _WARNING_FROM else "error-active"
