"""Reports at a steady pace, and where they break."""

from __future__ import annotations

from typing import TYPE_CHECKING, Protocol

from dissectors.records import dataclass
from dissectors.times import SECOND

if TYPE_CHECKING:
    from collections.abc import Sequence

    from dissectors.kit.array import Array

ALIKE = 2.5  # times that another pace may be off
SLOWEST = 5 * SECOND // 2  # a longer time is no pace before it is seen twice
# By then a node has said that it restarted, and transfers without an end are given up.
_LATER = 5 * SECOND // 2


@dataclass(slots=True, eq=False)
class Break:
    """A time without reports, from `start` to `stop`, of a sender that had a period.

    `at` is the report before it among those that were fed last, -1 for one before them. `kept` says that the IDs went
    on as if nothing was lost, `lowered` that the sender only reports less often from then on; None: not known yet.
    """

    start: int
    stop: int
    period: float
    at: int
    kept: bool = False
    lowered: bool | None = None

    def settled(self, now: int) -> bool:
        """Return whether it is known at a time what it is."""
        return self.lowered is not None or not self.kept or now - self.stop > ALIKE * (self.stop - self.start)

    @property
    def told(self) -> int:
        """The time by which whatever explains it has been sent."""
        return self.stop + _LATER

    def due(self, now: int | None) -> bool:
        """Return whether it can be judged at a time: all is known that may explain it, or nothing follows (None)."""
        return now is None or (now > self.told and self.settled(now))

    def may_be_slower(self, now: int) -> bool:
        """Return whether a sender that only reports less often would have shown no more by then."""
        return bool(self.lowered) or (not self.settled(now) and self.stop - self.start <= SLOWEST)


class PacedReports(Protocol):
    """The reports of many senders, numbered from 0: one is known once reports of it are fed.

    Several that come close together, such as those of a sender with several indexes, are one round, and a period is
    that of rounds. Reports that were lost may be why it is not steady. Behind a break a sender begins anew.
    """

    @property
    def last(self) -> Array:
        """The time of the last report of each, in ns."""

    def feed(self, senders: Array, size: Array, t: Array, lost: Array) -> Sequence[tuple[int, Break]]:
        """Add reports of some senders, all with a time, one sender after the other; return the breaks between them.

        Each comes with the place of its sender among these, in order.

        Args:
            senders: each stands there once.
            size: how many reports of each there are, at least one.
            t: when they came.
            lost: how many were lost up to each.
        """

    def silences(self, until: Array) -> Sequence[tuple[int, Break]]:
        """Return the breaks that last until now, each with its sender; `until` is that time for each of all."""
