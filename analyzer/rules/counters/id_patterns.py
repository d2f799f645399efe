"""Explanations for the steps of a transfer-ID counter.

One counter for several types, one that wraps early, or transfers in another order.
"""

from __future__ import annotations

from collections import deque
from typing import TYPE_CHECKING

from analyzer.tables import TRANSFER_IDS
from dissectors.kit import NO_TIME, SECOND
from dissectors.records import dataclass, field

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from analyzer.rules.counters.id_steps import IdStep

MOST_MOVED = 8  # transfers that changed places with each other
_STEPS = 3  # that a swap has
WRAPS = 3  # from the same ID that are no restarts
_MOST_SESSIONS = 256  # of a node
_MOST_STATUS = 64
_SOON = 2 * SECOND  # what is told later may have another cause, or follow what is forgotten
_ROUGHLY = 3 * SECOND // 2  # of an uptime: whole seconds, and jitter
RUN, EACH = 20, 3  # messages that count together without a break, and of each type that is judged
MOST_SHOWN = 8  # messages of a shared counter that are evidence


class EarlyWraps:
    """Tells a node's counters that always wrap early from restarts.

    In a restart the uptime falls too, and the ID before 0 is a different one each time.
    """

    def __init__(self) -> None:
        self._alike: dict[int, list[IdStep]] = {}
        self._uptime = 0
        self._fell = NO_TIME  # when the uptime last did, or was 0

    def status(self, t: Sequence[int], uptimes: Sequence[int]) -> None:
        """Add what the node's next NodeStatus say."""
        for at, uptime in zip(t, uptimes, strict=True):
            if not uptime or uptime < self._uptime:
                self._fell = at
            self._uptime = uptime

    def __bool__(self) -> bool:
        """Return whether some session fell to 0."""
        return bool(self._alike)

    def end(self, places: Iterable[int]) -> None:
        """Add other odd steps of some sessions."""
        for place in places:
            self._alike.pop(place, None)

    def add(self, one: IdStep, *, to_zero: bool) -> bool:
        """Return whether the odd steps of a session are, one after the other, falls to 0 from the same ID."""
        alike = self._alike.get(one.place, [])
        if not to_zero or (alike and alike[-1].before != one.before):
            self._alike.pop(one.place, None)
            alike = []
        if not to_zero or (one.place not in self._alike and len(self._alike) >= _MOST_SESSIONS):
            return False
        self._alike[one.place] = alike = [*alike, one][-WRAPS:]
        return len(alike) == WRAPS and (self._fell == NO_TIME or self._fell < alike[0].since)


class UptimeWitness:
    """Uptimes in a node's NodeStatus, which witness a restart. The last 64 are kept, and the one before them."""

    def __init__(self) -> None:
        self._known: deque[tuple[int, int, int]] = deque(maxlen=_MOST_STATUS)
        self._older: tuple[int, int] | None = None  # time and uptime

    def add(self, t: Sequence[int], uptimes: Sequence[int], transfer_ids: Sequence[int]) -> None:
        """Add the next ones."""
        new = [one for one in zip(t, uptimes, transfer_ids, strict=True) if one[0] != NO_TIME]
        last = len(self._known) + len(new) - _MOST_STATUS - 1  # that is not kept
        if last >= 0:
            self._older = (self._known[last] if last < len(self._known) else new[last - len(self._known)])[:2]
        self._known.extend(new)

    def began(self, since: int, until: int) -> bool | None:
        """Return whether the node began anew between two times: None if its counter may have, and its uptime not."""
        before = None
        if self._older is not None:
            if self._older[0] > since:  # nothing of that time is known any more
                return None
            before = self._older[1]
        for t, uptime, transfer_id in self._known:
            if t <= since:
                before = uptime
            elif t > until + _SOON:
                return None
            elif (t - uptime * SECOND >= since - _ROUGHLY) if before is None else (not uptime or uptime < before):
                return True
            elif not transfer_id:
                return None
            elif t > until:
                return False
        return None


@dataclass(slots=True)
class SharedCounter:
    """Messages of a node whose IDs rise by 1 over all types, from a breach at `t` on; it ends where they do not."""

    t: int
    last: int | None = None
    run: int = 0
    types: dict[int, list[int]] = field(default_factory=dict)
    frames: list[int] = field(default_factory=list)

    def fits(self, code: int, transfer_id: int, step: int, frames: Sequence[int] | None) -> bool:
        """Add the node's next message; return False if it does not count on. `step` is that of its own session."""
        if self.last is not None and (self.last + 1) % TRANSFER_IDS != transfer_id:
            return False
        seen = self.types.setdefault(code, [0, 0])
        seen[0] += 1
        # A type may jump by exactly 32, which reads as a repetition; the first step belongs to what was before.
        seen[1] += step != 1 and self.last is not None
        self.last = transfer_id
        self.run += 1
        self.frames += frames or ()
        return True

    def wants_frames(self) -> bool:
        """Return whether more evidence is welcome."""
        return self.run < MOST_SHOWN

    def proven(self) -> bool:
        """Return whether several types count together, and none of those sent often counts alone."""
        often = [jumps for sent, jumps in self.types.values() if sent >= EACH]
        return self.run >= RUN and len(often) > 1 and all(often)


def changed_places(steps: Sequence[tuple[int, int]]) -> bool:
    """Return whether three steps of a session, the next ones that are not 1 each, only swap two neighbouring groups.

    A step is the ID before and its own. Of 5, 7, 6, 8 they are (5, 7), (7, 6), (6, 8): nothing is missing.
    """
    if len(steps) != _STEPS:
        return False
    (before, second), (last, first), (end, after) = steps
    moved = (last - before) % TRANSFER_IDS
    expected = (before + 1) % TRANSFER_IDS, (second - 1) % TRANSFER_IDS, (last + 1) % TRANSFER_IDS
    return 1 < moved <= MOST_MOVED and (first, end, after) == expected
