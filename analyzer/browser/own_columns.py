"""Columns of one's own in the packet list: fields by their names."""

from __future__ import annotations

from typing import TYPE_CHECKING

from analyzer.browser.store.cut import StoredFrames, cut_transfers
from analyzer.browser.store.order import TRANSFER
from analyzer.views.fields import Fields
from analyzer.views.terminal import escape, fit

if TYPE_CHECKING:
    from collections.abc import Sequence

    from analyzer.browser.store.store import ListRow, TableStore
    from dissectors import Registry

_WIDTH = 14


class OwnColumns:
    """Writes the cells of fields. Raises `LookupError` for one that does not exist."""

    def __init__(self, store: TableStore, registry: Registry, names: Sequence[str]) -> None:
        self.names = tuple(names)
        self._store = store
        self._fields = Fields(registry, list(names), StoredFrames(store), store.zero)
        self.width = (_WIDTH + 1) * len(names)

    def heads(self) -> str:
        """Return the names, as far as they fit: what stands behind the type tells more."""
        return self._line([name.rpartition(".")[2] for name in self.names])

    def cells(self, rows: Sequence[ListRow]) -> list[str]:
        """Return the cells of each row in one text; empty ones for rows that are no transfers."""
        first = self._store.segments
        at = {first[row.segment].first_transfer + row.entry: k for k, row in enumerate(rows) if row.kind == TRANSFER}
        found = [self._line([""] * len(self.names))] * len(rows)
        if at:
            batch = cut_transfers(self._store, sorted(at))
            self._fields.begin()
            for number, text in zip(sorted(at), self._fields.rows(batch), strict=True):
                found[at[number]] = self._line(text.rstrip("\n").split("\t"))
        return found

    def _line(self, cells: Sequence[str]) -> str:
        return "".join(f"{fit(escape(cell), _WIDTH):<{_WIDTH}} " for cell in cells)
