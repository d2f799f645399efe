"""Lists of many rows in columns: list `k` is `cells[offsets[k]:offsets[k + 1]]`."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple, Self

import numpy as np

if TYPE_CHECKING:
    from dissectors.kit import Array


class Lists(NamedTuple):
    """Lists of cells in columns: list `k` is `cells[offsets[k]:offsets[k + 1]]`."""

    offsets: Array
    cells: Array

    @classmethod
    def none(cls, kind: type) -> Self:
        """Return no list."""
        return cls(np.zeros(1, np.int64), np.empty(0, kind))

    def take(self, rows: Array) -> Self:
        """Return some of them."""
        offsets, places = picked(self.offsets, rows)
        return type(self)(offsets, self.cells[places])

    def joined(self, more: Lists) -> Self:
        """Return these and others behind them."""
        offsets = np.concatenate((self.offsets, more.offsets[1:] + self.offsets[-1]))
        return type(self)(offsets, np.concatenate((self.cells, more.cells)))

    def one(self, k: int) -> list[int]:
        """Return one of them."""
        found: list[int] = self.cells[self.offsets.item(k) : self.offsets.item(k + 1)].tolist()
        return found


def picked(offsets: Array, rows: Array) -> tuple[Array, Array]:
    """Return the offsets of some lists put one behind the other, and the places of their cells."""
    return placed(offsets[rows], offsets[rows + 1] - offsets[rows])


def placed(begin: Array, sizes: Array) -> tuple[Array, Array]:
    """Return the same of lists that begin at these places and have these sizes."""
    ends = np.zeros(len(sizes) + 1, np.int64)
    sizes.cumsum(out=ends[1:])
    places: Array = (begin - ends[:-1]).repeat(sizes)
    places += np.arange(len(places))
    return ends, places
