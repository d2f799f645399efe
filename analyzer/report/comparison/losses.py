"""The first transfers that are missing or broken, of each sender: where a loss begins."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from analyzer.facts.traffic import times
from analyzer.tables import STATUSES, TRANSFER_ANOMALIES
from dissectors.kit.cells import numbers
from dissectors.records import dataclass

if TYPE_CHECKING:
    from analyzer.decode.engine import Batch
    from dissectors.kit import Array

MOST_NODES = 4096
_GAP = 1 << TRANSFER_ANOMALIES.index("transfer id gap")
_WHOLE = [STATUSES.index(name) for name in ("ok", "unchecked", "open")]


@dataclass(frozen=True, slots=True)
class LossPlace:
    """Where it was: a time in ns, and the number of a frame, from 1."""

    t: int | None
    frame: int | None


class FirstLosses:
    """Adds up batches: of at most `MOST_NODES` nodes the first gap of transfer IDs, and the first broken transfer."""

    def __init__(self) -> None:
        self.lost: dict[tuple[int, int], LossPlace] = {}
        self.broken: dict[tuple[int, int], LossPlace] = {}

    def feed(self, batch: Batch) -> None:
        """Add the next batch."""
        transfers = batch.transfers
        anomaly, status = numbers(transfers.column("anomaly")), numbers(transfers.column("status"))
        self._note(self.lost, batch, np.flatnonzero(anomaly & _GAP))
        self._note(self.broken, batch, np.flatnonzero(~np.isin(status, _WHOLE)))

    def _note(self, places: dict[tuple[int, int], LossPlace], batch: Batch, rows: Array) -> None:
        if not rows.size or len(places) >= MOST_NODES:
            return
        transfers = batch.transfers
        bus, src = (numbers(transfers.column(name))[rows].astype(np.int64) for name in ("bus", "src"))
        _, firsts = np.unique(bus << 8 | src, return_index=True)
        t, timed = times(transfers)
        for k in firsts.tolist():
            row = int(rows[k])
            frames = transfers.column("frame")[row].as_py()
            first = None if not frames else (frames[0] if batch.places is None else batch.places.of(frames[0])) + 1
            place = LossPlace(int(t[row]) if timed[row] else None, first)
            places.setdefault((int(bus[k]), int(src[k])), place)
