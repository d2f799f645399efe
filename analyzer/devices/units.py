"""Names of devices: ESC 1 on the first interface is `esc1`, wherever its values come from."""

from __future__ import annotations

from typing import TYPE_CHECKING

from dissectors.records import dataclass

if TYPE_CHECKING:
    from dissectors.picture import Who

MOST_UNITS = 4096


@dataclass(frozen=True, slots=True)
class Unit:
    """A device: the parts of its entity path, what people call it, and its number, which gives it its colour."""

    parts: tuple[str, ...]
    title: str
    owner: str
    number: int


class Units:
    """Names units in the order in which they appear.

    Those of the capture's first interface have no interface in their names. A second node that reports a number of
    which another one spoke first on that bus, in the same kind of table, is named beside it.
    """

    def __init__(self) -> None:
        self._nodes: dict[tuple[str, str, int, int], int] = {}
        self._known: dict[tuple[str, Who, int, int, int], Unit] = {}

    def unit(self, table: str, who: Who, bus: int, node: int, number: int, bus_name: str) -> Unit | None:
        """Return the device that `node` speaks of as `number` in `table`.

        None for those beyond the first `MOST_UNITS`.
        """
        key = (table, who, bus, node, number)
        if key not in self._known:
            if len(self._known) >= MOST_UNITS:
                return None
            self._known[key] = self._make(table, who, bus, node, number, bus_name)
        return self._known[key]

    def _make(self, table: str, who: Who, bus: int, node: int, number: int, bus_name: str) -> Unit:
        own = not who.column and not who.elements
        shown = node if own else number + who.first
        name, title = f"{who.path}{shown}", f"{who.title} {shown}"
        if not own and self._nodes.setdefault((table, who.path, bus, number), node) != node:
            name, title = f"{name}_node{node}", f"{title} (node {node})"
        if bus:
            return Unit((bus_name or f"bus{bus}", name), f"{bus_name or f'bus {bus}'} {title}", who.path, shown)
        return Unit((name,), title, who.path, shown)
