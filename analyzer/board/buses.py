"""Every interface: how full it is, what was lost, what its controller says."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from analyzer.board.errors import ControllerErrors, events_by_bus
from analyzer.board.meter import Meter
from analyzer.board.snapshot import BusRow
from analyzer.facts.traffic import BIT_RATE
from analyzer.rules.load import bit_times
from dissectors.kit import NO_TIME, SECOND
from dissectors.records import dataclass, field

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

    from analyzer.board.latches import Latches
    from dissectors.kit import Array, EventTable, FrameTable

_MOST_BUSES = 256  # a column of bytes names no more
_SILENT = 2 * SECOND


@dataclass(slots=True)
class _Bus:
    place: int
    received: int = 0
    dropped: int | None = None
    here: int = 0
    heard: int | None = None
    note: str = ""
    errors: ControllerErrors = field(default_factory=ControllerErrors)


class BusStates:
    """Adds up frames and events by interface.

    Args:
        bit_rates: in bits a second by the name of the interface, None where nobody knows; these are shown from the
            start, in this order.
        latches: told of losses and error frames.
    """

    def __init__(self, bit_rates: Mapping[str, int | None], latches: Latches) -> None:
        self._latches = latches
        self._bit_rates = bit_rates
        self._meter = Meter(_MOST_BUSES, 2)
        self._buses = {name: _Bus(place) for place, name in enumerate(bit_rates)}
        self._counted: set[str] = set()

    def feed(self, frames: FrameTable, names: tuple[str, ...], bits: Array | None) -> None:
        """Take the frames of a batch; `bits` are their `bit_times` if they are known."""
        if not len(frames):
            return
        places = np.array([self._bus(name).place for name in names])
        of = places[frames.bus]
        self._meter.feed(frames.t, of, (None, bit_times(frames) if bits is None else bits))
        for bus, count in enumerate(np.bincount(frames.bus, minlength=len(names)).tolist()):
            if count:
                one = self._bus(names[bus])
                if names[bus] not in self._counted:
                    one.received += count
                at = len(frames) - 1 - int(np.argmax(frames.bus[::-1] == bus))
                one.heard = int(frames.t[at]) if frames.t[at] != NO_TIME else one.heard

    def feed_events(self, events: EventTable, names: tuple[str, ...]) -> None:
        """Take the events of a batch."""
        for bus, rows in events_by_bus(events).items():
            name = names[bus] if bus < len(names) else next(iter(self._buses), "")
            self._bus(name).errors.feed(events, rows, name, self._latches)

    def take_counts(self, name: str, received: int, dropped: int, here: int) -> None:
        """Take what the receiver of an interface has counted from the start."""
        one = self._bus(name)
        self._counted.add(name)
        one.received, one.dropped, one.here = received, dropped, here

    def note(self, text: str) -> None:
        """Keep what begins with the name of an interface with it."""
        name, colon, rest = text.partition(": ")
        if colon and name in self._buses:
            self._buses[name].note = rest

    def rows(self, now: int) -> Iterator[BusRow]:
        """Give the interfaces in their order."""
        rates = self._meter.rates(now)
        for name, one in self._buses.items():
            bit_rate = self._bit_rates.get(name)
            errors = one.errors
            yield BusRow(
                name=name,
                frames=float(rates[0, one.place]),
                load=100 * float(rates[1, one.place]) / (bit_rate or BIT_RATE),
                bit_rate=bit_rate or BIT_RATE,
                assumed=bit_rate is None,
                received=one.received,
                dropped=errors.drops if one.dropped is None else one.dropped,
                here=one.here,
                error_frames=errors.count,
                tx_errors=errors.tx_errors,
                rx_errors=errors.rx_errors,
                controller=errors.controller,
                note=one.note,
                silent=one.heard is None or now - one.heard > _SILENT,
            )

    def _bus(self, name: str) -> _Bus:
        if name not in self._buses:
            self._buses[name] = _Bus(min(len(self._buses), _MOST_BUSES - 1))
        return self._buses[name]
