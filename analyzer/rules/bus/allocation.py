"""Dynamic node IDs, as allocators gave them."""

from __future__ import annotations

from typing import TYPE_CHECKING, ClassVar

from dissectors.kit import Occurrence, Rule

if TYPE_CHECKING:
    from collections.abc import Iterator

    from dissectors.kit import View

ALLOCATION = "uavcan.protocol.dynamic_node_id.Allocation"
_ID_BYTES = 16  # of a whole unique ID
MOST = 4096  # unique IDs, or time masters


class Allocations(Rule):
    """The table of unique IDs and node IDs, as allocators gave them; the first `MOST`."""

    rules: ClassVar[tuple[str, ...]] = ("BUS-030",)

    def __init__(self) -> None:
        self._nodes: dict[tuple[int, bytes], int] = {}
        self._owners: dict[tuple[int, int], bytes] = {}
        self._asked: dict[tuple[int, bytes], Occurrence] = {}

    def feed(self, view: View) -> Iterator[Occurrence]:
        """Yield node IDs that were given."""
        table = view.table(ALLOCATION)
        if table is None:
            return
        begins, every = table.lists("unique_id")
        given = (table.src != 0) & (begins[1:] - begins[:-1] == _ID_BYTES)
        for row in (table.trusted & (given | (table.src == 0))).nonzero()[0].tolist():
            unique = every[begins.item(row) : begins.item(row + 1)].tobytes()
            bus, src, node = int(table.bus[row]), int(table.src[row]), int(table["node_id"][row])
            about = (int(table.t[row]), bus, src or None, ALLOCATION, tuple(view.transfers.frames(int(table.row[row]))))
            if src and node:
                state = self._give(bus, unique, node)
                values = {"unique_id": unique.hex().upper(), "given_node": node, "state": state or "given"}
                yield Occurrence("BUS-030", *about, values, severity="error" if state else None)
            elif not src and table["first_part_of_unique_id"][row] and len(self._asked) < MOST:
                values = {"unique_id": unique.hex().upper() + "..", "given_node": "none", "state": "asked in vain"}
                lines = view.lines(about[-1])
                self._asked.setdefault((bus, unique), Occurrence("BUS-030", *about, values, lines=lines))

    def finish(self, _view: View) -> Iterator[Occurrence]:
        """Yield nodes that asked and were given none."""
        for (bus, part), asked in self._asked.items():
            if not any(at == bus and unique.startswith(part) for at, unique in self._nodes):
                yield asked

    def _give(self, bus: int, unique: bytes, node: int) -> str:
        """Note who has which ID; what contradicts it, if anything does."""
        had, owner = self._nodes.get((bus, unique), node), self._owners.get((bus, node), unique)
        if len(self._nodes) < MOST:
            self._nodes[bus, unique] = node
            self._owners[bus, node] = unique
        if had != node:
            return f"but had node {had} before"
        return "" if owner == unique else f"as has {owner.hex().upper()}"
