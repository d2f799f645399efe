"""Events of nodes: they join, start anew, say something, and arm."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from analyzer.decode.columns import senders
from analyzer.facts.node_status import NODE_STATUS
from analyzer.flight.clock import ANEW
from analyzer.flight.flights import ARMED, ARMING
from analyzer.flight.log import FlightEvent
from analyzer.flight.thresholds import lasting
from analyzer.tables import distinct
from dissectors.kit.cells import numbers, pylist
from dissectors.kit.order import changes, groups
from dissectors.times import NO_TIME, SECOND

if TYPE_CHECKING:
    from collections.abc import Mapping

    import pyarrow as pa

    from analyzer.decode.engine import Batch
    from analyzer.flight.clock import RowPlaces, Spot
    from analyzer.flight.reports import EventOrder
    from dissectors.kit import Array

LOG = "uavcan.protocol.debug.LogMessage"
MOST_TEXT = 200  # characters of what somebody says
_LEVELS = ("debug", "info", "warning", "error")


class NodeEvents:
    """Adds up batches; bounded by the nodes that there can be.

    Args:
        order: the clock and the tables of the capture, and who takes the events.
    """

    def __init__(self, order: EventOrder) -> None:
        self._clock, self._add, self._reader = order.clock, order.add, order.reader
        self._seen = np.zeros(1 << 16, bool)  # by bus and node
        self._anew: dict[int, int] = {}  # recorded time at which transfer IDs of a node began anew
        self._uptimes: dict[int, tuple[int, Spot]] = {}
        self._armed: dict[int, tuple[int, Spot]] = {}

    def feed(self, batch: Batch) -> None:
        """Add the next batch."""
        self._note_transfers(batch)
        for name, column, feed in (
            (NODE_STATUS, "uptime_sec", self._note_uptimes),
            (LOG, "text", self._note_texts),
            (ARMING, "status", self._note_arming),
        ):
            table = self._reader.rows(name, batch)
            if table is not None and column in table.schema.names:  # a folder may have another type of this name
                feed(table)

    def finish(self) -> None:
        """Take the end: everything has been told."""

    def _note_transfers(self, batch: Batch) -> None:
        """Note who joins, and whose transfer IDs begin anew."""
        at = self._clock.transfers
        bus, src = (numbers(batch.transfers.column(name)).astype(np.uint16) for name in ("bus", "src"))
        timed = np.flatnonzero((src > 0) & (at.t != NO_TIME))
        node = bus << 8 | src
        node = node if len(timed) == len(node) else node[timed]
        start = self._clock.start or 0
        for code in distinct(node):
            if not self._seen[code]:
                self._seen[code] = True
                spot = at.at(int(timed[np.flatnonzero(node == code)[0]]))
                if spot.ran - start > lasting("join"):
                    self._tell("join", "is heard for the first time", None, spot, code)
        anew = np.flatnonzero(at.step == ANEW)
        if len(anew):
            anew = anew[(src[anew] > 0) & (at.t[anew] != NO_TIME)]
            self._anew.update(zip((bus[anew] << 8 | src[anew]).tolist(), at.ran[anew].tolist(), strict=True))

    def _note_uptimes(self, table: pa.RecordBatch) -> None:
        """Note uptimes that fell and can have begun since the report before, and how they went on behind holes."""
        at, node = self._clock.of(table), senders(table)
        uptime = numbers(table.column("uptime_sec")).astype(np.int64)
        for code, rows in _timed(node, at):
            mine, seconds = at.take(rows), uptime[rows]
            known = self._uptimes.get(code)
            before = np.concatenate(([known[0] if known else seconds[0]], seconds[:-1]))
            for k in np.flatnonzero(seconds < before).tolist():
                last = mine.at(k - 1) if k else known[1] if known else mine.at(k)
                if int(seconds[k]) * SECOND <= mine.t[k] - last.t + lasting("restart"):
                    self._restart(code, last, mine.at(k), int(before[k]), int(seconds[k]))
            self._cross(seconds, before, mine, known)
            self._uptimes[code] = int(seconds[-1]), mine.at(-1)

    def _cross(self, seconds: Array, before: Array, at: RowPlaces, known: tuple[int, Spot] | None) -> None:
        holes = self._clock.holes
        if not holes:
            return
        behind = self._clock.holes_before(at.frame)
        first = int(self._clock.holes_before(np.array([known[1].frame]))[0]) if known else int(behind[0])
        for k in changes(behind, first).tolist():
            holes[int(behind[k]) - 1].uptimes.append(int(seconds[k] - before[k]) * SECOND)

    def _restart(self, code: int, last: Spot, here: Spot, before: int, now: int) -> None:
        text = f"starts anew: uptime {before} s -> {now} s"
        anew = self._anew.get(code)
        if anew is not None and last.ran <= anew <= here.ran:
            text += ", transfer IDs from 0"
        self._tell("restart", text, last, here, code, NODE_STATUS, {"uptime_before_s": before, "uptime_s": now})

    def _note_texts(self, table: pa.RecordBatch) -> None:
        """Take what nodes say in words."""
        at, node = self._clock.of(table), senders(table)
        texts, sources = (_words(table, name) for name in ("text", "source"))
        levels: list[Any] = pylist(table.column("level")) if "level" in table.schema.names else [None] * len(table)
        for row in np.flatnonzero(at.t != NO_TIME).tolist():
            level = (levels[row] or {}).get("value")
            name = _LEVELS[level] if isinstance(level, int) and 0 <= level < len(_LEVELS) else ""
            said = " ".join(part for part in (name, f"{sources[row]}:" * bool(sources[row]), texts[row]) if part)
            spot = at.at(row)
            self._tell("message", said[:MOST_TEXT], spot, spot, int(node[row]), LOG)

    def _note_arming(self, table: pa.RecordBatch) -> None:
        """Note when the vehicle is armed and disarmed."""
        at, node = self._clock.of(table), senders(table)
        armed = (numbers(table.column("status")) == ARMED).astype(np.int64)
        for code, rows in _timed(node, at):
            mine, now = at.take(rows), armed[rows]
            known = self._armed.get(code)
            for k in changes(now, known[0] if known else now[0]).tolist():
                last = mine.at(k - 1) if k else known[1] if known else mine.at(k)
                self._tell("arming", "is armed" if now[k] else "is disarmed", last, mine.at(k), code, ARMING)
            self._armed[code] = int(now[-1]), mine.at(-1)

    def _tell(
        self, kind: str, text: str, before: Spot | None, here: Spot, code: int, type_: str = "",
        values: Mapping[str, float] | None = None,
    ) -> None:  # fmt: skip
        self._add(FlightEvent(
            kind, text, before, here, None, code >> 8, code & 0xFF, None, type_, "", values or {}
        ))  # fmt: skip


def _timed(node: Array, at: RowPlaces) -> list[tuple[int, Array]]:
    """Return the rows that have a time, by node."""
    rows = np.flatnonzero(at.t != NO_TIME)
    return [(code, rows[places]) for code, places in groups(node[rows])]


def _words(table: pa.RecordBatch, name: str) -> list[str]:
    """Return a column of texts, whether it is decoded as text or as the numbers of its letters."""
    cells: list[Any] = pylist(table.column(name)) if name in table.schema.names else [None] * len(table)
    return [cell if isinstance(cell, str) else bytes(cell or ()).decode("utf-8", "replace") for cell in cells]
