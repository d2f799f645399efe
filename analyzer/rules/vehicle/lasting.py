"""Memory of a rule of a vehicle file, by sender: how long something holds, and what has to follow by when.

Rows are taken in the order in which their transfers ended; the time of a row is that of its first frame.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

from analyzer.rules.vehicle.at_hand import is_channel, is_unit
from dissectors.kit import NO_TIME, SECOND
from dissectors.records import dataclass, replace

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator

    from dissectors.kit import Values

MOST_STREAMS = 4096  # senders and devices that are followed; of more the ones that began first are forgotten
MOST_OPEN = 256  # demands that wait at a time
PAUSE = 3 * SECOND  # reports further apart do not show that something held in between
_SET_BACK = 2 * SECOND  # a transfer lasts at most so long; a time that is further back is another clock's
GRACE = 3 * SECOND  # when all transfers of before have ended


class Streaks:
    """Finds rows at which something has held for some time, sender by sender.

    Args:
        lasts: in ns.
    """

    def __init__(self, lasts: int) -> None:
        self._lasts = lasts
        self._open: dict[int, tuple[int, int]] = {}  # since when, and when it was seen last

    @property
    def idle(self) -> bool:
        """True while nothing holds."""
        return not self._open

    @property
    def keys(self) -> list[int]:
        """Whose rows it holds for now."""
        return list(self._open)

    def feed(self, keys: Iterable[int], times: Iterable[int], holds: Iterable[bool]) -> list[int]:
        """Take the rows of a batch: whose they are, when, and whether it holds; return the places where it has."""
        found, open_, longest = [], self._open, max(PAUSE, self._lasts)
        for place, (key, t, true) in enumerate(zip(keys, times, holds, strict=True)):
            known = open_.pop(key, None)
            if not true or t == NO_TIME:
                continue
            since = t if known is None or not 0 <= t - known[1] <= longest else known[0]
            open_[key] = since, t
            if len(open_) > MOST_STREAMS:
                del open_[next(iter(open_))]
            if t - since >= self._lasts:
                found.append(place)
        return found


class Event(NamedTuple):
    """A row that a demand looks at.

    `does` it open a demand, `withdraws` it one, or can it be what is demanded (`answers`)? `stream` tells whose it is,
    `device` what it speaks of; `told` is what a demand compares with.
    """

    t: int
    bus: int
    stream: int
    device: int
    opens: bool
    withdraws: bool
    answers: bool
    told: object
    place: int


class DemandWords(NamedTuple):
    """The words for a demand that nothing answers: who demanded, of which type, its frames and values."""

    node: int | None
    type: str
    frames: tuple[int, ...]
    lines: tuple[str, ...]
    values: Values


@dataclass(frozen=True, slots=True)
class OpenDemand:
    """A demand, to be met until `until`; a row of the batch at `place` opened it, `shown` is what to say of it."""

    t: int
    until: int
    told: object
    place: int
    shown: DemandWords | None = None


def _alike(one: int, other: int) -> bool:
    """Return whether both are units, or both channels."""
    return bool((is_unit(one) and is_unit(other)) or (is_channel(one) and is_channel(other)))


class Demands:
    """Follows what has to be followed by something else within some time.

    Args:
        within: in ns.
        same: only the stream that has opened a demand can answer it.
    """

    def __init__(self, within: int, *, same: bool) -> None:
        self._within, self._same = within, same
        self._open: dict[tuple[int, int, int], OpenDemand] = {}  # by bus, device, stream
        self._latest = NO_TIME
        self.decided = False  # one was answered or not

    @property
    def idle(self) -> bool:
        """True while nothing is demanded."""
        return not self._open

    def feed(self, events: Iterable[Event]) -> Iterator[tuple[OpenDemand, int]]:
        """Take the rows of a batch; yield demands that nothing has answered in time, each with its bus."""
        for one in events:
            if one.t == NO_TIME:
                continue
            if one.t < self._latest - _SET_BACK:
                self._open.clear()
                self._latest = one.t
            self._latest = max(self._latest, one.t) if self._open else one.t
            if one.answers:
                yield from self._answer(one)
            if one.opens or one.withdraws:
                yield from self._ask(one)

    def keep(self, show: Callable[[int], DemandWords]) -> None:
        """Find out what is to be said of demands that stay open, while their rows are there."""
        for key, demand in self._open.items():
            if demand.shown is None:
                self._open[key] = replace(demand, shown=show(demand.place))

    def overdue(self, now: int, *, over: bool = False) -> Iterator[tuple[OpenDemand, int]]:
        """Yield those that nothing can answer any more at a time, or at the end (`over`)."""
        for key, demand in list(self._open.items()):
            if now > demand.until + (0 if over else GRACE):
                del self._open[key]
                yield self._missed(demand, key)

    def _missed(self, demand: OpenDemand, key: tuple[int, int, int]) -> tuple[OpenDemand, int]:
        self.decided = True
        return demand, key[0]

    def _answer(self, one: Event) -> Iterator[tuple[OpenDemand, int]]:
        for key, demand in list(self._open.items()):
            bus, device, stream = key
            other = self._same and stream != one.stream
            apart = device != one.device and _alike(device, one.device)
            if bus != one.bus or other or apart or one.t < demand.t:
                continue
            del self._open[key]
            if one.t > demand.until:
                yield self._missed(demand, key)
            self.decided = True

    def _ask(self, one: Event) -> Iterator[tuple[OpenDemand, int]]:
        key = one.bus, one.device, one.stream
        known = self._open.get(key)
        if known is not None and one.t > known.until:
            del self._open[key]
            yield self._missed(known, key)
            known = None
        if one.withdraws:
            self._open.pop(key, None)
        elif known is None or known.told != one.told or one.t < known.t:
            self._open.pop(key, None)
            self._open[key] = OpenDemand(one.t, one.t + self._within, one.told, one.place)
            if len(self._open) > MOST_OPEN:
                del self._open[next(iter(self._open))]
