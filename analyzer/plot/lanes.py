"""States that change now and then: only the changes are shown, each with the name of the state."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Mapping

    from dissectors.kit import Array


class Lanes:
    """Remembers the last state of every lane."""

    def __init__(self) -> None:
        self._last: dict[str, int] = {}

    def changes(self, lane: str, codes: Array) -> Array:
        """Return the rows in which the state is another one than before; the first one is such a row."""
        if not len(codes):
            return np.zeros(0, np.int64)
        rows = np.flatnonzero(codes[1:] != codes[:-1]) + 1
        if self._last.get(lane) != int(codes[0]):
            rows = np.concatenate(([0], rows))
        self._last[lane] = int(codes[-1])
        return rows


def names(codes: Array, texts: Mapping[float, str], *, flag: bool) -> list[str]:
    """Return what the states are called."""
    if flag:
        return ["on" if code else "off" for code in codes.tolist()]
    return [texts.get(code) or f"{code} (undefined)" for code in codes.tolist()]
