"""Versions that nodes report of themselves."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import pyarrow as pa

from analyzer.facts.node_names import MOST_NODES
from dissectors.kit.cells import pylist

if TYPE_CHECKING:
    from collections.abc import Mapping

MOST_VERSION = 32  # characters
_TEXT, _NUMBERS = "software_version.text", "software_version"


class Software:
    """Versions by bus and node of the first `MOST_NODES` nodes; a text says more than major and minor. Not escaped."""

    def __init__(self) -> None:
        self.all: dict[tuple[int, int], str] = {}
        self._texts: set[tuple[int, int]] = set()
        self._without: set[str] = set()  # tables that tell none: nobody needs them made

    def feed(self, tables: Mapping[str, pa.RecordBatch]) -> None:
        """Add the tables of a batch; the latest version of its kind counts."""
        for name in [name for name in tables if name not in self._without]:
            table = tables[name]
            column = version_column(table)
            if column is None:
                self._without.add(name)
                continue
            columns = [pylist(table.column(name)) for name in ("bus", "src", "trusted", column)]
            for bus, src, trusted, value in zip(*columns, strict=True):
                text = version(value)
                if trusted and text:
                    self._note((bus, src), text, is_text=not isinstance(value, dict))

    def _note(self, node: tuple[int, int], text: str, *, is_text: bool) -> None:
        if node in self.all:
            if node in self._texts and not is_text:
                return
        elif len(self.all) >= MOST_NODES:
            return
        self.all[node] = text
        if is_text:
            self._texts.add(node)


def version_column(table: pa.RecordBatch) -> str | None:
    """Return the column of a table that tells a version, None if there is none."""
    column = next((name for name in (_TEXT, _NUMBERS) if name in table.schema.names), None)
    return None if column is None or pa.types.is_list(table.schema.field(column).type) else column


def version(value: Any) -> str:
    """Return a version in words, empty for none."""
    if isinstance(value, dict):
        parts = [value.get("major"), value.get("minor")]
        return ".".join(map(str, parts)) if None not in parts else ""
    return str(value or "")[:MOST_VERSION]
