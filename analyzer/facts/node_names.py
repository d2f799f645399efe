"""Names that nodes give themselves, from the answers that somebody got who asked them."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from analyzer.facts.node_status import NODE_INFO
from dissectors.kit.cells import pylist, text_of

if TYPE_CHECKING:
    from collections.abc import Mapping

    import pyarrow as pa

MOST_NODES = 4096
MOST_NAME = 80  # characters


class NodeNames:
    """Names by bus and node, the latest of each, of the first `MOST_NODES` nodes. Text from the bus, not escaped."""

    def __init__(self) -> None:
        self.all: dict[tuple[int, int], str] = {}

    def feed(self, tables: Mapping[str, pa.RecordBatch]) -> None:
        """Add the tables of a batch."""
        table = tables.get(NODE_INFO)
        if table is None or "name" not in table.schema.names or not table.num_rows:
            return
        columns = (pylist(table.column(name)) for name in ("bus", "src", "name", "trusted"))
        for bus, src, name, trusted in zip(*columns, strict=True):
            if trusted and ((bus, src) in self.all or len(self.all) < MOST_NODES):
                self.all[bus, src] = _text(name)


def _text(value: Any) -> str:
    if isinstance(value, list):
        value = bytes(value)
    if isinstance(value, bytes):
        value = text_of(value)
    return str(value or "")[:MOST_NAME]
