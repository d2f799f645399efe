"""One counter that goes on although transfers with other IDs come in between: those are another sender's."""

from __future__ import annotations

from collections import Counter, deque
from typing import TYPE_CHECKING, NamedTuple

from analyzer.rules.counters.id_patterns import MOST_MOVED
from analyzer.tables import TRANSFER_IDS
from dissectors.kit import NO_TIME, SECOND

if TYPE_CHECKING:
    from analyzer.rules.counters.session_starts import OddStart

_LATEST = 64  # interruptions that are judged
_COUNTS = 2  # IDs in a row that make an interruption the counter: what is between was lost
_OTHERS = 4  # IDs that an interruption may have on average; by chance 32 bring the next one
_BROKEN = 1 / 4  # of the interruptions, at most, may the counter not survive
_BEFORE = SECOND  # in which the other one may have been taken for it
_MOSTLY = 3 / 4  # of the other IDs that are the same


class _Interruption(NamedTuple):
    """The time before it, how many IDs it had, and whether the counter went on behind it."""

    since: int
    ids: int
    survived: bool


class ResumedCounter:
    """Tells whether a counter goes on by 1 behind each interruption; it is told only of starts whose step is not 1.

    A sender that loses transfers, begins anew or changes their order does not come back to where it was. The other one
    may send one ID again and again, or any. An ID that was there shortly before may be a late copy, and proves nothing.
    """

    def __init__(self, first: int) -> None:
        self.last = first  # the counter's ID
        self.number = -1  # where it last went on
        self._other: int | None = None  # the ID that interrupts it now
        self._since, self._count, self._copy = NO_TIME, 0, True  # of this interruption
        self._past: deque[_Interruption] = deque(maxlen=_LATEST)
        self._survived = 0  # of these
        self._ids: deque[int] = deque(maxlen=_LATEST)  # of the other one

    @property
    def since(self) -> int:
        """A time before the first interruption."""
        return next((one.since - _BEFORE for one in self._past if one.survived and one.since != NO_TIME), NO_TIME)

    def add(self, one: OddStart) -> bool:
        """Add a start; return whether the counter goes on behind an interruption with it."""
        if self._other is None:
            self.last = one.before
        elif (one.before - self._other) % TRANSFER_IDS >= _COUNTS:
            self._end(survived=False)
            self.last = one.before
        if self._other is not None and one.transfer_id == (self.last + 1) % TRANSFER_IDS:
            self.last, self.number = one.transfer_id, one.number
            proves = not self._copy
            self._end(survived=True)
            return proves
        if not one.again:
            self._interrupt(one)
        return False

    def likely(self, least: int) -> bool:
        """Return whether the counter went on so often, and seldom did not: else there is no `other`."""
        survived = self._survived
        return survived >= least and len(self._past) - survived <= _BROKEN * survived

    def other(self, least: int) -> str | None:
        """Return what the other IDs are, once the counter went on so often; None if it does not."""
        if not self.likely(least):
            return None
        survived = [one.ids for one in self._past if one.survived]
        if sum(survived) > _OTHERS * len(survived):
            return None
        usual, times = Counter(self._ids).most_common(1)[0] if self._ids else (0, 0)
        return f"always {usual}" if times > _MOSTLY * len(self._ids) else "no order"

    def _end(self, *, survived: bool) -> None:
        if not survived or not self._copy:
            if len(self._past) == _LATEST:
                self._survived -= self._past[0].survived
            self._past.append(_Interruption(self._since, self._count, survived))
            self._survived += survived
        if not survived:
            self._ids.clear()
        self._other = None

    def _interrupt(self, one: OddStart) -> None:
        if self._other is None:
            self._since, self._count, self._copy = one.since, 0, True
        self._count += one.transfer_id != self._other
        self._other = one.transfer_id
        if (self.last - one.transfer_id) % TRANSFER_IDS > MOST_MOVED:
            self._copy = False
            self._ids.append(one.transfer_id)
