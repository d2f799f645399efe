"""The basis by which flights are told: spells of devices, put together to stretches of time."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from analyzer.flight.clock import ANEW
from analyzer.flight.spells import Spells
from analyzer.flight.thresholds import lasting
from dissectors.kit.order import changes
from dissectors.records import dataclass, field
from dissectors.times import NO_TIME

if TYPE_CHECKING:
    from collections.abc import Hashable, Iterator

    from analyzer.flight.clock import RecordedClock, RowPlaces, Spot
    from analyzer.flight.spells import Spell
    from dissectors.kit import Array

MOST_STRETCHES = 1024  # kept apart
MOST_FLIGHTS = 4096
_MOST_POWER_UPS = 1 << 16


@dataclass(slots=True)
class Stretch:
    """Time in which motors turned, of one ESC or of several together. `who` are whose they are, as they were fed.

    `over` says that it ended, `silent` that this is known only from reports that did not come.
    """

    first: Spot
    last: Spot
    over: bool
    silent: bool
    who: set[Hashable] = field(default_factory=set)


class FlightBasis:
    """One way to tell flights: feed it all devices.

    Bounds: those of `Spells`, `MOST_STRETCHES` kept apart, `MOST_FLIGHTS`.

    Args:
        clock: of the capture.
        patience: recorded time without a report after which nothing is known of a device.
    """

    def __init__(self, clock: RecordedClock, patience: int) -> None:
        self.heard = False
        self._clock = clock
        self._spells = Spells(patience, lasting("turning") + 1)
        self._stretches: list[Stretch] = []
        self._power_ups: list[int] = []  # frames
        self._holes: dict[Hashable, int] = {}  # before the last report of each device

    def feed(self, key: Hashable, on: Array, at: RowPlaces, who: Hashable = None, chs: Array | None = None) -> None:
        """Take the next reports of a device, those `on` in which it turns.

        `who` says whose device it is; reports of several channels have a bit for each that turns, in `chs`.
        """
        timed = at.t != NO_TIME
        if not timed.all():
            at, on, chs = at.take(timed), on[timed], None if chs is None else chs[timed]
        if not len(on):
            return
        self.heard = True
        for part in self._spells.feed(key, on, at, self._torn(key, at)):
            part.spell.memory = part.spell.memory or set()
            if chs is not None and part.stop > part.start:
                bits = int(np.bitwise_or.reduce(chs[part.start : part.stop]))
                part.spell.memory |= {ch for ch in range(bits.bit_length()) if bits >> ch & 1}
            elif who is not None and part.stop > part.start:
                part.spell.memory.add(who)
            if part.over:
                self._add(part.spell, over=True)

    def stretches(self) -> list[Stretch]:
        """Return the flights, in order, after the last report."""
        for spell in self._spells.finish():
            self._add(spell, over=False)
        return list(self._joined())[:MOST_FLIGHTS]

    def _torn(self, key: Hashable, at: RowPlaces) -> Array | None:
        """Return the reports before which the sender was powered up, or so much is missing that it may have landed."""
        if not self._clock.holes:
            return None
        behind = self._clock.holes_before(at.frame)
        crossed = changes(behind, self._holes.get(key, int(behind[0])))
        self._holes[key] = int(behind[-1])
        if not len(crossed):
            return None
        torn = np.zeros(len(at), bool)
        step, long = at.step[crossed], self._clock.lengths_before(behind[crossed]) > lasting("long_hole")
        torn[crossed] = (step == ANEW) | (long & (step != 1))
        if len(self._power_ups) < _MOST_POWER_UPS:
            self._power_ups += at.frame[torn].tolist()
        return torn

    def _add(self, spell: Spell, *, over: bool) -> None:
        # What the end of the recording cuts off may have turned since the report before.
        began = spell.first if over or spell.before is None else spell.before
        if spell.last.ran - max(began.ran, spell.first.ran - lasting("turning")) <= lasting("turning"):
            return
        self._stretches.append(Stretch(spell.first, spell.last, over, spell.silent, spell.memory))
        if len(self._stretches) > MOST_STRETCHES:
            self._stretches = list(self._joined())[: 2 * MOST_FLIGHTS]

    def _joined(self) -> Iterator[Stretch]:
        """Yield the stretches, of which those that are close have become one."""
        power_ups = np.array(sorted(self._power_ups), np.int64)
        found: Stretch | None = None
        for one in sorted(self._stretches, key=lambda one: (one.first.ran, one.first.frame)):
            if found is None:
                found = one
                continue
            apart = one.first.ran - found.last.ran > lasting("between_flights")
            ups = np.searchsorted(power_ups, [found.last.frame, one.first.frame], "right")
            if apart or ups[0] < ups[1]:
                yield found
                found = one
                continue
            ends = max(found, one, key=lambda some: (some.last.ran, some.last.frame))
            found = Stretch(found.first, ends.last, ends.over, ends.silent, found.who | one.who)
        if found is not None:
            yield found
