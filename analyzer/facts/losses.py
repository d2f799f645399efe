"""Transfers that did not come, by the gaps in their IDs; of two counters under one node ID nobody can say how many.

There are gaps behind which nothing is missing: of a counter for all types of a node, and of one begun anew. The rules
say so with all their evidence (TRF-019, TRF-020, BUS-010); here are the sums of a node without them.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from analyzer import _native
from dissectors.kit.cells import numbers, valid
from dissectors.times import NO_TIME

if TYPE_CHECKING:
    import pyarrow as pa

FEWEST_RETURNS = 4  # gaps behind which a counter goes on as if nothing had been there
RETURNING = 1 / 4  # of the gaps, at least: of lost transfers one in 32 looks like that by chance
FEWEST_COMMON = 8  # gaps of a node: of fewer chance makes it look so
COMMON = 1 / 4  # of the gaps, at most, that are left if one counter serves all types: by chance nearly all are
_COLUMNS = ("bus", "src", "dst", "kind", "type_id", "transfer_id", "step", "anomaly")
Node = tuple[int, int]  # bus, source


class _Sums(NamedTuple):
    """Of a node: lost; lost if one counter serves all its types, and whether it does or not; gaps, and where from.

    `returns` are gaps that return from one, `types` sessions with gaps, `zeroed` what counters that fell to 0 left out.
    """

    lost: int
    common: int
    by_both: int
    gaps: int
    returns: int
    types: int
    zeroed: int


class LostTransfers:
    """Adds up gaps by node."""

    def __init__(self) -> None:
        self._native = _native.Losses()

    def feed(self, transfers: pa.RecordBatch) -> None:
        """Count how far transfer IDs ran ahead of the transfers that came.

        What comes in another order runs ahead and falls back by as much.
        """
        times = transfers.column("t")
        t = numbers(times)
        if times.null_count:
            t = np.where(valid(times), t, NO_TIME)
        self._native.feed((t, *(numbers(transfers.column(name)) for name in _COLUMNS)))

    def _sums(self, at: Node) -> _Sums:
        return _Sums._make(self._native.sums(at[0] << 8 | at[1]))

    def shared(self, at: Node) -> bool:
        """Return whether two counters run under a node ID: what lies between them is not lost."""
        sums = self._sums(at)
        return sums.returns >= max(FEWEST_RETURNS, RETURNING * sums.gaps)

    def lost(self, at: Node, *, began_anew: bool) -> int | None:
        """Return how many transfers of a node did not come; None if they cannot be counted.

        A node that `began_anew` begins with ID 0, and has lost nothing by that.
        """
        if self.shared(at):
            return None
        sums = self._sums(at)
        lost = max(0, sums.lost + (0 if began_anew else sums.zeroed))
        one_counter = sums.by_both < lost * COMMON
        if sums.types > 1 and sums.gaps >= FEWEST_COMMON and one_counter:
            return round(sums.common / sums.types)  # a gap of the one counter is one of each type
        return lost
