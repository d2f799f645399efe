"""Columns of tables without a capture, and the part of them that somebody asks for."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import dissectors
from analyzer import tables
from analyzer.decode.by_name import example, find_table

if TYPE_CHECKING:
    from collections.abc import Collection, Sequence
    from pathlib import Path

    import pyarrow as pa

    from analyzer.decode.engine import Batch
    from dissectors import Registry

_KNOWN = {
    "frames": tables.FRAMES,
    "transfers": tables.TRANSFERS,
    "events": tables.EVENT_ROWS,
    "findings": tables.FINDINGS,
    "esc": tables.ESC,
}


def schema(table: str, dissectors_: Sequence[Path] = ()) -> pa.Schema:
    """Return the columns that a table has in every capture, by any name that `Capture.table` takes.

    Args:
        table: `frames`, `transfers`, `events`, `findings`, `esc`, a message type or a packet (`PUSHCAN.MotorStatus`).
        dissectors_: folders with further data types.

    Raises `LookupError`, with near names, for a name that no type has.
    """
    return _schema(dissectors.load(dissectors_), table)


def _schema(registry: Registry, table: str) -> pa.Schema:
    if table in _KNOWN:
        return _KNOWN[table]
    message, wanted = find_table(registry, table)
    return example(registry, message)[wanted].schema


class ChosenTables:
    """The `tables` of messages and packets that somebody asks for, and the columns of these; None is all.

    Raises `LookupError` for a table that no type has, or a column that none of the tables has.
    """

    def __init__(self, registry: Registry, tables_: Collection[str] | None, columns: Collection[str] | None) -> None:
        self._columns = None if columns is None else frozenset(columns)
        self.tables = None if tables_ is None else [find_table(registry, one)[1] for one in tables_]
        if columns is not None and tables_ is not None:
            there = {name for one in tables_ for name in _schema(registry, one).names}
            if missing := sorted(set(columns) - there):
                raise LookupError(
                    f"no column {missing[0]!r} in {', '.join(tables_)} (one of: {', '.join(sorted(there))})"
                )

    def of(self, batch: Batch) -> Batch:
        """Return a batch whose `messages` are these; no other table is made."""
        if self.tables is None and self._columns is None:
            return batch
        names = batch.messages if self.tables is None else (name for name in self.tables if name in batch.messages)
        return replace(batch, messages={name: self.cut(batch.messages[name]) for name in names})

    def cut(self, rows: pa.RecordBatch) -> pa.RecordBatch:
        """Return the rows with these columns, in their own order."""
        if self._columns is None:
            return rows
        return rows.select([name for name in rows.schema.names if name in self._columns])
