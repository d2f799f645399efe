"""Listed rows in the order of a field: found by a thread, of as many rows as memory is to be spent on."""

from __future__ import annotations

import threading
from typing import TYPE_CHECKING

import numpy as np

from analyzer.browser.store.order import TRANSFER, split
from analyzer.browser.store.segment import OpenSegment
from analyzer.filter.compiled import compile_expression

if TYPE_CHECKING:
    from analyzer.browser.chosen import OrderedRows
    from analyzer.browser.store.store import TableStore
    from dissectors import Registry
    from dissectors.kit import Array

MOST_SORTED = 2_000_000  # rows: some 50 MB while it is sorted


class SortedRows:
    """The rows of another set, as they are when it begins; in their own order until `done`.

    Rows without the field stand last, in the order of the capture, as those of one value do. Raises `FilterError` for
    what is no number.

    Args:
        store: what is there.
        base: the rows.
        registry: the types.
        name: of the field.
        falling: the highest value first.
    """

    def __init__(self, store: TableStore, base: OrderedRows, registry: Registry, name: str, *, falling: bool) -> None:
        self.base, self.name, self.falling = base, name, falling
        self._store, self._value = store, compile_expression(name, registry)
        self._count = len(base)
        self._order: Array | None = None
        self._places = np.zeros(0, np.int32)
        self._stop = threading.Event()
        self.done = False
        self.problem: Exception | None = None

    def start(self) -> None:
        """Begin to sort."""
        threading.Thread(target=self._work, name="sort", daemon=True).start()

    def stop(self) -> None:
        """Sort no further."""
        self._stop.set()

    def _work(self) -> None:
        try:
            values = self._values()
            if not self._stop.is_set():
                order = np.argsort(-values if self.falling else values, kind="stable").astype(np.int32)
                self._places = np.empty_like(order)
                self._places[order] = np.arange(len(order), dtype=np.int32)
                self._order = order
        except Exception as error:  # noqa: BLE001 - the list has to say it
            self.problem = error
        self.done = True

    def _values(self) -> Array:
        """Return the value of each row; not a number for none, which is sorted behind all."""
        found, at = np.full(self._count, np.nan), 0
        for segment, one in enumerate(self._store.segments[:]):
            if at >= self._count or self._stop.is_set():
                break
            opened = OpenSegment(one)
            read = self._value.feed(opened.batch)
            inside = self.base.inside(segment)[: self._count - at]
            kinds, entries = split(opened.column("rows", "key")[inside])
            transfers = np.flatnonzero(kinds == TRANSFER)
            own = entries[transfers]
            known = read.valid[own]
            found[at + transfers[known]] = read.values[own[known]]
            at += len(inside)
        return found

    def __len__(self) -> int:
        """Count them."""
        return self._count

    def at(self, number: int) -> tuple[int, int]:
        """Return segment and place in it of a row."""
        return self.base.at(number if self._order is None else int(self._order[number]))

    def find(self, segment: int, local: int) -> int:
        """Return the number of a row; that of the next one in the capture if it is not among these."""
        number = min(self.base.find(segment, local), self._count - 1)
        return number if self._order is None else int(self._places[number])

    def inside(self, segment: int) -> Array:
        """Return the places of rows in the list of a segment, ascending."""
        return self.base.inside(segment)
