"""Tables that are made when somebody asks for them."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import pyarrow as pa


class LazyTables(Mapping[str, "pa.RecordBatch"]):
    """The message tables of a batch by name. Each has rows; it is made at the first look at it, and kept.

    Args:
        makers: by name, what makes the table; the same each time.
    """

    def __init__(self, makers: Mapping[str, Callable[[], pa.RecordBatch]]) -> None:
        self._makers = makers
        self._made: dict[str, pa.RecordBatch] = {}

    def __getitem__(self, name: str) -> pa.RecordBatch:
        """Return a table. Raises `KeyError`."""
        table = self._made.get(name)
        if table is None:
            table = self._made[name] = self._makers[name]()
        return table

    def __contains__(self, name: object) -> bool:
        """Say whether there is such a table, without making it."""
        return name in self._makers

    def __iter__(self) -> Iterator[str]:
        """Yield the names."""
        return iter(self._makers)

    def __len__(self) -> int:
        """Return the number of tables."""
        return len(self._makers)
