"""Limits of what a recording can show: whether its start was seen, its times agree, and losses were written down."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from analyzer.decode.columns import NODES, senders
from analyzer.facts.error_frames import CONTROLLER, overflowed
from analyzer.facts.node_status import NODE_STATUS
from analyzer.facts.recorder import DROPS, ERRORS, stated
from analyzer.facts.traffic import times
from analyzer.tables import EVENTS, STAMPS, VERDICTS
from dissectors.kit.cells import numbers
from dissectors.times import SECOND

if TYPE_CHECKING:
    from collections.abc import Iterable

    import pyarrow as pa

    from analyzer.decode.core import Totals
    from analyzer.decode.engine import Batch

_DROP, _ERROR_FRAME = EVENTS.index("drop"), EVENTS.index("error frame")
_ORIGINS = STAMPS[:5]  # what times count from; the others are how finely they do
_NONE = STAMPS[4]
_WHOLE = 2 * SECOND  # an uptime is in whole seconds, and its first report takes up to one more


class RecordingFacts:
    """Adds up batches; bounded by the nodes that there can be."""

    def __init__(self) -> None:
        self.lossy = False  # the recorder has told of frames that it lost
        self._stated: set[str] | None = None
        self._cut = False
        self._first: int | None = None
        self._running: dict[tuple[int, int], bool] = {}  # whether a node ran before the capture began
        self._heard = np.zeros(NODES, bool)  # of which nodes, by bus and node ID, that is known

    def feed(self, batch: Batch) -> None:
        """Add the next batch."""
        if self._first is None and len(batch.frames):
            self._cut = batch.first_frame > 0
            t, valid = times(batch.frames)
            self._first = int(t[int(np.argmax(valid))]) if valid.any() else None
        self._note_drops(batch.events)
        if self._stated is None and len(batch.events):
            self._stated = stated(batch.events)
        table = batch.messages.get(NODE_STATUS)
        if table is not None and "uptime_sec" in table.schema.names:  # a folder may have another type of this name
            self._note_uptimes(table)

    def judge(self, totals: Totals, stamps: Iterable[str], *, timed: bool) -> dict[str, str]:
        """Return the answers in words: yes, NO, unknown.

        For `stamps`, which are the kinds that were met, those themselves.
        """
        kinds, said = list(stamps), self._stated or ()
        return {
            "transfers": "yes" if totals.verdicts[VERDICTS[0]] else "NO",
            "timing": "yes" if timed else "NO",
            "drops": "yes" if self.lossy or DROPS in said else "unknown",
            "errors": "yes" if totals.lines["error_frames"] or ERRORS in said else "NO",
            "start": self._start(),
            "stamps": ("mixed: " if mixed(kinds) else "") + (", ".join(kinds) or _NONE),
        }

    def _start(self) -> str:
        """Say that the start was seen if every node that tells its uptime was switched on while it was recorded."""
        if self._cut or any(self._running.values()):
            return "NO"
        return "yes" if self._running else "unknown"

    def _note_drops(self, events: pa.RecordBatch) -> None:
        if self.lossy or not len(events):
            return
        kinds, classes = numbers(events.column("kind")), numbers(events.column("class"))
        self.lossy = bool((kinds == _DROP).any()) or any(
            overflowed(int(classes[row]), events.column("data")[row].as_py() or b"")
            for row in np.flatnonzero((kinds == _ERROR_FRAME) & (classes & CONTROLLER != 0)).tolist()
        )

    def _note_uptimes(self, table: pa.RecordBatch) -> None:
        if self._first is None:
            return
        t, valid = times(table)
        nodes = senders(table)
        new = valid & numbers(table.column("trusted")) & ~self._heard[nodes]
        rows = new.nonzero()[0]
        if not len(rows):
            return
        uptime = numbers(table.column("uptime_sec"))
        codes, first = np.unique(nodes[rows], return_index=True)
        self._heard[codes] = True
        for code, row in zip(codes.tolist(), rows[first].tolist(), strict=True):
            self._running[code >> 8, code & 0xFF] = int(uptime[row]) * SECOND > int(t[row]) - self._first + _WHOLE


def mixed(stamps: Iterable[str]) -> bool:
    """Return whether times of different origins stand side by side: they cannot be compared."""
    return len(set(stamps) & set(_ORIGINS)) > 1
