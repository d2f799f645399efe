"""How fast motors turn, by what their ESCs said last, and which of them a request is addressed to."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from dissectors.kit import NO_TIME, sound
from dissectors.tmotor.rules.joined.joins import MOST_UNITS, units
from dissectors.tmotor.rules.packets.carried import ALL_UNITS, FIRST_UNIT, by_unit

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator

    from dissectors.kit import Array, DecodedTable, View

_BY_INDEX, _BY_UNIT = 0, 1  # how a report names its ESC
_EVERYBODY = 0xFF  # an index


class LastSpeed(NamedTuple):
    """The last speed of a motor in rpm, and when it was said; `name` is its channel, else its unit."""

    name: str
    t: int
    rpm: int


class _Place(NamedTuple):
    """A motor as its reports name it: by index (4.4.3) or by power unit (4.4.5)."""

    bus: int
    node: int
    how: int
    number: int

    @property
    def name(self) -> str:
        return f"ch{self.number + 1}" if self.how == _BY_INDEX else f"unit {self.number - FIRST_UNIT + 1}"


class _Reports(NamedTuple):
    """Reports of one motor in a batch: rows of its table, with the speed of each row in rpm."""

    table: DecodedTable
    rows: Array
    speed: Array

    def said(self, at: int) -> tuple[int, int]:
        """Return time and speed of one of them."""
        row = self.rows[at]
        return int(self.table.t[row]), int(self.speed[row])

    def before(self, transfer: int) -> int:
        """Return how many came before a transfer."""
        return int(self.table["transfer"][self.rows].searchsorted(np.uint64(transfer)))


class Speeds:
    """The speed of each motor by ESCStatus and MotorStatus; the first `MOST_UNITS` count."""

    def __init__(self) -> None:
        self._last: dict[_Place, tuple[int, int]] = {}
        self._now: dict[_Place, _Reports] = {}
        self._told: dict[_Place, tuple[int, int]] = {}  # what the present batch says last
        self._uuids: dict[tuple[int, int], tuple[int, int, int]] = {}  # by bus: transfer, node, index of a ParamGet

    def feed(self, view: View) -> None:
        """Make a batch the present one."""
        self._last |= self._told
        self._now = {
            place: reports
            for place, reports in _reports(view)
            if place in self._last or len(self._last) + len(self._told) < MOST_UNITS
        }
        self._told = {place: reports.said(-1) for place, reports in self._now.items()}
        self._note_uuids(view)

    def forget(self) -> None:
        """Let go of the batch, of which the last reports stay."""
        self._now = {}

    def of_unit(self, bus: int, unit: int, transfer: int) -> list[LastSpeed]:
        """Return what the motors of a power unit (0xA1 is 1, 0xFF all) did last before a transfer.

        Those who send packets of this unit are meant; where nobody does, the ESC whose index is one less.
        """
        if unit == ALL_UNITS:
            return self._all(bus, transfer)
        nodes = {place.node for place in self._places(bus) if (place.how, place.number) == (_BY_UNIT, unit)}
        if nodes:
            return self._joined(self._of_nodes(bus, nodes, unit - FIRST_UNIT), transfer)
        return self.of_index(bus, unit - FIRST_UNIT, transfer)

    def of_index(self, bus: int, index: int, transfer: int) -> list[LastSpeed]:
        """Return what the motors of an index (0xFF is all) did last before a transfer."""
        if index == _EVERYBODY:
            return self._all(bus, transfer)
        nodes = {place.node for place in self._places(bus) if (place.how, place.number) == (_BY_INDEX, index)}
        return self._joined(self._of_nodes(bus, nodes, index), transfer)

    def of_uuid(self, bus: int, uuid: int, transfer: int) -> list[LastSpeed] | None:
        """Return what the motor of the ESC with a UUID did last before a transfer, None if no ParamGet told whose."""
        told = self._uuids.get((bus, uuid))
        if told is None or told[0] > transfer:
            return None
        return self._joined(self._of_nodes(bus, {told[1]}, told[2]), transfer)

    def _all(self, bus: int, transfer: int) -> list[LastSpeed]:
        return self._joined(self._places(bus), transfer)

    def _places(self, bus: int) -> list[_Place]:
        return sorted(place for place in self._last.keys() | self._now.keys() if place.bus == bus)

    def _of_nodes(self, bus: int, nodes: Iterable[int], index: int) -> list[_Place]:
        """Return the motors of some nodes; of a node with several only the one with an index, and its unit."""
        found: list[_Place] = []
        for node in nodes:
            mine = [place for place in self._places(bus) if place.node == node]
            several = sum(place.how == _BY_INDEX for place in mine) > 1
            found += [place for place in mine if not several or place.number in (index, index + FIRST_UNIT)]
        return sorted(found)

    def _joined(self, places: Iterable[_Place], transfer: int) -> list[LastSpeed]:
        """Return one entry for each node and number, of what was said last."""
        found: dict[tuple[int, int], LastSpeed] = {}
        for place in places:
            said = self._before(place, transfer)
            if said is None:
                continue
            index = place.number - (FIRST_UNIT if place.how == _BY_UNIT else 0)
            one = LastSpeed(place.name, *said)
            both = self._alone(place) or (place.node, index)
            if both not in found:
                found[both] = one
            elif one.t > found[both].t:
                found[both] = one._replace(name=found[both].name)
        return list(found.values())

    def _alone(self, place: _Place) -> tuple[int, int] | None:
        """Return a node's only motor, which may have a unit of any number."""
        indexes = [one.number for one in self._places(place.bus) if (one.node, one.how) == (place.node, _BY_INDEX)]
        return (place.node, indexes[0]) if len(indexes) == 1 else None

    def _before(self, place: _Place, transfer: int) -> tuple[int, int] | None:
        reports = self._now.get(place)
        at = 0 if reports is None else reports.before(transfer)
        return self._last.get(place) if reports is None or not at else reports.said(at - 1)

    def _note_uuids(self, view: View) -> None:
        table = view.table("ParamGet")
        if table is None:
            return
        for row in np.flatnonzero(table.trusted).tolist():
            key = int(table.bus[row]), int(table["esc_uuid"][row])
            if key in self._uuids or len(self._uuids) < MOST_UNITS:
                what = int(table["transfer"][row]), int(table.src[row]), int(table["esc_index"][row])
                self._uuids.setdefault(key, what)


def _reports(view: View) -> Iterator[tuple[_Place, _Reports]]:
    table = view.table("ESCStatus")
    if table is not None:
        for esc, reports in units(view).items():
            yield _Place(esc.bus, esc.node, _BY_INDEX, esc.index), _Reports(table, reports, table["rpm"])
    packets = view.table("PUSHCAN.MotorStatus")
    if packets is None:
        return
    rows = np.flatnonzero(sound(packets) & (packets.t != NO_TIME))
    for (bus, node, unit), mine in by_unit(packets, rows):
        yield _Place(bus, node, _BY_UNIT, unit), _Reports(packets, mine, packets["speed"])
