"""UUIDs of ParamGet: one device each, and always the same (4.4.2 no 2-5, 4.2.1)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from dissectors.conformance import NO_TIME, SECOND, Occurrence, Watcher
from dissectors.tmotor.rules.series import NODES, sender, usable

if TYPE_CHECKING:
    from collections.abc import Iterator

    from dissectors.conformance import Table, View

_STATUS = "uavcan.protocol.NodeStatus"
_MOST_DEVICES = 4096
_MOST_CLAIMS = 256


@dataclass(slots=True)
class _Known:
    """Who has a UUID, or what UUID is somewhere, and when that was last reported."""

    what: int
    t: int


@dataclass(slots=True)
class _Claim:
    """A breach unless `node`, which was known since `since`, restarted or fell silent before transfer `number`.

    A `silent` node did not send anything since then.
    """

    breach: Occurrence
    node: int
    since: int
    number: int
    known: _Known
    instead: int
    silent: bool


class Identity(Watcher):
    """Holds a contradiction back until the next NodeStatus of the node that had the UUID denies a restart."""

    rules = ("TYP-403",)

    def __init__(self) -> None:
        self._owners: dict[tuple[int, int], _Known] = {}  # by bus and UUID
        self._places: dict[tuple[int, int, int], _Known] = {}  # by bus, node and index
        self._claims: list[_Claim] = []
        self._uptimes = np.zeros(NODES, np.int64)  # the last of each node, in seconds

    def look(self, view: View) -> Iterator[Occurrence]:
        """Reports and states of nodes, in order."""
        reports, states = view.table("ParamGet"), view.table(_STATUS)
        rows: list[tuple[int, Table, int]] = []
        for table in (reports, states):
            if table is None:
                continue
            good = np.flatnonzero(usable(table))
            if reports is not None or self._claims:
                rows += ((int(table["transfer"][row]), table, row) for row in good.tolist())
            else:
                self._uptimes[sender(table, good)] = table["uptime_sec"][good]
        for number, table, row in sorted(rows, key=lambda one: one[0]):
            if table.name == _STATUS:
                yield from self._state(table, row)
            else:
                yield from self._report(view, table, row, number)
        self._listen(view)

    def settle(self, _view: View) -> Iterator[Occurrence]:
        """What no NodeStatus decided any more."""
        for claim in self._claims:
            if not claim.silent:
                yield claim.breach

    def _report(self, view: View, table: Table, row: int, number: int) -> Iterator[Occurrence]:
        bus, node, t = int(table.bus[row]), int(table.src[row]), int(table.t[row])
        uuid, index = int(table["esc_uuid"][row]), int(table["esc_index"][row])
        if len(self._owners) >= _MOST_DEVICES or len(self._places) >= _MOST_DEVICES:
            self._owners.clear()
            self._places.clear()
        owner = self._owners.setdefault((bus, uuid), _Known(node, t))
        place = self._places.setdefault((bus, node, index), _Known(uuid, t))
        if owner.what != node:
            what, known, instead, watched = f"nodes {owner.what} and {node}", owner, node, owner.what
        elif place.what != uuid:
            what, known, instead, watched = f"index {index} had {place.what:08X} before", place, uuid, node
        else:
            owner.t = place.t = t
            return
        frames = tuple(view.transfers.frames(int(table.row[row])))
        breach = Occurrence(
            "TYP-403", t, bus, node, table.name, frames, {"uuid": uuid, "what": what}, lines=view.lines(frames)
        )
        if len(self._claims) >= _MOST_CLAIMS:
            yield self._claims.pop(0).breach
        self._claims.append(_Claim(breach, watched, known.t, number, known, instead, silent=watched != node))

    def _state(self, table: Table, row: int) -> Iterator[Occurrence]:
        """A NodeStatus decides the claims that wait for its node."""
        bus, node, t = int(table.bus[row]), int(table.src[row]), int(table.t[row])
        uptime, code = int(table["uptime_sec"][row]), bus << 7 | node
        fell = uptime < self._uptimes[code]
        self._uptimes[code] = uptime
        waiting = [claim for claim in self._claims if (claim.breach.bus, claim.node) == (bus, node)]
        if not waiting:
            return
        self._claims = [claim for claim in self._claims if (claim.breach.bus, claim.node) != (bus, node)]
        start = NO_TIME if t == NO_TIME else t - (uptime + 1) * SECOND
        for claim in waiting:
            if fell or start > claim.since:
                claim.known.what, claim.known.t = claim.instead, claim.breach.t
            else:
                yield claim.breach

    def _listen(self, view: View) -> None:
        """Notes which of the nodes that claims wait for go on sending."""
        transfers = view.transfers
        for claim in self._claims:
            if claim.silent:
                later = slice(max(claim.number + 1 - transfers.first, 0), None)
                heard = (transfers.src[later] == claim.node) & (transfers.bus[later] == claim.breach.bus)
                claim.silent = not heard.any()


WATCHERS: tuple[type[Watcher], ...] = (Identity,)
