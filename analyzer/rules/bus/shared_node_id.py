"""Two devices behind one node ID, by their unique IDs."""

from __future__ import annotations

from typing import TYPE_CHECKING, ClassVar

from analyzer.facts.node_status import NODE_INFO
from analyzer.tables import distinct
from dissectors.kit import NO_TIME, SECOND, Occurrence, Rule

if TYPE_CHECKING:
    from collections.abc import Iterator

    from dissectors.kit import View

_Node = tuple[int, int]


class UniqueIds(Rule):
    """Two devices by their unique IDs: the second has run since before the first one answered."""

    rules: ClassVar[tuple[str, ...]] = ("BUS-010",)

    def __init__(self) -> None:
        self._known: dict[_Node, tuple[int, bytes]] = {}

    def feed(self, view: View) -> Iterator[Occurrence]:
        """Look at every answer to GetNodeInfo."""
        table = view.table(NODE_INFO)
        if table is None or not table.good:
            return
        rows, values = table.inner("hardware_version", "unique_id")  # some answers end before it
        for row in distinct(rows[table.trusted[rows]]):
            node, t = (int(table.bus[row]), int(table.src[row])), int(table.t[row])
            begin, end = rows.searchsorted(row), rows.searchsorted(row, "right")
            unique = values[begin:end].tobytes()
            at, before = self._known.get(node, (t, unique))
            self._known[node] = t, unique
            elapsed = 0.0 if NO_TIME in (t, at) else (t - at) / SECOND
            if unique != before and table.cell("status", row)["uptime_sec"] + 1 > elapsed:
                evidence = f"two unique IDs, {before.hex().upper()} and {unique.hex().upper()}"
                frames = tuple(view.transfers.frames(int(table.row[row])))
                yield Occurrence("BUS-010", t, *node, "", frames, {"evidence": evidence})
