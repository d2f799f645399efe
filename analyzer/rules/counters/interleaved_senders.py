"""Several senders behind one node ID and type, each with a counter of its own."""

from __future__ import annotations

from collections import deque
from itertools import starmap
from typing import TYPE_CHECKING

from analyzer.tables import TRANSFER_IDS
from dissectors.kit import NO_TIME
from dissectors.records import dataclass

if TYPE_CHECKING:
    from collections.abc import Sequence

    from analyzer.rules.counters.session_starts import OddStart

_NUMBERS = ("no", "one", "two", "three", "four", "five", "six", "seven", "eight")
MOST_SENDERS = 8
_PATIENCE = 4  # turns that a counter may miss
_LATEST = 64  # starts that are judged, and of them:
_NEARLY_ALL, _MOSTLY = 7 / 8, 3 / 4
_TIMING = 1 / 4  # so far off may a period be


@dataclass(slots=True, eq=False)
class Chain:
    """One sender's counter: the ID it came to, and how often it went on by 1 after another one spoke, at least.

    `turns` is how often it took over, `begun` and `heard` at which odd start first and last; `start` is that frame.
    `since` is the time of the start before its first one.
    """

    last: int
    begun: int
    since: int = NO_TIME
    length: int = 1
    turns: int = 1
    heard: int = 0
    start: int = -1

    def silent(self, now: int) -> bool:
        """Return whether it has not taken over for far longer than it used to: it is gone."""
        usual = (self.heard - self.begun) / max(self.turns - 1, 1)
        return now - self.heard > _PATIENCE * (usual + 1)


class InterleavedSenders:
    """Tells whether a session is several interleaved counters; it is told only of starts whose step is not 1.

    A lost transfer leaves a counter that nobody continues. Several senders continue all of them, by turns, whether or
    not they finish what they start. Losses that come at regular intervals may look the same, but then time goes on as
    the IDs do.
    """

    def __init__(self) -> None:
        self._speaks: Chain | None = None
        self._waiting: list[Chain] = []  # the one that spoke last at the end
        self._at = NO_TIME  # of the latest odd start
        self._count = 0  # of them
        self._went_on: deque[bool] = deque(maxlen=_LATEST)  # whether it continued a counter that waited
        self._continued = 0  # how often
        self._in_time: deque[bool] = deque(maxlen=_LATEST)  # whether losses explain it
        self._unjudged: deque[tuple[int, int, OddStart]] = deque(maxlen=_LATEST)  # the latest, asked only if need be

    def add(self, one: OddStart) -> bool:
        """Add a start; return whether it goes on with a counter that waited."""
        spoke = self._speaks or Chain(one.before, 0)
        known, follows = None, (one.transfer_id - 1) % TRANSFER_IDS
        for chain in reversed(self._waiting):
            if chain.last == follows:
                known = chain  # the latest one: an older one that is as far was left behind by a loss
                break
        if one.again and known is None:
            return False
        self._count += 1
        silent = (one.before - spoke.last) % TRANSFER_IDS
        self._unjudged.append((silent, one.since - self._at if self._at != NO_TIME else 0, one))
        if silent:
            spoke.last = one.before
            spoke.length += 1
        self._waiting.append(spoke)
        if known is None:
            goes_on = Chain(one.transfer_id, self._count, one.since)
            del self._waiting[: -MOST_SENDERS + 1]
        else:
            goes_on = known
            self._waiting.remove(known)
            goes_on.length += 1
            goes_on.turns += 1
        goes_on.last, goes_on.heard, goes_on.start = one.transfer_id, self._count, one.number
        self._speaks, self._at = goes_on, one.t
        if len(self._went_on) == _LATEST:
            self._continued -= self._went_on[0]
        self._went_on.append(known is not None)
        self._continued += known is not None
        return known is not None

    @property
    def likely(self) -> bool:
        """Return whether nearly every start went on with a counter that waited: else there are no `counters`."""
        return self._continued >= _NEARLY_ALL * len(self._went_on)

    def counters(self, least: int) -> list[Chain]:
        """Return the counters, the latest last, once two had so many transfers and all explain nearly every step."""
        if not self.likely:
            return []
        chains = [*self._waiting, *filter(None, (self._speaks,))]
        chains = [one for one in chains if not one.silent(self._count)]
        if sum(one.length >= least for one in chains) <= 1:
            return []
        self._in_time.extend(starmap(_is_loss, self._unjudged))
        self._unjudged.clear()
        if sum(self._in_time) >= _MOSTLY * len(self._went_on):
            return []
        return [one for one in chains if 2 * one.length >= least]


def _is_loss(silent: int, took: int, one: OddStart) -> bool:
    """Return whether one sender may have lost transfers.

    The IDs before, `silent` of them, came as fast as the lost ones.
    """
    gap = one.t - one.since
    if not one.step or one.t == NO_TIME or gap <= 0 or took <= 0:
        return False
    by_time = took * one.step / gap
    return any(ids and abs(by_time - ids) <= _TIMING * ids for ids in range(silent, 4 * TRANSFER_IDS, TRANSFER_IDS))


def onset(counters: Sequence[Chain]) -> int:
    """Return the time before the second counter began. One that never took over again was left behind by a loss."""
    alive = [one for one in counters if one.turns > 1]
    return sorted(alive if len(alive) > 1 else counters, key=lambda one: one.begun)[1].since


def named(counters: Sequence[Chain], type_: str) -> str:
    """Return what is said of several counters."""
    *places, last = (str(counter.last) for counter in counters)
    return f"{_NUMBERS[len(counters)]} transfer-ID counters in {type_}, at {', '.join(places)} and {last}"
