"""The starts of transfers in a session whose counter broke, in the order in which they came, finished or not.

Transfers are told in the order of their ends, and what never ends is told late; only the starts say who counted how.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

from analyzer import _native
from analyzer.tables import TRANSFER_IDS
from dissectors.kit import SESSION

if TYPE_CHECKING:
    from collections.abc import Iterator

    from dissectors.kit import View

_NEVER = 1 << 62


class OddStart(NamedTuple):
    """A start whose transfer ID is not that of the one before it plus 1; `since` is the time of that one.

    `again` says that it may only begin that one again, which did not end.
    """

    number: int
    t: int
    before: int
    transfer_id: int
    since: int
    again: bool = False

    @property
    def step(self) -> int:
        """Return how far it counted, 0 to 31."""
        return (self.transfer_id - self.before) % TRANSFER_IDS


class SessionStarts:
    """Follows one session.

    Args:
        session: bus above 32 bits of the identifier.
        start: the start behind which it begins.
        data: its frame.
    """

    def __init__(self, session: int, start: OddStart, data: bytes) -> None:
        bus, bits = session >> 32, session & SESSION
        self._starts = _native.SessionStarts(bus, bits, start.number, start.transfer_id, start.t, data)

    def until(self, number: int, view: View) -> Iterator[OddStart]:
        """Yield the odd starts that were not told yet, up to a frame; one that is the last one again is none."""
        starts = self._starts
        if number >= starts.unread:
            for index in view.indexes(starts.unread, _NEVER):
                starts.read(index)
        while (one := starts.next(number)) is not None:
            yield OddStart._make(one)
