"""ESCStatus: how a node encodes floats (5.2)."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from dissectors.kit import NODES, Rule, breach, sender, usable
from dissectors.records import dataclass, field, replace

if TYPE_CHECKING:
    from collections.abc import Iterator

    from dissectors.kit import Array, DecodedTable, Occurrence, Occurrences, View

_FLOATS = ("voltage", "current", "temperature")
_LOW_BITS = 7  # what the mask of 5.2 as printed never lets through


def _first_rows(node: Array) -> Iterator[tuple[int, int]]:
    """Yield each node that is there, and the first of its rows."""
    codes, at = np.unique(node, return_index=True)
    yield from zip(codes.tolist(), at.tolist(), strict=True)


@dataclass(slots=True)
class _Coarse:
    """A node all of whose floats end in 000 so far; `different` are the first of its values."""

    place: Occurrence
    transfers: int = 0
    values: int = 0
    different: set[int] = field(default_factory=set)


class CoarseFloats(Rule):
    """float16 with a mantissa of 7 bits (5.2); nodes by bus and ID, so their number is bounded."""

    rules = ("TYP-009",)

    def __init__(self) -> None:
        self._fine = np.zeros(NODES, bool)  # nodes that sent another mantissa
        self._coarse: dict[int, _Coarse] = {}

    def feed(self, view: View) -> Iterator[Occurrences]:
        """Count; nothing is certain before the end."""
        table = view.table("ESCStatus")
        if table is not None:
            rows = usable(table).nonzero()[0]
            node = sender(table, rows)
            still = ~self._fine[node]
            if still.any():
                self._count(view, table, rows[still], node[still], int(view.number("TYP-009", "min_values")))
        yield from ()

    def _count(self, view: View, table: DecodedTable, rows: Array, node: Array, enough: int) -> None:
        with np.errstate(over="ignore"):
            codes = np.stack([table[name][rows].astype(np.float16).view(np.uint16) for name in _FLOATS])
        finite = codes >> 10 & 31 != 31
        self._fine[node[((codes & _LOW_BITS != 0) & finite).any(axis=0)]] = True
        for code, at in _first_rows(node):
            if self._fine[code]:
                self._coarse.pop(code, None)
                continue
            if code not in self._coarse:
                self._coarse[code] = _Coarse(breach(view, table, int(rows[at]), "TYP-009", {}, held=True))
            one, mine = self._coarse[code], node == code
            good = finite[:, mine]
            one.transfers += int(mine.sum())
            one.values += int(good.sum())
            if len(one.different) < enough:
                one.different.update(np.unique(codes[:, mine][good])[:enough].tolist())

    def finish(self, view: View) -> Iterator[Occurrence]:
        """Yield nodes with enough transfers and values."""
        transfers, different = (view.number("TYP-009", name) for name in ("min_transfers", "min_values"))
        for _, one in sorted(self._coarse.items()):
            if one.transfers >= transfers and len(one.different) >= different:
                yield replace(one.place, values={"values": one.values, "transfers": one.transfers})
