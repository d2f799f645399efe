"""What nodes say of themselves: health and mode, time masters, dynamic node IDs."""

from __future__ import annotations

from typing import TYPE_CHECKING, ClassVar

import numpy as np

from dissectors.conformance import NO_TIME, SECOND, Occurrence, Watcher, watches

if TYPE_CHECKING:
    from collections.abc import Iterator

    from dissectors.conformance import Found, Values, View

STATUS = "uavcan.protocol.NodeStatus"
ALLOCATION = "uavcan.protocol.dynamic_node_id.Allocation"
TIME_SYNC = "uavcan.protocol.GlobalTimeSync"
HEALTHS = ("ok", "warning", "error", "critical")
MODES = {0: "operational", 1: "initialization", 2: "maintenance", 3: "software update", 7: "offline"}
_OPERATIONAL, _INITIALIZATION = 0, 1
_ID_BYTES = 16  # of a whole unique ID
MOST = 4096  # unique IDs, or time masters


@watches("BUS-022")
def health(view: View) -> Iterator[Found | Occurrence]:
    """Nodes that call themselves unhealthy or not operational."""
    table = view.table(STATUS)
    if table is None:
        return
    codes, modes = table["health"], table["mode"]
    bad = table.trusted & ((codes > 0) | (np.isin(modes, list(MODES)) & (modes != _OPERATIONAL)))
    if not bad.any():
        return

    def values(row: int) -> Values:
        mode = int(modes[row])
        return {"health": HEALTHS[int(codes[row])], "mode": MODES.get(mode, str(mode))}

    fresh = (codes == 0) & (modes == _INITIALIZATION) & (table["uptime_sec"] < view.number("BUS-022", "start_s"))
    for rows, said in ((np.flatnonzero(bad & ~fresh), None), (np.flatnonzero(bad & fresh), "note")):
        if len(rows):
            key = codes[rows].astype(np.int64) * 8 + modes[rows]
            yield view.among_rows("BUS-022", table, rows, values, key=key, severity=said)


class TimeMasters(Watcher):
    """Two nodes that send the time within a short while."""

    rules: ClassVar[tuple[str, ...]] = ("BUS-031",)

    def __init__(self) -> None:
        self._last: dict[tuple[int, int], int] = {}

    def look(self, view: View) -> Iterator[Occurrence]:
        """Each time that came soon after another node's."""
        table = view.table(TIME_SYNC)
        if table is None:
            return
        window = view.number("BUS-031", "window_s") * SECOND
        for row in np.flatnonzero(table.trusted & (table.t != NO_TIME) & (table.src > 0)).tolist():
            t, bus, src = int(table.t[row]), int(table.bus[row]), int(table.src[row])
            for (other_bus, other), at in self._last.items():
                if other_bus == bus and other != src and t - at <= window:
                    first, second = sorted((src, other))
                    values = {"first_node": first, "second_node": second}
                    frames = tuple(view.transfers.frames(int(table.row[row])))
                    yield Occurrence("BUS-031", t, bus, second, TIME_SYNC, frames, values)
            if len(self._last) < MOST:
                self._last[bus, src] = t


class Allocations(Watcher):
    """The table of unique IDs and node IDs, as allocators gave them; the first `MOST`."""

    rules: ClassVar[tuple[str, ...]] = ("BUS-030",)

    def __init__(self) -> None:
        self._nodes: dict[tuple[int, bytes], int] = {}
        self._owners: dict[tuple[int, int], bytes] = {}
        self._asked: dict[tuple[int, bytes], Occurrence] = {}

    def look(self, view: View) -> Iterator[Occurrence]:
        """Node IDs that were given."""
        table = view.table(ALLOCATION)
        if table is None:
            return
        for row in np.flatnonzero(table.trusted).tolist():
            unique = bytes(table.cell("unique_id", row) or b"")
            bus, src, node = int(table.bus[row]), int(table.src[row]), int(table["node_id"][row])
            about = (int(table.t[row]), bus, src or None, ALLOCATION, tuple(view.transfers.frames(int(table.row[row]))))
            if src and node and len(unique) == _ID_BYTES:
                state = self._give(bus, unique, node)
                values = {"unique_id": unique.hex().upper(), "given_node": node, "state": state or "given"}
                yield Occurrence("BUS-030", *about, values, severity="error" if state else None)
            elif not src and table["first_part_of_unique_id"][row] and len(self._asked) < MOST:
                values = {"unique_id": unique.hex().upper() + "..", "given_node": "none", "state": "asked in vain"}
                lines = view.lines(about[-1])
                self._asked.setdefault((bus, unique), Occurrence("BUS-030", *about, values, lines=lines))

    def settle(self, _view: View) -> Iterator[Occurrence]:
        """Nodes that asked and were given none."""
        for (bus, part), asked in self._asked.items():
            if not any(at == bus and unique.startswith(part) for at, unique in self._nodes):
                yield asked

    def _give(self, bus: int, unique: bytes, node: int) -> str:
        """Notes who has which ID; what contradicts it, if anything does."""
        had, owner = self._nodes.get((bus, unique), node), self._owners.get((bus, node), unique)
        if len(self._nodes) < MOST:
            self._nodes[bus, unique] = node
            self._owners[bus, node] = unique
        if had != node:
            return f"but had node {had} before"
        return "" if owner == unique else f"as has {owner.hex().upper()}"


WATCHERS: tuple[type[Watcher], ...] = (health, TimeMasters, Allocations)
