"""Numbers known of each key, in columns: a bus full of faults has very many sessions."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Mapping

    from dissectors.kit import Array


class KeyedRows:
    """Rows in the order of their keys, which are integers and stand there once each.

    Args:
        columns: what each column holds of a key of which nothing else is known.
        most: further keys are left out.
    """

    def __init__(self, columns: Mapping[str, int], most: int) -> None:
        self.keys: Array = np.empty(0, np.int64)
        self._defaults = columns
        self._columns: dict[str, Array] = {name: np.empty(0, np.int64) for name in columns}
        self._most = most

    def __len__(self) -> int:
        """Return how many keys there are."""
        return len(self.keys)

    @property
    def room(self) -> int:
        """How many more keys there may be."""
        return max(self._most - len(self.keys), 0)

    def find(self, keys: Array) -> Array:
        """Return the row of each key, -1 for those that are not known."""
        if not len(self.keys):
            return np.full(len(keys), -1)
        rows = np.minimum(np.searchsorted(self.keys, keys), len(self.keys) - 1)
        found: Array = np.where(self.keys[rows] == keys, rows, -1)
        return found

    def has(self, keys: Array) -> Array:
        """Return a mask of the keys that are known."""
        found: Array = self.find(keys) >= 0
        return found

    def get(self, name: str, rows: Array) -> Array:
        """Return the cells of a column at rows as `find` gives them."""
        found = np.full(len(rows), self._defaults[name])
        known = rows >= 0
        found[known] = self._columns[name][rows[known]]
        return found

    def cells(self, rows: Array) -> list[Array]:
        """Return the cells of all columns, in their order, at rows of keys that are known."""
        return [column[rows] for column in self._columns.values()]

    def look_up(self, name: str, keys: Array) -> Array:
        """Return the cells of a column of some keys."""
        return self.get(name, self.find(keys))

    def put(self, rows: Array, **cells: Array) -> None:
        """Set cells at rows of keys that are known."""
        for name, values in cells.items():
            self._columns[name][rows] = values

    def add(self, keys: Array, **cells: Array) -> int:
        """Add keys that are new, the first of them while there is room, with what comes first of each.

        Return how many there were.
        """
        new = np.flatnonzero(~self.has(keys))
        if not len(new) or not self.room:
            return 0
        first = np.sort(np.unique(keys[new], return_index=True)[1])
        new = new[first[: self.room]]
        new = new[np.argsort(keys[new], kind="stable")]
        at = np.searchsorted(self.keys, keys[new])
        self.keys = np.insert(self.keys, at, keys[new])
        for name, known in self._columns.items():
            given = cells[name][new] if name in cells else self._defaults[name]
            self._columns[name] = np.insert(known, at, given)
        return len(new)
