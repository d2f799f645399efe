"""States of devices: the named value that holds now, and flags with the times at which they were set."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from analyzer.board.groups import NONE
from analyzer.board.snapshot import Latched

if TYPE_CHECKING:
    from collections.abc import Iterator

    from analyzer.board.groups import Groups
    from dissectors.kit import Array
    from dissectors.schema import Note


class StateWord:
    """One column of states, by the place of a device.

    Args:
        name: of the column; a state without parts is called so.
        note: what its values mean; None for a flag by itself.
        most: places, and one for all that found none.
    """

    def __init__(self, name: str, note: Note | None, most: int) -> None:
        self.column = name
        parts = () if note is None else note.parts
        self._flags = [(1 << part.low, _plain(part.name)) for part in parts if part.flag]
        self._enums = [(part.low, (1 << part.width) - 1, part.enum) for part in parts if part.enum]
        if note is None:
            self._flags = [(1, _plain(name))]
        elif not parts and note.enum:
            self._enums = [(0, (1 << 62) - 1, note.enum)]
        self._mask = sum(bit for bit, _ in self._flags)
        self._most = most
        self._last, self._t = (np.full(most + 1, NONE, np.int64) for _ in range(2))
        self._set: dict[tuple[int, int], list[int]] = {}  # by place and bit: first, last, times that it was set

    def feed(self, groups: Groups, places: Array, codes: Array, t: Array) -> None:
        """Take the next rows of devices."""
        last, heard = self._last[places], self._t[places]
        self._last[places] = groups.last(codes)
        self._t[places] = groups.last(t)
        flags = codes & self._mask
        before = groups.previous(flags, np.where(last == NONE, 0, last & self._mask))
        rows = np.flatnonzero(flags != before)
        if not len(rows):
            return
        until, of = groups.previous(t, heard), groups.spread(places)
        for row in rows.tolist():
            place, now, was = int(of[row]), int(flags[row]), int(before[row])
            if place == self._most:
                continue
            for bit, _ in self._flags:
                if now & ~was & bit:
                    entry = self._set.setdefault((place, bit), [int(t[row]), 0, 0])
                    entry[1:] = int(t[row]), entry[2] + 1
                elif was & ~now & bit:
                    self._set.setdefault((place, bit), [int(until[row]), 0, 0])[1] = int(until[row])

    def states(self, place: int) -> Iterator[str]:
        """Give the names of the values that hold now."""
        code = int(self._last[place])
        if code != NONE:
            for low, mask, texts in self._enums:
                value = code >> low & mask
                yield texts.get(value) or f"{value} (undefined)"

    def flags(self, place: int) -> Iterator[str]:
        """Give the flags that are set now."""
        code = int(self._last[place])
        if code != NONE and code & self._mask:
            yield from (name for bit, name in self._flags if code & bit)

    def latched(self, place: int, subject: str) -> Iterator[Latched]:
        """Give the flags that were set since the mark."""
        for bit, name in self._flags:
            if (entry := self._set.get((place, bit))) is not None:
                first, last, count = entry
                now = bool(self._last[place] & bit)
                yield Latched("flag", subject, name, first, int(self._t[place]) if now else last, count, now)

    def mark(self) -> None:
        """Begin anew: only flags that are still set have been set."""
        still = {
            (place, bit): [int(self._t[place]), int(self._t[place]), 1]
            for place, bit in self._set
            if self._last[place] & bit
        }
        self._set = still


def _plain(name: str) -> str:
    return name.rpartition(".")[2].replace("_", " ")
