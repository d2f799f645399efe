"""The frames of a batch by session, for those who ask for many."""

from __future__ import annotations

from typing import TYPE_CHECKING, Self

import numpy as np

from dissectors.kit import SESSION

if TYPE_CHECKING:
    from collections.abc import Iterator

    from dissectors.kit import Array, FrameTable

_WIDTH = SESSION.bit_length()


class SessionIndex:
    """Finds the rows of a bus and session without a look at any other."""

    def __init__(self, frames: FrameTable) -> None:
        key = frames.bus.astype(np.int64) << _WIDTH | (frames.id & SESSION)
        self._order = np.argsort(key, kind="stable")
        ranked = key[self._order]
        self._begins = np.append(np.flatnonzero(np.diff(ranked, prepend=-1)), len(ranked))
        self._keys = ranked[self._begins[:-1]]

    def __deepcopy__(self, _memo: object) -> Self:
        """Share it: it never changes."""
        return self

    def rows(self, low: int, high: int, bus: int, session: int) -> Array:
        """Return the rows of a session from one to before another one."""
        first, last = self._place(bus, session)
        rows = self._order[first:last]
        found: Array = rows[rows.searchsorted(low) : rows.searchsorted(high)]
        return found

    def before(self, low: int, high: int, bus: int, session: int) -> Iterator[int]:
        """Yield the same from the last one on."""
        first, last = self._place(bus, session)
        at = first + int(self._order[first:last].searchsorted(high))
        while at > first:
            at -= 1
            row = self._order.item(at)
            if row < low:
                break
            yield row

    def _place(self, bus: int, session: int) -> tuple[int, int]:
        """Return where the rows of a session begin and end."""
        key = bus << _WIDTH | session
        at = int(self._keys.searchsorted(key))
        if at == len(self._keys) or self._keys.item(at) != key:
            return 0, 0
        return self._begins.item(at), self._begins.item(at + 1)
